//! A compiler in the background: within a time, and ended together with all that it started.

use std::fs::File;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process_group};

use super::MakeError;
use crate::manifest::DEFINITION;
use crate::{BuildError, Compiler, FLAGS, Source};

/// Between two looks whether the compiler is done.
const LOOK: Duration = Duration::from_millis(10);
/// Words of a compiler that are kept.
const WORDS: usize = 2000;

/// An order to stop that another thread can give.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Ends what goes on as soon as it is seen.
    pub fn cancel(&self) {
        self.0.store(true, Relaxed);
    }

    /// Whether it was given.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Relaxed)
    }
}

/// Compiles a source in a folder to a shared object; its path.
pub(super) fn library(
    compiler: &Compiler,
    source: &Source,
    folder: &Path,
    most: Duration,
    cancel: &Cancel,
) -> Result<PathBuf, MakeError> {
    Compiler::write(source, folder)?;
    let [from, to, log] =
        [".c", ".so", ".log"].map(|ending| folder.join(format!("{}{ending}", source.name)));
    let mut command = Command::new(compiler.command());
    command.args(FLAGS).arg(format!("-D{DEFINITION}"));
    command.args(["-fPIC", "-shared", "-o"]).arg(&to).arg(&from).arg("-lm");
    let words = run(&mut command, compiler.command(), &log, most, cancel)?;
    match words {
        None => Ok(to),
        Some(words) => {
            Err(BuildError::Failed { program: compiler.command().to_owned(), words }.into())
        }
    }
}

/// Runs a program to its end; what it wrote where it failed.
fn run(
    command: &mut Command,
    name: &str,
    log: &Path,
    most: Duration,
    cancel: &Cancel,
) -> Result<Option<String>, MakeError> {
    let failed = |error: io::Error| BuildError::Io { path: name.into(), error };
    // into a file: a pipe that nobody reads would stop it
    let file = File::create(log).map_err(failed)?;
    let errors = file.try_clone().map_err(failed)?;
    command.stdin(Stdio::null()).stdout(file).stderr(errors);
    // a group of its own: compilers start others
    let mut child = command.process_group(0).spawn().map_err(failed)?;
    let start = Instant::now();
    loop {
        match child.try_wait().map_err(failed)? {
            Some(status) if status.success() => return Ok(None),
            Some(_) => {
                let words = std::fs::read(log).unwrap_or_default();
                let words = words.get(..words.len().min(WORDS)).unwrap_or_default();
                return Ok(Some(String::from_utf8_lossy(words).trim().to_owned()));
            }
            None if cancel.is_cancelled() || start.elapsed() > most => {
                if let Some(group) = Pid::from_raw(child.id() as i32) {
                    let _ = kill_process_group(group, Signal::KILL);
                }
                let _ = child.wait();
                return Err(match cancel.is_cancelled() {
                    true => MakeError::Cancelled,
                    false => MakeError::TooSlow { seconds: most.as_secs() },
                });
            }
            None => std::thread::sleep(LOOK),
        }
    }
}
