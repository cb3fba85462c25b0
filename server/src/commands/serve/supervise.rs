//! `sarrus serve --supervise`: a server process that is started again when it dies.
//!
//! The supervisor holds no resource of a server but a copy of the robot's files, in memory, for
//! servers that start after the files have changed. A process that serves writes one line to its
//! output, `ready NAME FINGERPRINT`, or the reason why it cannot serve; the kernel closes that
//! output when the process ends. If the supervisor is killed, the kernel kills its process too.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, Write};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use rustix::fs::{MemfdFlags, memfd_create};
use rustix::process::{Pid, Signal, getppid, kill_process, set_parent_process_death_signal};
use sarrus_proto::{Domain, ServerName, supervision};
use sarrus_serve::record::RecordedRobot;
use sarrus_serve::system::processes::continue_stopped;
use sarrus_serve::system::stderr::{has_room, line};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::backoff::Backoff;
use crate::commands::output;

/// Time for a clean stop of a server.
const STOP: Duration = Duration::from_secs(5);
/// Time between two looks whether a signal has stopped the server.
const LOOK: Duration = Duration::from_millis(500);

/// First words of the line with which a process reports why it cannot serve: another server runs
/// under the name, or any other reason.
pub(super) const TAKEN: &str = "taken";
pub(super) const FAILED: &str = "failed";

/// Makes the kernel kill this process when its supervisor dies; false if the supervisor is already
/// dead.
pub(super) fn die_with(supervisor: i32) -> bool {
    let set = set_parent_process_death_signal(Some(Signal::KILL));
    // the process was started through /proc/self/exe: its name shows the program
    let _ = rustix::thread::set_name(c"sarrus");
    set.is_ok() && getppid().map(Pid::as_raw_nonzero).is_some_and(|pid| pid.get() == supervisor)
}

/// Supervises until a signal arrives (exit code 0) or the supervisor gives up (1 for a bad model,
/// else 2).
pub(super) fn run(
    name: &str,
    short_life: Duration,
    robot: Option<RecordedRobot>,
) -> Result<u8, output::Failure> {
    let (sender, events) = channel();
    send_signals(sender.clone())
        .map_err(|error| output::Failure::start(format!("signals cannot be caught: {error}")))?;
    let arguments = std::env::args_os().skip(1).filter(|argument| argument != "--supervise");
    let mut supervisor = Supervisor {
        arguments: arguments.collect(),
        events,
        sender,
        since: Instant::now(),
        backoff: Backoff::new(short_life),
        robot: robot.and_then(|robot| copy_of(&robot).ok()),
        fingerprint: None,
        death: None,
    };
    let end = loop {
        if let Err(end) = supervisor.supervise_one() {
            break end;
        }
    };
    supervisor.report_death();
    match end {
        End::Stopped(code) => Ok(code),
        End::GivenUp { reason, code, is_public } => {
            // clients first: an operator who reads the line may connect at once
            let left = if is_public { leave_reason(name, &reason) } else { Ok(()) };
            line(format_args!("sarrus serve: given up: {reason}"));
            if let Err(error) = left {
                line(format_args!("sarrus serve: clients cannot read the reason: {error}"));
            }
            Ok(code)
        }
    }
}

/// The robot's files in a file in memory.
fn copy_of(robot: &RecordedRobot) -> io::Result<File> {
    let mut copy = File::from(memfd_create("sarrus-robot", MemfdFlags::CLOEXEC)?);
    copy.write_all(&serde_json::to_vec(robot)?)?;
    Ok(copy)
}

/// Sends [`Event::Signal`] at SIGTERM and SIGINT.
fn send_signals(events: Sender<Event>) -> io::Result<()> {
    let (mut signals, written) = UnixStream::pair()?;
    for signal in [SIGTERM, SIGINT] {
        signal_hook::low_level::pipe::register(signal, written.try_clone()?)?;
    }
    thread::Builder::new().spawn(move || {
        while signals.read_exact(&mut [0]).is_ok() && events.send(Event::Signal).is_ok() {}
    })?;
    Ok(())
}

