//! The shared object of a source, by the compiler in the background.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::compiler::ROWS;
use crate::manifest::DEFINITION;
use crate::run::{Cancel, run};
use crate::{BuildError, Compiler, FLAGS, Source};

/// Compiles a source in a folder to a shared object; its path. `name` stands for the source in
/// errors: the folder is gone when they are read.
pub(super) fn library(
    compiler: &Compiler,
    source: &Source,
    name: &str,
    folder: &Path,
    most: Duration,
    cancel: &Cancel,
) -> Result<PathBuf, BuildError> {
    let failed = |error: io::Error| BuildError::Io { path: name.into(), error };
    let [from, to] = [".c", ".so"].map(|ending| folder.join(format!("{}{ending}", source.name)));
    Compiler::write(source, folder).map_err(|error| match error {
        BuildError::Io { error, .. } => failed(error),
        other => other,
    })?;
    let mut command = compiler.start();
    command.args(FLAGS).arg(ROWS).arg(format!("-D{DEFINITION}"));
    command.args(["-fPIC", "-shared", "-o"]).arg(&to).arg(&from).arg("-lm");
    // a compiler that is ended leaves its files where all is removed
    command.env("TMPDIR", folder);
    let ended = run(&mut command, compiler.command(), most, cancel)?;
    if ended.is_success {
        return Ok(to);
    }
    let program = format!("{} for {name}", compiler.command());
    let words = ended.words.replace(&format!("{}/", folder.display()), "");
    Err(BuildError::Failed { program, words })
}

/// Writes a finished file to the disk with its hash behind it, for `ObjectFile` to compare.
pub(super) fn seal(path: &Path) -> io::Result<()> {
    let sum = super::file::sum(&std::fs::read(path)?);
    let mut file = File::options().append(true).open(path)?;
    file.write_all(sum.as_bytes())?;
    // a name that is on the disk before its bytes would name a part of them after a power cut
    file.sync_all()
}
