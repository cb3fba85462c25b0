//! `sarrus tidy`.

use clap::Args;
use sarrus_proto::Domain;
use serde::Serialize;

use super::output::{Failure, FormatFlag, Outcome, Results};

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
    /// Clears the domain; the results are the removed files.
    pub(crate) fn run(self) -> Outcome {
        let removed = Domain::of_user().map_err(Failure::start)?.tidy();
        let cleared = removed.iter().map(|path| path.display().to_string()).collect();
        let text = self.format.render(&Cleared { cleared }, |files| {
            files.cleared.iter().map(|path| format!("{path}\n")).collect()
        });
        Ok(Results { text, code: 0 })
    }
}
