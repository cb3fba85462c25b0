//! `sarrus robots`.

use std::process::ExitCode;

use clap::Args;
use sarrus_models::{Options, Source, bundled, load};
use sarrus_proto::Sizes;
use serde::Serialize;

use super::output::{Format, FormatFlag, finish, json_line, table};
use super::robot::refuse;

/// Flags of `robots`.
#[derive(Args)]
pub(crate) struct Robots {
    #[command(flatten)]
    format: FormatFlag,
}

#[derive(Serialize)]
struct Line {
    robot: &'static str,
    about: &'static str,
    sizes: Sizes,
}

impl Robots {
    pub(crate) fn run(self) -> ExitCode {
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
