//! Servers of attacks, each in a temporary domain.

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use rustix::process::Signal;
use sarrus_proto::Domain;

use crate::Settings;
use crate::patience::{LIMIT, holds};
use crate::process::{
    self, Process, TemporaryDomain, files_of, send_signal, serve_command, start_server,
};
use crate::report::Report;

/// The name of every attack's server.
pub(crate) const NAME: &str = "victim";

/// The domain of one attack.
pub(crate) struct Sandbox {
    home: TemporaryDomain,
    sarrus: PathBuf,
    wait: Option<String>,
}

impl Sandbox {
    pub(crate) fn new(settings: &Settings) -> Result<Sandbox, String> {
        let sarrus = program(settings)?;
        Ok(Sandbox { home: TemporaryDomain::new()?, sarrus, wait: settings.wait.clone() })
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.home.0
    }

    /// The command that serves a robot.
    pub(crate) fn command(&self, robot: &str, flags: &[&str]) -> Command {
        let mut command = serve_command(&self.sarrus, self.domain(), robot, NAME);
        command.args(flags);
        if let Some(wait) = &self.wait {
            command.args(["--wait", wait]);
        }
        command
    }

    /// A server that is ready.
    pub(crate) fn serve(&self, robot: &str, flags: &[&str]) -> Result<Server, String> {
        let (process, _) = start_server(&mut self.command(robot, flags))?;
        Ok(Server { process })
    }

    /// The command of a process of this program with a role in this sandbox.
    pub(crate) fn role(
        &self,
        role: &str,
        flags: impl IntoIterator<Item = impl AsRef<OsStr>>,
    ) -> Result<Command, String> {
        let mut command = Command::new(std::env::current_exe().map_err(words)?);
        command.args(["role", role, "--root"]).arg(self.domain().root()).args(flags);
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Ok(command)
    }

    /// The files of the domain.
    pub(crate) fn files(&self) -> BTreeSet<PathBuf> {
        files_of(self.domain())
    }

    /// Waits until no file of the domain is left.
    pub(crate) fn require_empty(&self, report: &mut Report) {
        report.require(holds(|| self.files().is_empty()), || {
            format!("left after a clean stop: {:?}", self.files())
        });
    }
}

/// A served robot in another process; killed when dropped.
pub(crate) struct Server {
    process: Process,
}

impl Server {
    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    pub(crate) fn signal(&self, signal: Signal) {
        send_signal(self.id(), signal);
    }

    /// Its exit status, if it has ended.
    pub(crate) fn ended(&mut self) -> Option<ExitStatus> {
        self.process.ended()
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

    /// Stops it in order; the time that it took.
    pub(crate) fn stop(self) -> Result<Duration, String> {
        let start = Instant::now();
        match self.process.stop(Signal::TERM) {
            Some(status) if status.success() => Ok(start.elapsed()),
            Some(status) => Err(format!("the server ended with {status}")),
            None => Err(format!("the server does not stop within {LIMIT:?}")),
        }
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
