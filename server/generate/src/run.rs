//! A program in the background: within a time, and ended together with all that it started, also
//! where this process is killed.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rustix::fs::{MemfdFlags, memfd_create};
use rustix::process::{Pid, Signal, kill_process_group};

use crate::error::BuildError;

/// Between two looks whether the program is done.
const LOOK: Duration = Duration::from_millis(10);
/// Words of a program that are kept `[byte]`.
const WORDS: u64 = 2000;
/// Output size at which a program that writes without end is ended `[byte]`.
const FLOOD: u64 = 16 << 20;
/// How readily the system ends the program, before this process, where memory is short.
const OUT_OF_MEMORY: &str = "500";

/// An order to stop that another thread can give.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Ends a running program as soon as it is seen.
    pub fn cancel(&self) {
        self.0.store(true, Relaxed);
    }

    /// Whether it was given.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Relaxed)
    }
}

/// How a program ended.
pub(crate) struct Ended {
    /// Whether it reports success.
    pub is_success: bool,
    pub code: Option<i32>,
    /// The beginning of its output.
    pub words: String,
}

/// Runs a program to its end. Its output goes to memory: an unread pipe would stop it, and a disk
/// may be full.
pub(crate) fn run(
    command: &mut Command,
    name: &str,
    most: Duration,
    cancel: &Cancel,
) -> Result<Ended, BuildError> {
    let failed = |error: io::Error| BuildError::Io { path: name.into(), error };
    let log = memfd_create("sarrus_compiler", MemfdFlags::CLOEXEC);
    let mut log = File::from(log.map_err(|error| failed(error.into()))?);
    let [output, errors] = [log.try_clone().map_err(failed)?, log.try_clone().map_err(failed)?];
    command.stdin(Stdio::null()).stdout(output).stderr(errors);
    let group = Group::new().map_err(failed)?;
    let mut child = command.process_group(group.id()).spawn().map_err(failed)?;
    let _ = std::fs::write(format!("/proc/{}/oom_score_adj", child.id()), OUT_OF_MEMORY);
    let start = Instant::now();
    loop {
        let floods = log.metadata().map_err(failed)?.len() > FLOOD;
        let mut status = child.try_wait().map_err(failed)?;
        if floods && status.is_none() {
            group.end();
            status = Some(child.wait().map_err(failed)?);
        }
        match status {
            Some(status) => {
                let mut words = Vec::new();
                log.seek(SeekFrom::Start(0)).map_err(failed)?;
                log.take(WORDS).read_to_end(&mut words).map_err(failed)?;
                let mut words = String::from_utf8_lossy(&words).trim().to_owned();
                if words.is_empty() && !status.success() {
                    words = status.to_string();
                }
                return Ok(Ended { is_success: status.success(), code: status.code(), words });
            }
            None if cancel.is_cancelled() || start.elapsed() > most => {
                group.end();
                let _ = child.wait();
                return Err(match cancel.is_cancelled() {
                    true => BuildError::Cancelled,
                    false => {
                        BuildError::TooSlow { program: name.to_owned(), seconds: most.as_secs() }
                    }
                });
            }
            None => std::thread::sleep(LOOK),
        }
    }
}

/// Waits until the other end of its input closes, as it does at any end of the process that holds
/// it, and ends its group.
const GUARD: &str = "read end; kill -KILL 0";

/// A process group: a program and all that it starts, ended when dropped or with this process.
struct Group(Child);

impl Group {
    fn new() -> io::Result<Group> {
        let mut guard = Command::new("/bin/sh");
        guard.args(["-c", GUARD]).stdin(Stdio::piped()).stdout(Stdio::null());
        Ok(Group(guard.stderr(Stdio::null()).process_group(0).spawn()?))
    }

    fn id(&self) -> i32 {
        self.0.id() as i32
    }

    fn end(&self) {
        if let Some(group) = Pid::from_raw(self.id()) {
            let _ = kill_process_group(group, Signal::KILL);
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.end();
        let _ = self.0.wait();
    }
}