/// Sends the lines of a process, then [`Event::Closed`].
fn send_lines(output: ChildStdout, events: Sender<Event>) -> io::Result<()> {
    let mut lines = BufReader::new(output).split(b'\n').map_while(Result::ok);
    thread::Builder::new().spawn(move || {
        let text = |line: Vec<u8>| String::from_utf8_lossy(&line).trim_end().to_owned();
        let _ = lines.try_for_each(|line| events.send(Event::Line(text(line))));
        let _ = events.send(Event::Closed);
    })?;
    Ok(())
}

/// The end of supervision.
enum End {
    /// By a signal.
    Stopped(u8),
    /// The server cannot be kept alive.
    GivenUp {
        reason: String,
        code: u8,
        /// Whether clients read the reason; not if another server has the name.
        is_public: bool,
    },
}

/// One line of a server process, or another event.
enum Event {
    Signal,
    Line(String),
    /// The process closed its output.
    Closed,
}

struct Supervisor {
    arguments: Vec<OsString>,
    events: Receiver<Event>,
    /// Clones go to the threads that send events.
    sender: Sender<Event>,
    since: Instant,
    backoff: Backoff,
    /// The robot's files as they were before the first server, for the input of later ones.
    robot: Option<File>,
    /// The fingerprint of the first server.
    fingerprint: Option<String>,
    /// The last death and its time; reported when the next server is ready.
    death: Option<(String, Instant)>,
}

