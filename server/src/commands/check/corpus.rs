//! `sarrus check --corpus`: the robots below a folder.

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use sarrus_models::{Options, Source, load};

use crate::commands::output::{Failure, Outcome, Results};

/// Endings of files that describe a robot by themselves.
const ENDINGS: [&str; 5] = ["urdf", "sdf", "smurf", "mjcf", "xml"];
/// Outermost elements of those with the ending `xml`.
const ELEMENTS: [&str; 3] = ["<mujoco>", "<mujoco ", "<robot"];
/// Bytes in which the outermost element stands.
const HEAD: u64 = 65_536;

/// A line for each robot, in the order of the files' names, and the counts.
pub(super) fn check(folder: &Path) -> Outcome {
    let mut files = Vec::new();
    collect(folder, &mut files)
        .map_err(|error| Failure::start(format!("cannot read {}: {error}", folder.display())))?;
    files.sort();
    let mut text = String::new();
    let mut counts = [0; 3];
    for file in &files {
        let beside = file.with_extension("yml");
        let urdf = file.clone();
        let source = Source::Files { urdf, submechanisms: beside.is_file().then_some(beside) };
        let outcomes = [("ok", false), ("lenient", true)];
        let attempt = |lenient| load(&source, &Options { lenient, ..Options::default() });
        let mut reason = String::new();
        let found = outcomes.iter().position(|(_, lenient)| {
            let fault = attempt(*lenient).map_err(|error| error.to_string());
            // a report has a line for each fault
            if let Err(lines) = &fault {
                reason = lines.lines().next().unwrap_or_default().to_owned();
            }
            fault.is_ok()
        });
        counts[found.unwrap_or(2)] += 1;
        let name = file.strip_prefix(folder).unwrap_or(file).display();
        let outcome = found.map_or("refused", |k| outcomes[k].0);
        text += format!("{outcome:8} {name}  {reason}").trim_end();
        text.push('\n');
    }
    let [ok, lenient, refused] = counts;
    let all = files.len();
    text += &format!("{all} robots: {ok} ok, {lenient} with --lenient, {refused} refused\n");
    Ok(Results { text, code: u8::from(refused > 0) })
}

/// The files of robots below a folder; links to folders are not followed.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let path = entry.path();
        let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
        if entry.file_type()?.is_dir() {
            collect(&path, files)?;
        } else if path.is_file()
            && ENDINGS.contains(&ending)
            && (ending != "xml" || is_robot(&path))
        {
            files.push(path);
        }
    }
    Ok(())
}

fn is_robot(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD).read_to_end(&mut head));
    let head = String::from_utf8_lossy(&head);
    read.is_ok() && ELEMENTS.iter().any(|element| head.contains(element))
}
