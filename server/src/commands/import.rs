//! `sarrus import`: robots of other formats as a URDF and a submechanism file.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::Options;
use sarrus_models::{Imported, LoadError, Report, import};

use super::output::{Failure, Outcome, Results, file_name, labelled, write_new};
use super::robot::{diagnostics, notes};

/// Longest time of the program `xacro`.
const XACRO: Duration = Duration::from_secs(60);

/// Flags of `import`.
#[derive(Args)]
pub(crate) struct Import {
    /// Files of MJCF or SDF, YAML files of Gepetto's tools beside their URDF, or URDF files with
    /// loops in the elements of other programs; one for each robot.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// The folder for NAME.urdf and NAME.yml of each robot; existing files stay.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Parts that cannot be expressed are left out with a warning.
    #[arg(long)]
    lenient: bool,
    /// A folder below which files are read that FILE names; without it only those below the folder
    /// of FILE. May be given several times.
    #[arg(long, value_name = "DIR")]
    include_dir: Vec<PathBuf>,
    /// Expand FILE by the program `xacro` of the package of that name first.
    #[arg(long)]
    xacro: bool,
}

impl Import {
    pub(crate) fn run(self) -> Outcome {
        let options = Options { lenient: self.lenient, ..Options::default() };
        let mut results = Results { text: String::new(), code: 0 };
        for file in &self.files {
            let expanded = self.xacro.then(|| expand(file)).transpose()?;
            let imported = match import(file, expanded, &self.include_dir, &options) {
                Ok(imported) => imported,
                Err(LoadError::Faults(report)) => {
                    eprint!("{}", in_words(&report));
                    results.code = 1;
                    continue;
                }
                Err(other) => return Err(other.into()),
            };
            eprint!("{}", in_words(&imported.report));
            results.text += &self.write(&imported)?;
            results.code |= u8::from(!imported.report.errors.is_empty());
        }
        Ok(results)
    }

    /// Writes both files; their names, and the facts about the closed robot.
    fn write(&self, imported: &Imported) -> Result<String, Failure> {
        let name = file_name(&imported.name);
        let path = |ending: &str| self.out.join(format!("{name}.{ending}"));
        let files =
            [(path("urdf"), imported.urdf.clone()), (path("yml"), imported.submechanisms.clone())];
        let mut text = write_new(&self.out, &files)?.text;
        if let Some(residual) = imported.residual {
            text += &labelled("closure", format!("{residual:.3e} off at the file's pose, scaled"));
        }
        if let Some((key, closed)) = &imported.keyframe {
            let state = match &closed.error {
                Some(error) => error.clone(),
                None => format!(
                    "{:.3e} off, closed at a distance of {:.3e}",
                    closed.residual_before, closed.distance
                ),
            };
            text += &labelled("keyframe", format!("{key}: {state}"));
        }
        if !imported.independent.is_empty() {
            text += &labelled("independent", imported.independent.join(" "));
            let rule =
                "those that determine all others: actuated ones first, then those on the base";
            text += &labelled("", rule);
        }
        Ok(text)
    }
}

/// Notes, warnings and errors, a line each.
fn in_words(report: &Report) -> String {
    notes(&report.notes) + &diagnostics(&report.errors, &report.warnings)
}

/// The text of a file as `xacro` expands it; its words go to stderr.
fn expand(file: &Path) -> Result<Vec<u8>, Failure> {
    let failed = |why: String| Failure::start(format!("xacro {}: {why}", file.display()));
    let broken = |error: std::io::Error| failed(format!("{error}; install it: pip install xacro"));
    let mut program = Command::new("xacro");
    program.arg(file).stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = program.spawn().map_err(broken)?;
    let text = child.stdout.take().map(|mut stream| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            stream.read_to_end(&mut bytes).map(|_| bytes)
        })
    });
    let start = Instant::now();
    while child.try_wait().map_err(broken)?.is_none() {
        if start.elapsed() > XACRO {
            child.kill().and_then(|()| child.wait()).map_err(broken)?;
            return Err(failed(format!("it takes more than {} s", XACRO.as_secs())));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let status = child.wait().map_err(broken)?;
    if !status.success() {
        return Err(Failure { code: 1, ..failed(status.to_string()) });
    }
    text.and_then(|text| text.join().ok()).unwrap_or(Ok(Vec::new())).map_err(broken)
}
