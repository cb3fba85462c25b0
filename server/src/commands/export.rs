//! `sarrus export`: a robot as files of other programs.

use std::path::{Path, PathBuf};

use clap::Args;
use sarrus_client::Options;
use sarrus_dynamics::description::Description;
use sarrus_models::{Exported, Source, Target, export, load};
use sarrus_report::peer::exported::{Deviation, Difference, Found, deviation, pythons};
use serde::Serialize;

use super::output::{Failure, FormatFlag, Outcome, Results, file_name, labelled, write_new};
use super::robot::{RobotFlags, notes, warn};
use super::{Choices, choice};

/// Flags of `export`.
#[derive(Args)]
pub(crate) struct Export {
    #[command(flatten)]
    robot: RobotFlags,
    /// The format.
    #[arg(long, value_parser = choice(&TARGETS), value_name = "FORMAT")]
    to: Target,
    /// The folder for the files, which have the robot's name; existing files stay.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    format: FormatFlag,
}

const TARGETS: Choices<Target, 5> = [
    (Target::Mjcf, "mjcf", "For MuJoCo"),
    (Target::Sdf, "sdf", "For Gazebo"),
    (Target::Urdf, "urdf", "A URDF and a submechanism file in canonical form"),
    (Target::Pinocchio, "pinocchio", "A URDF, and a Python file that builds the constraints"),
    (Target::Gepetto, "gepetto", "A URDF and the YAML file of Gepetto's tools"),
];

/// The written files, and their distance from the robot.
#[derive(Serialize)]
struct Written {
    files: Vec<PathBuf>,
    deviation: Deviation,
}

impl Export {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let name = file_name(&loaded.description.name);
        let options = self.robot.options();
        let exported = export(&loaded, self.to, &name, options.lenient)?;
        warn(&exported.report.warnings);
        eprint!("{}", notes(&exported.report.notes));
        let Exported { files, held, .. } = exported;
        let files: Vec<(PathBuf, Vec<u8>)> = files
            .into_iter()
            .map(|(ending, text)| (self.out.join(format!("{name}{ending}")), text.into_bytes()))
            .collect();
        write_new(&self.out, &files)?;
        let files: Vec<PathBuf> = files.into_iter().map(|(path, _)| path).collect();
        let with = |engine: &str, file: &Path| {
            let found = deviation(&loaded.description, &held, engine, file, &pythons());
            found.map_err(|error| Failure::start(error.to_string()))
        };
        let file = |ending: &str| {
            let found = files.iter().find(|file| file.extension().is_some_and(|of| of == ending));
            found.map(PathBuf::as_path).unwrap_or(Path::new(""))
        };
        let deviation = match self.to {
            Target::Mjcf => with("MuJoCo", file("xml"))?,
            Target::Pinocchio => with("Pinocchio", file("py"))?,
            Target::Gepetto => with("Pinocchio", file("yaml"))?,
            Target::Sdf => with("Drake", file("sdf"))?,
            Target::Urdf => again(&files, &held, &options)?,
        };
        let is_finding = matches!(&deviation, Deviation::Measured(found)
            if found.rows.iter().any(|row| row.is_finding()));
        let written = Written { files, deviation };
        let text = self.format.render(&written, in_words);
        Ok(Results { text, code: u8::from(is_finding) })
    }
}

/// The written files of our own, read again.
fn again(files: &[PathBuf], held: &Description, options: &Options) -> Result<Deviation, Failure> {
    let [urdf, submechanisms] = files else { return Err(Failure::start("two files")) };
    let source = Source::Files { urdf: urdf.clone(), submechanisms: Some(submechanisms.clone()) };
    // the files hold the base and the parts that are left
    let options = Options { gravity: options.gravity, ..Options::default() };
    let read = load(&source, &options)?;
    let [written, own] = [&read.description, held].map(Description::fingerprint);
    let rows = vec![Difference {
        quantity: "fingerprint".to_owned(),
        difference: if written == own { 0.0 } else { f64::INFINITY },
    }];
    Ok(Deviation::Measured(Found { engine: "sarrus".to_owned(), why: String::new(), rows }))
}

/// The files, and a line for each quantity.
fn in_words(written: &Written) -> String {
    let mut text: String =
        written.files.iter().map(|file| format!("{}\n", file.display())).collect();
    match &written.deviation {
        Deviation::NotRun(why) => text += &labelled("deviation", format!("not run: {why}")),
        Deviation::Measured(Found { engine, why, rows }) => {
            text += &labelled("deviation", format!("by {engine}, by size"));
            for Difference { quantity, difference } in rows {
                let why =
                    if quantity == "accelerations" { format!(": {why}") } else { String::new() };
                text += &labelled("", format!("{quantity:<13} {difference:.1e}{why}"));
            }
        }
    }
    text
}
