//! `sarrus completions`: the script with which a shell completes the command line.

use clap::{Args, Command};
use clap_complete::Shell;

use super::output::{Outcome, Results};

/// Flags of `completions`.
#[derive(Args)]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self, mut program: Command) -> Outcome {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut program, "sarrus", &mut script);
        Ok(Results { text: String::from_utf8_lossy(&script).into_owned(), code: 0 })
    }
}
