//! `sarrus tidy`.

use std::process::ExitCode;

use clap::Args;
use sarrus_proto::Domain;
use serde::Serialize;

use super::output::{Format, FormatFlag, finish, json_line};

/// Flags of `tidy`.
#[derive(Args)]
pub(crate) struct Tidy {
    #[command(flatten)]
    format: FormatFlag,
}

#[derive(Serialize)]
struct Cleared {
    cleared: Vec<String>,
}

impl Tidy {
    /// 0, with what was cleared.
    pub(crate) fn run(self) -> ExitCode {
        let domain = match Domain::of_user() {
            Ok(domain) => domain,
            Err(error) => {
                eprintln!("sarrus tidy: {error}");
                return ExitCode::from(2);
            }
        };
        let cleared: Vec<String> =
            domain.tidy().iter().map(|path| path.display().to_string()).collect();
        let results = match self.format.format {
            Format::Json => json_line(&Cleared { cleared }),
            Format::Text => cleared.iter().map(|path| format!("{path}\n")).collect(),
        };
        finish("tidy", &results, 0)
    }
}
