//! `sarrus serve --supervise`: one process serves, a second one has compiled the model and waits.
//!
//! The supervisor holds nothing of a server: it starts processes, reads their lines and orders one
//! of them to serve. It sees a death by the end of that process' output, which the kernel closes,
//! and gives the order to the waiting process before it does anything else.

mod backoff;
mod end;
mod worker;

use std::ffi::OsString;
use std::io::{self, Read};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGINT, SIGTERM};

use super::print_line;
use super::standby::{Message, Order};
use backoff::{Backoff, Next, delay};
use end::{End, changed, given_up, leave_reason, too_often};
use worker::{Worker, describe};

/// How long a server has for a clean stop.
const STOP: Duration = Duration::from_secs(5);

/// Supervises until a signal, 0, or until the server is given up: 1 for a bad model, else 2.
pub(super) fn run(name: &str, short_life: Duration) -> ExitCode {
    let signals = match signals() {
        Ok(signals) => signals,
        Err(error) => {
            eprintln!("sarrus serve: signals cannot be caught: {error}");
            return ExitCode::from(2);
        }
    };
    let arguments = std::env::args_os().skip(1).filter(|argument| argument != "--supervise");
    let mut supervisor = Supervisor {
        arguments: arguments.collect(),
        signals,
        since: Instant::now(),
        backoff: Backoff::new(short_life),
        serving: None,
        serving_due: Duration::ZERO,
        standby: None,
        standby_due: Duration::ZERO,
        standby_failures: 0,
        announced: None,
        unsaid: None,
    };
    loop {
        if let Err(end) = supervisor.step() {
            return supervisor.finish(name, end);
        }
    }
}

/// The other end of what SIGTERM and SIGINT write to.
fn signals() -> io::Result<UnixStream> {
    let (signals, written) = UnixStream::pair()?;
    for signal in [SIGTERM, SIGINT] {
        signal_hook::low_level::pipe::register(signal, written.try_clone()?)?;
    }
    Ok(signals)
}

struct Supervisor {
    arguments: Vec<OsString>,
    signals: UnixStream,
    since: Instant,
    backoff: Backoff,
    /// The process that serves or is about to.
    serving: Option<Worker>,
    /// Not started before this time.
    serving_due: Duration,
    /// The process that waits.
    standby: Option<Worker>,
    /// Not started before this time.
    standby_due: Duration,
    /// Processes in a row that ended before they had the order.
    standby_failures: u32,
    /// The fingerprint of the line that was passed on.
    announced: Option<u64>,
    /// How the last server ended, and when: said when the next one serves.
    unsaid: Option<(String, Instant)>,
}

