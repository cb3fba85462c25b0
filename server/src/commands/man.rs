//! `sarrus man`: the pages of the manual.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Command};

use super::output::finish;

/// Flags of `man`.
#[derive(Args)]
pub(crate) struct Man {
    /// Folder of section 1, such as ~/.local/share/man/man1; it is made where it is missing.
    folder: PathBuf,
}

impl Man {
    pub(crate) fn run(self, program: Command) -> ExitCode {
        let pages = fs::create_dir_all(&self.folder).and_then(|()| pages(program, &self.folder));
        match pages {
            Ok(pages) => {
                let lines = pages.iter().map(|page| format!("{}\n", page.display()));
                finish("man", &lines.collect::<String>(), 0)
            }
            Err(error) => {
                eprintln!("sarrus man: {} cannot be written: {error}", self.folder.display());
                ExitCode::from(2)
            }
        }
    }
}

/// One page for the program and one for each command.
fn pages(program: Command, folder: &Path) -> io::Result<Vec<PathBuf>> {
    let commands = program.get_subcommands().map(|command| format!("-{}", command.get_name()));
    let names = std::iter::once(String::new()).chain(commands);
    let pages = names.map(|name| folder.join(format!("sarrus{name}.1"))).collect();
    clap_mangen::generate_to(program, folder)?;
    Ok(pages)
}
