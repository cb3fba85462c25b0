//! Servers in a domain of their own, and what is seen of them from outside.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use sarrus_proto::Domain;

use crate::Settings;

/// The name that every attack's server has.
pub(crate) const NAME: &str = "victim";
/// Where the kernel keeps named shared memory.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

static SANDBOXES: AtomicU32 = AtomicU32::new(0);

/// A domain of one attack; what is left of it goes with this.
pub(crate) struct Sandbox {
    pub(crate) domain: Domain,
    sarrus: PathBuf,
    wait: Option<String>,
}

impl Sandbox {
    pub(crate) fn new(settings: &Settings) -> Result<Sandbox, String> {
        let number = SANDBOXES.fetch_add(1, Relaxed);
        let root = format!("sarrus-torture-{}-{number}", std::process::id());
        let domain = Domain::at(&std::env::temp_dir().join(root)).map_err(words)?;
        Ok(Sandbox { domain, sarrus: program(settings)?, wait: settings.wait.clone() })
    }

    /// The command that serves a robot.
    pub(crate) fn command(&self, robot: &str, flags: &[&str]) -> Command {
        let mut command = Command::new(&self.sarrus);
        command.args(["serve", "--robot", robot, "--name", NAME]).args(flags);
        if let Some(wait) = &self.wait {
            command.args(["--wait", wait]);
        }
        command.env("SARRUS_ROOT", self.domain.root());
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        command
    }

    /// A server that is ready.
    pub(crate) fn serve(&self, robot: &str, flags: &[&str]) -> Result<Server, String> {
        let mut child = self.command(robot, flags).spawn().map_err(words)?;
        let mut line = String::new();
        if let Some(out) = child.stdout.take() {
            BufReader::new(out).read_line(&mut line).map_err(words)?;
        }
        match line.starts_with("ready ") {
            true => Ok(Server { child }),
            false => Err(format!("the server did not start: {}", child.wait().map_err(words)?)),
        }
    }

    /// A process of this program with a role, which can reach this sandbox.
    pub(crate) fn role(
        &self,
        role: &str,
        flags: impl IntoIterator<Item = impl AsRef<OsStr>>,
    ) -> Result<Command, String> {
        let mut command = Command::new(std::env::current_exe().map_err(words)?);
        command.args(["role", role, "--root"]).arg(self.domain.root()).args(flags);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Ok(command)
    }

    /// What is there under the root and in shared memory.
    pub(crate) fn files(&self) -> BTreeSet<PathBuf> {
        fn walk(folder: &Path, found: &mut BTreeSet<PathBuf>) {
            for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
                walk(&entry.path(), found);
                found.insert(entry.path());
            }
        }
        let root = self.domain.root();
        let mut found = BTreeSet::new();
        if root.exists() {
            found.insert(root.to_owned());
        }
        walk(root, &mut found);
        found.extend(shared_files(&self.domain.prefix()));
        found
    }
}

impl Drop for Sandbox {
    fn drop(&mut self) {
        for path in self.files().into_iter().rev() {
            let _ = if path.is_dir() { fs::remove_dir(&path) } else { fs::remove_file(&path) };
        }
    }
}

/// A served robot in another process; killed when dropped.
pub(crate) struct Server {
    child: Child,
}

impl Server {
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        send_signal(self.child.id(), signal);
    }

    /// How it ended, if it has.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Open descriptors.
    pub(crate) fn descriptors(&self) -> usize {
        fs::read_dir(format!("/proc/{}/fd", self.id())).map_or(0, Iterator::count)
    }

    /// Memory in use `[kB]`.
    pub(crate) fn memory(&self) -> u64 {
        let text = fs::read_to_string(format!("/proc/{}/status", self.id())).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        line.and_then(|line| line.trim().strip_suffix(" kB")?.parse().ok()).unwrap_or(0)
    }

    /// Stops it in order; how long that took.
    pub(crate) fn stop(mut self) -> Result<Duration, String> {
        let start = Instant::now();
        self.signal(Signal::TERM);
        while start.elapsed() < Duration::from_secs(30) {
            match self.ended() {
                Some(status) if status.success() => return Ok(start.elapsed()),
                Some(status) => return Err(format!("the server ended with {status}")),
                None => std::thread::sleep(Duration::from_millis(2)),
            }
        }
        Err("the server does not stop within 30 s".to_owned())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A process of this program; killed when dropped.
pub(crate) struct Process(pub(crate) Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Sends a signal to a process.
pub(crate) fn send_signal(process: u32, signal: Signal) {
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        let _ = kill_process(pid, signal);
    }
}

/// The letter by which the kernel tells the state of a process.
pub(crate) fn state_of(process: u32) -> Option<char> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    text.rsplit(')').next()?.trim_start().chars().next()
}

/// The files in shared memory whose names begin with `prefix`.
pub(crate) fn shared_files(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix)));
    ours.map(|entry| entry.path()).collect()
}

/// An error as text.
pub(crate) fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// Waits until something holds, at most for `span`; whether it does.
pub(crate) fn wait_until(span: Duration, mut holds: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    loop {
        if holds() {
            return true;
        }
        if start.elapsed() > span {
            return false;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The program `sarrus`.
pub(crate) fn program(settings: &Settings) -> Result<PathBuf, String> {
    if let Some(path) = &settings.sarrus {
        return Ok(path.clone());
    }
    let path = std::env::current_exe().map_err(words)?.with_file_name("sarrus");
    match path.exists() {
        true => Ok(path),
        false => Err(format!("{} is not there; name it with --sarrus", path.display())),
    }
}
