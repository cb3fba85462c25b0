//! `sarrus report`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use clap::builder::PossibleValuesParser;
use sarrus_benches::report::{Effort, Wish, names, run};

/// Flags of `report`.
#[derive(Args)]
pub(crate) struct Report {
    /// Fewer states and shorter measurements: within two minutes.
    #[arg(long)]
    quick: bool,
    /// Only this section; may stand several times.
    #[arg(long = "section", value_name = "NAME", value_parser = PossibleValuesParser::new(names()))]
    sections: Vec<String>,
    /// The folder for the page and its data.
    #[arg(long, value_name = "DIR", default_value = "target/report")]
    out: PathBuf,
}

impl Report {
    pub(crate) fn run(self) -> ExitCode {
        let wish = Wish { effort: Effort { quick: self.quick }, sections: self.sections, out: self.out };
        match run(&wish) {
            Ok(_) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("sarrus report: {error}");
                ExitCode::from(2)
            }
        }
    }
}
