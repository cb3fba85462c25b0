//! `sarrus man`: the pages of the manual.

use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Command};
use clap_mangen::Man as Page;

use super::output::write_new;

/// Flags of `man`.
#[derive(Args)]
pub(crate) struct Man {
    /// Folder of section 1, such as ~/.local/share/man/man1; it is made where it is missing. Pages
    /// that are there stay: remove those of another version first.
    folder: PathBuf,
}

impl Man {
    pub(crate) fn run(self, program: Command) -> ExitCode {
        match pages(program, &self.folder) {
            Ok(pages) => write_new("man", &self.folder, &pages),
            Err(error) => {
                eprintln!("sarrus man: {error}");
                ExitCode::from(2)
            }
        }
    }
}

/// One page for the program and one for each command.
fn pages(program: Command, folder: &Path) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let commands: Vec<Command> = program.get_subcommands().cloned().collect();
    let page = |command: Command| {
        let (page, mut text) = (Page::new(command), Vec::new());
        page.render(&mut text)?;
        Ok((folder.join(page.get_filename()), text))
    };
    [program].into_iter().chain(commands).map(page).collect()
}
