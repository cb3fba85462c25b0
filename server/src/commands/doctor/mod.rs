//! `sarrus doctor`: what on this machine costs time or stands in the way, and what to do about it.
//!
//! Each check is a function of texts that the kernel writes, below a folder that tests replace.

mod file_system;
mod files;
mod folders;
mod kernel;
mod permissions;
mod processors;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use serde::Serialize;

use super::output::{Format, FormatFlag, finish, json_line};
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

/// Something that is not as a real-time server wants it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Finding {
    /// What was looked at.
    check: &'static str,
    found: String,
    expected: String,
    /// What to do.
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

const CHECKS: [Check; 16] = [
    processors::count,
    processors::instructions,
    processors::governor,
    processors::idle_states,
    processors::isolated,
    kernel::preemption,
    kernel::realtime_share,
    kernel::huge_pages,
    permissions::realtime,
    permissions::locked_memory,
    permissions::open_files,
    folders::shared_memory,
    folders::free_space,
    folders::runtime_folder,
    folders::cleaner,
    file_system::file_system,
];

impl Doctor {
    /// 0 when all is well, 1 for a finding.
    pub(crate) fn run(self) -> ExitCode {
        let files = Files::below(&self.root);
        let findings: Vec<Finding> = CHECKS.iter().flat_map(|check| check(&files)).collect();
        let code = u8::from(!findings.is_empty());
        let results = match self.format.format {
            Format::Json => json_line(&Results { checks: CHECKS.len(), findings }),
            Format::Text => findings.iter().map(line).collect(),
        };
        finish("doctor", &results, code)
    }
}

fn line(finding: &Finding) -> String {
    let Finding { check, found, expected, help } = finding;
    format!("{check}: {found}, expected {expected}; {help}\n")
}
