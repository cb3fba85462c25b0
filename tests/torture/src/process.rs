//! Child processes and temporary domains; files, descriptors and state of other processes.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use sarrus_proto::Domain;

use crate::patience::poll;

/// The kernel's folder of named shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

static DOMAINS: AtomicU32 = AtomicU32::new(0);

/// A domain in the folder of temporary files; its files are removed when this is dropped.
pub struct TemporaryDomain(pub Domain);

impl TemporaryDomain {
    /// A new domain, whose folder does not exist yet.
    pub fn new() -> Result<TemporaryDomain, String> {
        let number = DOMAINS.fetch_add(1, Relaxed);
        let root = format!("sarrus-test-{}-{number}", std::process::id());
        let domain = Domain::at(&std::env::temp_dir().join(root));
        domain.map(TemporaryDomain).map_err(|error| error.to_string())
    }
}

impl Drop for TemporaryDomain {
    fn drop(&mut self) {
        for path in files_of(&self.0).into_iter().rev() {
            let _ = if path.is_dir() { fs::remove_dir(&path) } else { fs::remove_file(&path) };
        }
    }
}

/// A child process; killed when dropped.
pub struct Process(pub Child);

impl Process {
    /// Its number.
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Its exit status, if it has ended.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.0.try_wait().ok().flatten()
    }

    /// Sends a signal and waits for the end; `None` beyond the time limit.
    pub fn stop(mut self, signal: Signal) -> Option<ExitStatus> {
        send_signal(self.id(), signal);
        poll(|| self.ended())
    }

    /// Kills it and waits for its end.
    pub fn kill(self) {
        drop(self);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The command by which the program `sarrus` at a path serves a bundled robot in a domain.
pub fn serve_command(sarrus: &Path, domain: &Domain, robot: &str, name: &str) -> Command {
    let mut command = Command::new(sarrus);
    command.args(["serve", "--robot", robot, "--name", name]);
    command.env("SARRUS_ROOT", domain.root()).stdin(Stdio::null()).stdout(Stdio::piped());
    command
}

/// Starts a server; returns with its line `ready NAME FINGERPRINT`.
pub fn start_server(command: &mut Command) -> Result<(Process, String), String> {
    let mut child = command.spawn().map_err(|error| error.to_string())?;
    let mut ready = String::new();
    if let Some(stdout) = child.stdout.take() {
        BufReader::new(stdout).read_line(&mut ready).map_err(|error| error.to_string())?;
    }
    match ready.starts_with("ready ") {
        true => Ok((Process(child), ready)),
        false => Err(format!("the server did not start: {:?}", child.wait_with_output())),
    }
}

/// Sends a signal to a process; one that it stops has stopped on return.
pub fn send_signal(process: u32, signal: Signal) {
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        let _ = kill_process(pid, signal);
    }
    while signal == Signal::STOP && !has_stopped(process) {
        thread::sleep(Duration::from_millis(1));
    }
}

/// True where every thread of the process is stopped, or none is left.
fn has_stopped(process: u32) -> bool {
    let threads = fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
    let mut states = threads.filter_map(|thread| state_in(&thread.path()));
    states.all(|state| matches!(state, 'T' | 'Z' | 'X'))
}

/// The letter for the state of a process.
pub fn state_of(process: u32) -> Option<char> {
    state_in(Path::new(&format!("/proc/{process}")))
}

/// The letter in the file `stat` of this folder.
fn state_in(folder: &Path) -> Option<char> {
    let text = fs::read_to_string(folder.join("stat")).ok()?;
    text.rsplit(')').next()?.trim_start().chars().next()
}

/// The number of open descriptors of a process.
pub fn descriptors(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).map_or(0, Iterator::count)
}

/// The number of batch areas that a process has mapped.
pub fn batch_areas(process: u32) -> usize {
    let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
    maps.lines().filter(|line| line.contains("sarrus-batch")).count()
}

/// The files in shared memory whose names begin with `prefix`.
pub fn shared_files(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix)));
    ours.map(|entry| entry.path()).collect()
}

/// The files of a domain: its root, everything below it, and its shared memory.
pub fn files_of(domain: &Domain) -> BTreeSet<PathBuf> {
    fn walk(folder: &Path, found: &mut BTreeSet<PathBuf>) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            walk(&entry.path(), found);
            found.insert(entry.path());
        }
    }
    let root = domain.root();
    let mut found = BTreeSet::new();
    if root.exists() {
        found.insert(root.to_owned());
    }
    walk(root, &mut found);
    found.extend(shared_files(&domain.prefix()));
    found
}
