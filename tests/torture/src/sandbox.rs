//! Servers in a domain of their own, and what is seen of them from outside.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use sarrus_proto::Domain;

use crate::Settings;
use crate::patience::{LIMIT, holds, poll};
use crate::process::{self, files_of, remove_files_of, send_signal};
use crate::report::Report;

/// The name that every attack's server has.
pub(crate) const NAME: &str = "victim";
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

    /// The files of the domain.
    pub(crate) fn files(&self) -> BTreeSet<PathBuf> {
        files_of(&self.domain)
    }

    /// Waits until no file of the domain is left.
    pub(crate) fn require_empty(&self, report: &mut Report) {
        report.require(holds(|| self.files().is_empty()), || {
            format!("left after a clean stop: {:?}", self.files())
        });
    }
}

impl Drop for Sandbox {
    fn drop(&mut self) {
        remove_files_of(&self.domain);
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
        process::descriptors(self.id())
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
        match poll(|| self.ended()) {
            Some(status) if status.success() => Ok(start.elapsed()),
            Some(status) => Err(format!("the server ended with {status}")),
            None => Err(format!("the server does not stop within {LIMIT:?}")),
        }
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

/// An error as text.
pub(crate) fn words(error: impl std::fmt::Display) -> String {
    error.to_string()
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
