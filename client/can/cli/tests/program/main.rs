//! The program `sarrus-can` as scripts meet it: processes and pseudo-terminals.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that fails panics"
)]

mod allowance;
mod commission;
mod doctor;
mod simulated;

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::Value;

use allowance::{next, wait_for};

/// `O_NOCTTY`: the terminal of a bus is nobody's console.
const NO_CONSOLE: i32 = 0o400;

/// A folder of one test, removed with it.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Folder {
        static FOLDERS: AtomicU32 = AtomicU32::new(0);
        let path = std::env::temp_dir().join(format!(
            "sarrus-can-{}-{}",
            std::process::id(),
            FOLDERS.fetch_add(1, Relaxed)
        ));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// A configuration with one bus over slcan, `bus`, and these motors.
    fn configuration(&self, motors: &[&str]) -> PathBuf {
        let channel = self.path("bus").display().to_string();
        let head = format!(
            "rate_hz: 100\nbuses: [{{name: arm, interface: slcan, channel: {channel}, bitrate: \
                1000000}}]\nmotors:\n"
        );
        let text = motors.iter().fold(head, |text, motor| text + "- " + motor + "\n");
        let path = self.path("robot.yml");
        std::fs::write(&path, text).unwrap();
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// `sarrus-can` with arguments; killed when dropped.
struct Program {
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
    /// Events that came before one that was asked for.
    passed: Vec<Value>,
}

impl Program {
    fn start(arguments: &[&str]) -> Program {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sarrus-can"));
        let mut child =
            command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let stdin = child.stdin.take().unwrap();
        let stdout = child.stdout.take().unwrap();
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            BufReader::new(stdout)
                .lines()
                .map_while(Result::ok)
                .try_for_each(|line| sender.send(line))
        });
        Program { child, stdin, lines, passed: Vec::new() }
    }

    fn line(&self) -> String {
        next(&self.lines, "line")
    }

    /// The next event of a kind, which may have come before others.
    fn event(&mut self, kind: &str) -> Value {
        if let Some(place) = self.passed.iter().position(|event| event["event"] == kind) {
            return self.passed.remove(place);
        }
        let mut allowance = allowance::Allowance::new();
        while allowance.is_left() {
            match serde_json::from_str::<Value>(&self.line()) {
                Ok(event) if event["event"] == kind => return event,
                Ok(event) => self.passed.push(event),
                Err(_) => {}
            }
        }
        panic!("no event {kind}");
    }

    fn tell(&mut self, line: &str) {
        writeln!(self.stdin, "{line}").unwrap();
    }

    /// The report of the first motor, with its time.
    fn report(&mut self) -> Value {
        self.tell("report");
        let mut report = self.event("report");
        let mut motor = report["motors"][0].take();
        motor["t"] = report["t"].take();
        motor
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The host's end of a bus, which is a file and a thread that reads.
struct Host {
    file: File,
    bytes: Receiver<u8>,
    reader: JoinHandle<()>,
}

impl Host {
    fn open(path: &Path) -> Host {
        let file =
            OpenOptions::new().read(true).write(true).custom_flags(NO_CONSOLE).open(path).unwrap();
        let mut reader = file.try_clone().unwrap();
        let (sender, bytes) = channel();
        let reader = std::thread::spawn(move || {
            let mut byte = [0];
            while reader.read(&mut byte).is_ok_and(|n| n == 1) && sender.send(byte[0]).is_ok() {}
        });
        Host { file, bytes, reader }
    }

    /// Opens the channel, and waits until that is done.
    fn opened(path: &Path) -> Host {
        let mut host = Host::open(path);
        host.write("\rC\rS8\rO\rV\r");
        while host.line() != "V1013" {}
        host
    }

    fn write(&mut self, text: &str) {
        self.file.write_all(text.as_bytes()).unwrap();
    }

    /// The next line that is no bare acknowledgement; a bell is one.
    fn line(&self) -> String {
        let mut line = String::new();
        loop {
            let byte = next(&self.bytes, "byte");
            match byte {
                b'\r' if line.is_empty() || line == "z" || line == "Z" => line.clear(),
                b'\r' => return line,
                0x07 => return "bell".to_owned(),
                byte => line.push(byte as char),
            }
        }
    }

    /// The answer to a line.
    fn ask(&mut self, line: &str) -> String {
        self.write(&format!("{line}\r"));
        self.line()
    }

    /// Whether nothing but acknowledgements comes for a while.
    fn is_silent(&self, time: Duration) -> bool {
        let end = Instant::now() + time;
        while let Ok(byte) = self.bytes.recv_timeout(end.saturating_duration_since(Instant::now()))
        {
            if !matches!(byte, b'\r' | b'z' | b'Z') {
                return false;
            }
        }
        true
    }
}

impl Drop for Host {
    /// Ends the reader. Left blocked, it would take the first byte of the next host.
    fn drop(&mut self) {
        self.bytes = channel().1;
        let _ = self.file.write_all(b"N\r");
        if !std::thread::panicking() {
            wait_for("the end of the reader", || self.reader.is_finished().then_some(()));
        }
    }
}
