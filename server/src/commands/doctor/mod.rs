//! `sarrus doctor`: settings of this machine that slow or hinder a server, with their remedies.
//!
//! Each check is a function of the kernel's files below a folder, which tests replace. There is
//! none of the processor's instructions: without them the program ends before any command.

mod cleaner;
mod files;
mod folders;
mod kernel;
mod limits;
mod processors;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::output::{self, FormatFlag, Outcome};
use files::Files;

/// Flags of `doctor`.
#[derive(Args)]
pub(crate) struct Doctor {
    #[command(flatten)]
    format: FormatFlag,
    /// The folder below which `/proc`, `/sys`, `/dev` and `/etc` are read.
    #[arg(long, value_name = "FOLDER", default_value = "/", hide = true)]
    root: PathBuf,
}

/// A setting that is wrong for a real-time server.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    /// The name of the check.
    check: &'static str,
    found: String,
    expected: String,
    /// The remedy.
    help: String,
}

impl Finding {
    fn new(
        check: &'static str,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) -> Finding {
        Finding { check, found: found.into(), expected: expected.into(), help: help.into() }
    }
}

#[derive(Serialize)]
struct Results {
    checks: usize,
    findings: Vec<Finding>,
}

/// A check; one that cannot be made on this machine finds nothing.
type Check = fn(&Files) -> Vec<Finding>;

const CHECKS: [Check; 15] = [
    processors::count,
    processors::governor,
    processors::idle_states,
    processors::isolated,
    kernel::preemption,
    kernel::realtime_share,
    kernel::huge_pages,
    |files| limits::judge(files, &limits::REALTIME),
    |files| limits::judge(files, &limits::LOCKED_MEMORY),
    |files| limits::judge(files, &limits::OPEN_FILES),
    folders::shared_memory,
    folders::free_space,
    folders::runtime_folder,
    folders::file_system,
    cleaner::cleaner,
];

impl Doctor {
    /// The findings; 1 where there is one.
    pub(crate) fn run(self) -> Outcome {
        let files = Files::below(&self.root);
        let findings: Vec<Finding> = CHECKS.iter().flat_map(|check| check(&files)).collect();
        let results = Results { checks: CHECKS.len(), findings };
        let text = self.format.render(&results, |all| all.findings.iter().map(line).collect());
        Ok(output::Results { text, code: u8::from(!results.findings.is_empty()) })
    }
}

fn line(finding: &Finding) -> String {
    let Finding { check, found, expected, help } = finding;
    format!("{check}: {found}, expected {expected}; {help}\n")
}
