//! `sarrus man`: the pages of the manual.

use std::io;
use std::path::{Path, PathBuf};

use clap::{Args, Command};
use clap_mangen::Man as Page;

use super::output::{Failure, Outcome, write_new};

/// Flags of `man`.
#[derive(Args)]
pub(crate) struct Man {
    /// Folder of section 1, such as ~/.local/share/man/man1; made where it is missing. Pages that
    /// exist stay: remove those of another version first.
    folder: PathBuf,
}

impl Man {
    pub(crate) fn run(self, program: Command) -> Outcome {
        write_new(&self.folder, &pages(program, &self.folder).map_err(Failure::start)?)
    }
}

/// One page for the program and one for each command.
fn pages(program: Command, folder: &Path) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut program = program.disable_help_subcommand(true);
    program.build();
    let commands: Vec<Command> = program.get_subcommands().cloned().collect();
    let page = |command: Command| {
        let page = Page::new(command);
        let mut text = Vec::new();
        page.render(&mut text)?;
        Ok((folder.join(page.get_filename()), text))
    };
    [program].into_iter().chain(commands).map(page).collect()
}
