//! A server process as its supervisor sees it.

use std::ffi::OsString;
use std::io::{self, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::time::Instant;

use rustix::process::{Pid, Signal, kill_process};

use super::super::standby::{Message, Order};

/// No message is longer.
const LONGEST: usize = 64 << 10;

/// A process that serves, or waits for the order to serve.
pub(super) struct Worker {
    process: Child,
    orders: ChildStdin,
    output: ChildStdout,
    unread: Vec<u8>,
    /// The fingerprint of its model, as soon as that is compiled.
    pub(super) loaded: Option<u64>,
    /// Whether it has the order to serve.
    pub(super) ordered: bool,
    /// Since when clients can attach.
    pub(super) ready: Option<Instant>,
    /// Why it cannot serve, and whether because another server runs under the name.
    pub(super) failure: Option<(String, bool)>,
}

impl Worker {
    /// Starts this very program, even if its file has been replaced meanwhile, as a process that
    /// loads and waits.
    pub(super) fn start(arguments: &[OsString]) -> io::Result<Worker> {
        let mut command = Command::new("/proc/self/exe");
        command.arg0("sarrus").args(arguments);
        command.arg("--standby").arg(std::process::id().to_string());
        // Ctrl-C goes to the supervisor alone, which stops its processes in order
        command.process_group(0).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut process = command.spawn()?;
        let (Some(orders), Some(output)) = (process.stdin.take(), process.stdout.take()) else {
            return Err(io::Error::other("a process without input and output"));
        };
        Ok(Worker {
            process,
            orders,
            output,
            unread: Vec::new(),
            loaded: None,
            ordered: false,
            ready: None,
            failure: None,
        })
    }

    /// The number of the process.
    pub(super) fn id(&self) -> u32 {
        self.process.id()
    }

    /// What to wait on for messages and for the end.
    pub(super) fn output(&self) -> BorrowedFd<'_> {
        self.output.as_fd()
    }

    /// Gives the order to serve. To a process that just died it says nothing: its end is seen in
    /// its output.
    pub(super) fn order(&mut self, order: Order) {
        self.ordered = true;
        let _ = self.orders.write_all(order.line().as_bytes());
    }

    /// Reads what there is, once; the messages in it, or `None` at the end of the process.
    pub(super) fn read(&mut self) -> Option<Vec<Message>> {
        let mut bytes = [0; 4096];
        match self.output.read(&mut bytes) {
            Ok(0) => return None,
            Ok(n) => self.unread.extend_from_slice(bytes.get(..n).unwrap_or_default()),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => return Some(Vec::new()),
            Err(_) => return None,
        }
        let mut messages = Vec::new();
        while let Some(end) = self.unread.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.unread.drain(..=end).collect();
            messages.extend(Message::read(String::from_utf8_lossy(&line).trim_end()));
        }
        // a line without end is none of ours
        self.unread.truncate(LONGEST);
        Some(messages)
    }

    /// Asks for a clean stop.
    pub(super) fn terminate(&self) {
        let _ = kill_process(Pid::from_child(&self.process), Signal::TERM);
    }

    /// Ends the process, if it has not ended, and gives how it did.
    pub(super) fn end(mut self) -> io::Result<ExitStatus> {
        // one that has closed its output is ending already, which this does not change
        let _ = self.process.kill();
        self.process.wait()
    }
}

/// How a process ended, for people.
pub(super) fn describe(status: &io::Result<ExitStatus>) -> String {
    match status {
        Err(error) => format!("ended, nobody knows how: {error}"),
        Ok(status) => match (status.code(), status.signal()) {
            (Some(code), _) => format!("ended with exit code {code}"),
            (None, Some(signal)) => format!("was killed by signal {signal}"),
            (None, None) => "ended".to_owned(),
        },
    }
}
