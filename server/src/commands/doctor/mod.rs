//! `sarrus doctor`: settings of this machine that slow or hinder a server, with their remedies.
//!
//! Each check is a function of the kernel's files below a folder, which tests replace. A check
//! finds a setting that costs time without any other report: there is none of rights and limits,
//! which `serve` raises or names when it starts, and none of the processor's instructions.

mod folders;
mod kernel;
mod processors;
#[cfg(test)]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::output::{self, FormatFlag, Outcome};

/// Flags of `doctor`.
#[derive(Args)]
pub(crate) struct Doctor {
    #[command(flatten)]
    format: FormatFlag,
    /// The folder below which `/proc`, `/sys` and `/dev` are read.
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

/// A check below a folder that stands for the root; one that cannot be made on this machine finds
/// nothing.
type Check = fn(&Path) -> Vec<Finding>;

const CHECKS: [Check; 8] = [
    processors::governor,
    processors::idle_states,
    processors::isolated,
    kernel::preemption,
    kernel::realtime_share,
    kernel::huge_pages,
    folders::free_space,
    folders::file_system,
];

impl Doctor {
    /// The findings; 1 where there is one.
    pub(crate) fn run(self) -> Outcome {
        let findings: Vec<Finding> = CHECKS.iter().flat_map(|check| check(&self.root)).collect();
        let results = Results { checks: CHECKS.len(), findings };
        let text = self.format.render(&results, |all| all.findings.iter().map(line).collect());
        Ok(output::Results { text, code: u8::from(!results.findings.is_empty()) })
    }
}

fn line(finding: &Finding) -> String {
    let Finding { check, found, expected, help } = finding;
    format!("{check}: {found}, expected {expected}; {help}\n")
}

/// The trimmed text of a file below the root; none of a file that cannot be read.
fn text(root: &Path, path: &str) -> Option<String> {
    let bytes = fs::read(root.join(path)).ok()?;
    Some(String::from_utf8_lossy(&bytes).trim().to_owned())
}
