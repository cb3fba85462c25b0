//! `sarrus tidy`.

use clap::Args;
use sarrus_proto::Domain;
use serde_json::json;

use super::output::{Failure, FormatFlag, Outcome, Results};

/// Flags of `tidy`.
#[derive(Args)]
pub(crate) struct Tidy {
    #[command(flatten)]
    format: FormatFlag,
}

impl Tidy {
    /// Clears the domain; the results are the removed files.
    pub(crate) fn run(self) -> Outcome {
        let mut removed = Domain::of_user().map_err(Failure::start)?.tidy();
        removed.extend(sarrus_serve::record::clear());
        let cleared: Vec<String> = removed.iter().map(|path| path.display().to_string()).collect();
        let text = self.format.render(&json!({ "cleared": cleared }), |_| {
            cleared.iter().map(|path| format!("{path}\n")).collect()
        });
        Ok(Results { text, code: 0 })
    }
}
