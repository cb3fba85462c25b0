//! `sarrus report`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use sarrus_models::{Source, bundled, load};
use sarrus_report::measure::Effort;
use sarrus_report::robots::Own;
use sarrus_report::{Options, names, run, synonyms};

use super::output::{Failure, Outcome, Results};
use super::robot::warn;

/// Flags of `report`.
#[derive(Args)]
pub(crate) struct Report {
    /// One bundled robot in place of all: the sections on robots alone.
    #[arg(long, value_name = "NAME", conflicts_with = "urdf")]
    robot: Option<String>,
    /// Your robot, a URDF or SMURF file, in place of the bundled ones.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Submechanism file that goes with --urdf.
    #[arg(long, value_name = "FILE", requires = "urdf")]
    submechanisms: Option<PathBuf>,
    /// Fewer states and shorter measurements: within three minutes, else half an hour.
    #[arg(long)]
    quick: bool,
    /// Only this section; may stand several times.
    #[arg(long = "section", value_name = "NAME", value_parser = section_names())]
    sections: Vec<String>,
    /// The folder for the page and its data.
    #[arg(long, value_name = "DIR", default_value = "target/report")]
    out: PathBuf,
}

/// The names of the sections, with their synonyms.
fn section_names() -> PossibleValuesParser {
    names().map(|name| PossibleValue::new(name).aliases(synonyms(name))).into()
}

impl Report {
    pub(crate) fn run(self) -> Outcome {
        let source = match (self.robot, self.urdf) {
            (Some(name), _) => Some(Source::Bundled(name)),
            (None, Some(urdf)) => Some(Source::Files { urdf, submechanisms: self.submechanisms }),
            (None, None) => None,
        };
        let own = match source {
            Some(source) => {
                let loaded = load(&source, &Default::default())?;
                warn(&loaded.report.warnings);
                Some(Own::with_files(loaded))
            }
            None => None,
        };
        let query = Options {
            own,
            effort: Effort { quick: self.quick },
            sections: self.sections,
            out: self.out,
        };
        // warnings about the files of the measured robots
        for (name, _) in bundled().filter(|_| own.is_none()) {
            if let Ok(loaded) = load(&Source::Bundled(name.to_owned()), &Default::default()) {
                warn(&loaded.report.warnings);
            }
        }
        let report = run(&query).map_err(Failure::start)?;
        let page = query.out.join("report.html").display().to_string();
        let lines = report.summary().into_iter().chain([page]).map(|line| line + "\n");
        let is_unfinished = report.sections.iter().any(|section| section.failure.is_some());
        let code = if is_unfinished { 2 } else { u8::from(report.silent_failures() > 0) };
        Ok(Results { text: lines.collect(), code })
    }
}