impl Supervisor {
    /// Runs one server process to its end and waits until the next may start.
    fn supervise_one(&mut self) -> Result<(), End> {
        let mut process = match self.start() {
            Ok(process) => process,
            Err(error) => return self.delay(None, &format!("cannot be started: {error}")),
        };
        let mut ready: Option<Instant> = None;
        let mut failure = None;
        loop {
            match self.events.recv_timeout(LOOK) {
                Err(RecvTimeoutError::Timeout) => {
                    if continue_stopped(process.id() as i32) {
                        line(format_args!(
                            "sarrus serve: warning: a signal had stopped the server (process {}): \
                             continued",
                            process.id()
                        ));
                    }
                }
                Ok(Event::Signal) => return Err(self.stop(process, ready.is_some())),
                Ok(Event::Line(line)) if line.starts_with("ready ") => {
                    ready = Some(Instant::now());
                    self.announce(&line, process.id());
                }
                Ok(Event::Line(line)) => {
                    let read = line.split_once(' ');
                    let read = read.filter(|(word, _)| [TAKEN, FAILED].contains(word));
                    failure = read.map(|(word, why)| (word == TAKEN, why.to_owned())).or(failure);
                }
                Ok(Event::Closed) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let died = Instant::now();
        let status = end(&mut process);
        let how = describe(&status);
        let id = process.id();
        if let Some(ready) = ready {
            let life = died - ready;
            let seconds = life.as_secs_f64();
            let words = format!(
                "sarrus serve: the server (process {id}) {how} after {seconds:.1} s without an \
                 order"
            );
            self.death = Some((words, died));
            return self.delay(Some(life), &how);
        }
        // the flags or files of a first start would be refused again
        let code = status.ok().and_then(|status| status.code());
        if let Some(code @ (1 | 2)) = code
            && self.fingerprint.is_none()
        {
            let (is_taken, reason) = failure.unwrap_or((false, how));
            return Err(End::GivenUp { reason, code: code as u8, is_public: !is_taken });
        }
        let how = match failure {
            Some((_, reason)) => format!("{how}: {reason}"),
            None => how,
        };
        self.report_death();
        line(format_args!("sarrus serve: the server (process {id}) {how}, before it was ready"));
        self.delay(None, &how)
    }

    /// Starts this program as a server process, even if its file has been replaced.
    fn start(&self) -> io::Result<Child> {
        let mut command = Command::new("/proc/self/exe");
        command.arg0("sarrus").args(&self.arguments);
        command.arg("--supervisor").arg(std::process::id().to_string());
        // Ctrl-C reaches the supervisor alone, which stops the process in order
        command.process_group(0).stdin(Stdio::null()).stdout(Stdio::piped());
        if let Some(fingerprint) = &self.fingerprint {
            command.args(["--again", fingerprint]);
            if let Some(mut robot) = self.robot.as_ref() {
                robot.rewind()?;
                command.stdin(robot.try_clone()?);
            }
        }
        let mut process = command.spawn()?;
        let output = process.stdout.take();
        let output = output.ok_or_else(|| io::Error::other("a process without output"));
        let sends = output.and_then(|output| send_lines(output, self.sender.clone()));
        sends.inspect_err(|_| _ = end(&mut process)).map(|()| process)
    }

    /// Handles readiness: passes on the first such line, reports the preceding death before later
    /// ones.
    fn announce(&mut self, ready: &str, id: u32) {
        if let Some((words, since)) = self.death.take() {
            let gap = since.elapsed();
            line(format_args!("{words}; process {id} serves, {gap:.1?} later"));
        }
        if self.fingerprint.is_none() {
            self.fingerprint = ready.rsplit(' ').next().map(str::to_owned);
            print_line(ready);
        }
    }

    /// Reports a death without a later server.
    fn report_death(&mut self) {
        if let Some((words, _)) = self.death.take() {
            line(format_args!("{words}"));
        }
    }

    /// Counts a death and waits until the next start is due.
    fn delay(&mut self, life: Option<Duration>, how: &str) -> Result<(), End> {
        let Some(delay) = self.backoff.died(self.since.elapsed(), life) else {
            let reason = format!(
                "five times within a minute the server died soon after its start; the last {how}"
            );
            return Err(End::GivenUp { reason, code: 2, is_public: true });
        };
        match self.events.recv_timeout(delay) {
            Ok(Event::Signal) => Err(End::Stopped(0)),
            _ => Ok(()),
        }
    }

    /// Stops a server process after a signal: as soon as it is ready, since before it may not
    /// handle signals yet, nor have removed the files of a server that died.
    fn stop(&mut self, mut process: Child, is_ready: bool) -> End {
        let order = |process: &Child| _ = kill_process(Pid::from_child(process), Signal::TERM);
        if is_ready {
            order(&process);
        }
        let due = Instant::now() + STOP;
        loop {
            // a stop may take effect later than the order
            continue_stopped(process.id() as i32);
            let left = due.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(left.min(LOOK)) {
                Ok(Event::Closed) => {
                    let is_clean = end(&mut process).is_ok_and(|status| status.success());
                    return End::Stopped(if is_clean { 0 } else { 2 });
                }
                Ok(Event::Line(line)) if line.starts_with("ready ") => order(&process),
                // further signals change nothing
                Ok(_) => {}
                Err(RecvTimeoutError::Timeout) if left > LOOK => {}
                Err(_) => {
                    let _ = end(&mut process);
                    let id = process.id();
                    line(format_args!(
                        "sarrus serve: the server (process {id}) did not stop: killed"
                    ));
                    return End::Stopped(2);
                }
            }
        }
    }
}

/// Ends a process, if it has not ended.
fn end(process: &mut Child) -> io::Result<ExitStatus> {
    // a process that has closed its output is already ending; this does not change that
    let _ = process.kill();
    process.wait()
}

fn describe(status: &io::Result<ExitStatus>) -> String {
    match status {
        Err(error) => format!("ended, its status is unknown: {error}"),
        Ok(status) => match (status.code(), status.signal()) {
            (Some(code), _) => format!("ended with exit code {code}"),
            (None, Some(signal)) => format!("was killed by signal {signal}"),
            (None, None) => "ended".to_owned(),
        },
    }
}

/// Stores the reason for clients.
fn leave_reason(name: &str, reason: &str) -> io::Result<()> {
    let name = ServerName::new(name).map_err(io::Error::other)?;
    let domain = Domain::of_user().map_err(io::Error::other)?;
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    supervision::give_up(domain.root(), &name, reason, now)
}

/// Prints a line, where stdout has a reader and room.
pub(super) fn print_line(line: &str) {
    let mut out = std::io::stdout().lock();
    if has_room(&out) {
        let _ = writeln!(out, "{line}").and_then(|()| out.flush());
    }
}
