//! `sarrus robots`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use sarrus_models::{Options, Source, bundled, load, texts};
use sarrus_proto::Sizes;
use serde::Serialize;

use super::output::{Format, FormatFlag, finish, json_line, table, write_new};
use super::robot::refuse;

/// Flags of `robots`.
#[derive(Args)]
pub(crate) struct Robots {
    #[command(flatten)]
    format: FormatFlag,
    /// Writes the files of a bundled robot into a folder, NAME.urdf and NAME.yml, to begin a robot
    /// of one's own with; files that are there stay as they are.
    #[arg(
        long,
        num_args = 2,
        value_names = ["NAME", "DIR"],
        value_parser = NonEmptyStringValueParser::new(),
        conflicts_with = "format"
    )]
    export: Option<Vec<String>>,
}

#[derive(Serialize)]
struct Line {
    robot: &'static str,
    about: &'static str,
    sizes: Sizes,
}

impl Robots {
    pub(crate) fn run(self) -> ExitCode {
        if let Some([name, folder]) = self.export.as_deref() {
            return export(name, Path::new(folder));
        }
        let mut lines = Vec::new();
        for (robot, about) in bundled() {
            match load(&Source::Bundled(robot.to_owned()), &Options::default()) {
                Ok(loaded) => {
                    lines.push(Line { robot, about, sizes: loaded.compiled.model.sizes() })
                }
                Err(error) => return refuse("robots", &error),
            }
        }
        let results = match self.format.format {
            Format::Json => json_line(&lines),
            Format::Text => in_words(&lines),
        };
        finish("robots", &results, 0)
    }
}

/// Writes the files of a robot: 0, or 2 where there is no such robot or a file cannot be written.
fn export(name: &str, folder: &Path) -> ExitCode {
    let source = Source::Bundled(name.to_owned());
    let (urdf, submechanisms) = match texts(&source) {
        Ok(texts) => texts,
        Err(error) => return refuse("robots", &error),
    };
    let files = [("urdf", Some(urdf)), ("yml", submechanisms)];
    let files = files
        .into_iter()
        .filter_map(|(ending, text)| Some((folder.join(format!("{name}.{ending}")), text?)));
    let files: Vec<(PathBuf, Vec<u8>)> = files.collect();
    write_new("robots", folder, &files)
}

fn in_words(lines: &[Line]) -> String {
    let row = |line: &Line| {
        let Sizes { n_v, n_vy, n_u, n_c, .. } = line.sizes;
        let mut row = vec![line.robot.to_owned()];
        row.extend([n_v, n_vy, n_u, n_c].map(|n| n.to_string()));
        row.push(line.about.to_owned());
        row
    };
    let rows: Vec<Vec<String>> = lines.iter().map(row).collect();
    table(&["robot", "tree", "independent", "active", "loop rows", "about"], &rows)
}
