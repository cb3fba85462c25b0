//! The demo's server process, which ends with the demo.

use std::io::{self, BufRead, BufReader};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use sarrus_client::Domain;
use sarrus_serve::Wait;

/// Time for a clean stop.
const STOP: Duration = Duration::from_secs(3);

/// A running server; stopped when dropped.
pub(super) struct ServerProcess {
    child: Child,
    /// Kept open: the server writes its ready line to it.
    _stdout: BufReader<ChildStdout>,
}

impl ServerProcess {
    /// Starts this executable as a server and waits until it is ready.
    pub(super) fn start(robot: &str, name: &str, wait: Wait) -> io::Result<ServerProcess> {
        let wait = if wait == Wait::Busy { "busy" } else { "sleep" };
        let mut command = Command::new(std::env::current_exe()?);
        command
            .args(["serve", "--robot", robot, "--name", name, "--wait", wait])
            .stdin(Stdio::null())
            .stdout(Stdio::piped());
        // Ctrl-C reaches the demo alone, which stops the server
        command.process_group(0);
        let mut child = command.spawn()?;
        let Some(stdout) = child.stdout.take() else {
            return Err(io::Error::other("its output cannot be read"));
        };
        let mut server = ServerProcess { child, _stdout: BufReader::new(stdout) };
        let mut ready = String::new();
        server._stdout.read_line(&mut ready)?;
        if ready.starts_with("ready ") {
            Ok(server)
        } else {
            Err(io::Error::other("it ended before it was ready"))
        }
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
        let start = Instant::now();
        while start.elapsed() < STOP {
            if !matches!(self.child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        // a killed server leaves files
        let _ = self.child.kill();
        let _ = self.child.wait();
        if let Ok(domain) = Domain::of_user() {
            domain.tidy();
        }
    }
}