impl Supervisor {
    /// Starts what is due, waits, and follows what happened.
    fn step(&mut self) -> Result<(), End> {
        self.fill()?;
        let [signal, serving, standby] = match self.wait() {
            Ok(readable) => readable,
            Err(error) => return Err(given_up(format!("poll: {error}"), 2)),
        };
        if signal && matches!(self.signals.read(&mut [0; 64]), Ok(1..)) {
            return Err(End::Ordered);
        }
        if serving {
            self.hear_serving()?;
        }
        if standby {
            self.hear_standby();
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.since.elapsed()
    }

    /// One process to serve and, once it does, one to wait.
    fn fill(&mut self) -> Result<(), End> {
        let now = self.now();
        if self.serving.is_none() && now >= self.serving_due {
            self.serving = match self.standby.take() {
                Some(standby) => Some(standby),
                None => match Worker::start(&self.arguments) {
                    Ok(worker) => Some(worker),
                    Err(error) => {
                        self.died(None, &format!("cannot be started: {error}"))?;
                        None
                    }
                },
            };
        }
        self.order();
        let is_ready = self.serving.as_ref().is_some_and(|serving| serving.ready.is_some());
        if is_ready && self.standby.is_none() && now >= self.standby_due {
            match Worker::start(&self.arguments) {
                Ok(worker) => self.standby = Some(worker),
                Err(error) => self.without_standby(&format!("cannot be started: {error}")),
            }
        }
        Ok(())
    }

    /// Orders the process that is to serve, once its model is known to be the announced one.
    fn order(&mut self) {
        let order = if self.announced.is_none() { Order::Serve } else { Order::ServeAgain };
        if let Some(serving) = &mut self.serving
            && !serving.ordered
            && serving.loaded.is_some_and(|loaded| self.announced.is_none_or(|one| one == loaded))
        {
            serving.order(order);
        }
    }

    /// Waits until a signal, either process or a start is due: which of the three can be read.
    fn wait(&self) -> io::Result<[bool; 3]> {
        let due = match (&self.serving, &self.standby) {
            (None, _) => Some(self.serving_due),
            (Some(serving), None) if serving.ready.is_some() => Some(self.standby_due),
            _ => None,
        };
        let timeout = due.map(|due| due.saturating_sub(self.now()));
        let timeout = timeout.and_then(|timeout| Timespec::try_from(timeout).ok());
        let outputs = [&self.serving, &self.standby].map(|worker| worker.as_ref());
        readable(&self.signals, outputs, timeout.as_ref())
    }

    fn hear_serving(&mut self) -> Result<(), End> {
        let Some(serving) = &mut self.serving else { return Ok(()) };
        match serving.read() {
            None => self.bury(),
            Some(messages) => messages.into_iter().try_for_each(|message| self.follow(message)),
        }
    }

    /// Follows a message of the process that serves or is about to.
    fn follow(&mut self, message: Message) -> Result<(), End> {
        let Some(serving) = &mut self.serving else { return Ok(()) };
        match message {
            Message::Loaded(fingerprint) => {
                serving.loaded = Some(fingerprint);
                if let Some(words) = changed(self.announced, fingerprint) {
                    return Err(given_up(words, 2));
                }
                self.order();
            }
            Message::Ready(line) => {
                serving.ready = Some(Instant::now());
                if let Some((words, since)) = self.unsaid.take() {
                    let (id, gap) = (serving.id(), since.elapsed());
                    let line = format!("{words}; process {id} serves, {gap:.1?} later");
                    eprintln!("{line}");
                }
                if self.announced.is_none() {
                    self.announced = serving.loaded;
                    print_line(&line);
                }
            }
            Message::Taken(reason) => serving.failure = Some((reason, true)),
            Message::Failed(reason) => serving.failure = Some((reason, false)),
        }
        Ok(())
    }

    /// The process that served has ended without an order: the next one first, then the words.
    fn bury(&mut self) -> Result<(), End> {
        let Some(old) = self.serving.take() else { return Ok(()) };
        let (id, life) = (old.id(), old.ready.map(|ready| ready.elapsed()));
        let Some(life) = life else { return self.never_ready(old) };
        let died = Instant::now();

        let next = self.backoff.died(self.now(), Some(life));
        if let Next::After(delay) = next {
            self.serving_due = self.now() + delay;
            self.fill()?;
        }
        let how = describe(&old.end());
        let life = life.as_secs_f64();
        let words = format!(
            "sarrus serve: the server (process {id}) {how} after {life:.1} s without an order"
        );
        self.unsaid = Some((words, died));
        match next {
            Next::After(_) => Ok(()),
            Next::Never => Err(too_often(&how)),
        }
    }

    /// Says how the last server ended, where no other has followed it yet.
    fn say(&mut self) {
        if let Some((words, _)) = self.unsaid.take() {
            eprintln!("{words}");
        }
    }

    /// A process that ended before clients could attach.
    fn never_ready(&mut self, old: Worker) -> Result<(), End> {
        let (id, failure) = (old.id(), old.failure.clone());
        let status = old.end();
        let code = status.as_ref().ok().and_then(|status| status.code());
        // what was refused once is refused again; a bad model even where one was served before
        if let Some(code @ (1 | 2)) = code
            && (self.announced.is_none() || code == 1)
        {
            let (reason, taken) = failure.unwrap_or_else(|| (describe(&status), false));
            return Err(End::GivenUp { reason, code: code as u8, is_public: !taken });
        }
        self.say();
        let how = match failure {
            Some((reason, _)) => format!("{}: {reason}", describe(&status)),
            None => describe(&status),
        };
        eprintln!("sarrus serve: the server (process {id}) {how}, before it was ready");
        self.died(None, &how)
    }

    /// Counts a death and sets when the next start is due.
    fn died(&mut self, life: Option<Duration>, how: &str) -> Result<(), End> {
        match self.backoff.died(self.now(), life) {
            Next::After(delay) => {
                self.serving_due = self.now() + delay;
                Ok(())
            }
            Next::Never => Err(too_often(how)),
        }
    }

    fn hear_standby(&mut self) {
        // it may have been ordered meanwhile
        let Some(standby) = &mut self.standby else { return };
        let Some(messages) = standby.read() else {
            let failure = standby.failure.take();
            let Some(old) = self.standby.take() else { return };
            let how = describe(&old.end());
            let reason = failure.map(|(reason, _)| format!(": {reason}")).unwrap_or_default();
            return self.without_standby(&format!("{how}{reason}"));
        };
        for message in messages {
            match message {
                Message::Loaded(fingerprint) => match changed(self.announced, fingerprint) {
                    None => {
                        standby.loaded = Some(fingerprint);
                        self.standby_failures = 0;
                    }
                    Some(words) => {
                        drop(self.standby.take().map(Worker::end));
                        return self.without_standby(&format!("is of no use: {words}"));
                    }
                },
                Message::Taken(reason) => standby.failure = Some((reason, true)),
                Message::Failed(reason) => standby.failure = Some((reason, false)),
                Message::Ready(_) => {}
            }
        }
    }

    /// The server that runs goes on: a file that is being changed must not end it. Said once in a
    /// row, tried again after a delay.
    fn without_standby(&mut self, how: &str) {
        self.standby_failures += 1;
        // the second in a row, since one alone is tried again at once
        if self.standby_failures == 2 {
            eprintln!(
                "sarrus serve: the process that should wait {how}; the server runs, and a restart \
                 would fail or take longer"
            );
        }
        self.standby_due = self.now() + delay(self.standby_failures);
    }

    /// Ends both processes and says why.
    fn finish(mut self, name: &str, end: End) -> ExitCode {
        self.say();
        drop(self.standby.take().map(Worker::end));
        let is_clean = self.stop_serving();
        match end {
            End::Ordered if is_clean => ExitCode::SUCCESS,
            End::Ordered => ExitCode::from(2),
            End::GivenUp { reason, code, is_public } => {
                eprintln!("sarrus serve: given up: {reason}");
                if is_public && let Err(error) = leave_reason(name, &reason) {
                    eprintln!("sarrus serve: clients will not know why: {error}");
                }
                ExitCode::from(code)
            }
        }
    }

    /// A clean stop of the process that serves; false where it had to be killed.
    fn stop_serving(&mut self) -> bool {
        let Some(mut serving) = self.serving.take() else { return true };
        // without an order there is nothing to take down
        if !serving.ordered {
            let _ = serving.end();
            return true;
        }
        serving.terminate();
        let start = Instant::now();
        loop {
            let left = STOP.saturating_sub(start.elapsed());
            let timeout = Timespec::try_from(left).ok();
            match readable(&self.signals, [Some(&serving), None], timeout.as_ref()) {
                _ if left.is_zero() => {
                    let (id, _) = (serving.id(), serving.end());
                    eprintln!("sarrus serve: the server (process {id}) did not stop: killed");
                    return false;
                }
                // a second signal orders nothing else
                Ok([true, _, _]) => drop(self.signals.read(&mut [0; 64])),
                Ok([_, true, _]) if serving.read().is_none() => {
                    return serving.end().is_ok_and(|status| status.success());
                }
                _ => {}
            }
        }
    }
}

/// Which of signals and outputs can be read, after at most a time.
fn readable(
    signals: &UnixStream,
    outputs: [Option<&Worker>; 2],
    timeout: Option<&Timespec>,
) -> io::Result<[bool; 3]> {
    let sources: [Option<BorrowedFd<'_>>; 3] =
        [Some(signals.as_fd()), outputs[0].map(Worker::output), outputs[1].map(Worker::output)];
    let mut waited: Vec<PollFd<'_>> =
        sources.iter().flatten().map(|fd| PollFd::from_borrowed_fd(*fd, PollFlags::IN)).collect();
    match poll(&mut waited, timeout) {
        Ok(_) | Err(rustix::io::Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    let mut waited = waited.iter();
    Ok(sources
        .map(|source| source.is_some() && waited.next().is_some_and(|fd| !fd.revents().is_empty())))
}
