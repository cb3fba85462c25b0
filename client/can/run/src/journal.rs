//! The logs of a bridge's inputs: one of everything, and one file for each fault.
//!
//! The cycle only pushes into queues of fixed size. A thread at ordinary priority reads them and
//! writes the files.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::FileTypeExt;
use std::path::Path;
use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rtrb::{Consumer, Producer, RingBuffer};
use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::fault_log::{FaultLog, STATE_NS};
use sarrus_can_core::log::{Line, What};
use sarrus_client::actuators::{ActuatorCommand, Reason};

use crate::stderr::say;

/// Inputs and commands that may wait.
const ROOM: usize = 1 << 15;
const COMMANDS: usize = 256;
/// States of the bridge that have room.
const STATES: usize = 8;
/// Time between two reads of the queues.
const PAUSE: Duration = Duration::from_millis(20);

/// One element of the queue from the cycle to the thread.
enum Input {
    /// None of a command, which would be allocated.
    Line(Line),
    /// The command itself is in a queue of its own.
    Command(u64),
    /// The state after the last cycle is in a queue of its own.
    State(u64),
    /// Inputs found no room.
    Gap,
    Fault(Reason),
}

/// The end that takes the inputs.
pub struct Journal {
    inputs: Producer<Input>,
    commands: Producer<ActuatorCommand>,
    states: Producer<Vec<u64>>,
    rooms: Consumer<Vec<u64>>,
    /// When the last state was written `[ns]`.
    state_ns: u64,
    has_gap: bool,
    faults: u64,
    lost: u64,
}

impl Journal {
    /// Adds a frame, an event of a bus or an operation.
    pub fn add(&mut self, t: u64, what: What) {
        self.push(Input::Line(Line { t, what }));
    }

    /// Adds a command.
    pub fn command(&mut self, t: u64, command: &ActuatorCommand) {
        if self.commands.push(*command).is_ok() {
            self.push(Input::Command(t));
        } else {
            (self.lost, self.has_gap) = (self.lost + 1, true);
        }
    }

    /// Adds a cycle, after the bridge has run it, and once a second the bridge's state.
    pub fn cycle(&mut self, t: u64, bridge: &mut Bridge) {
        self.add(t, What::Cycle);
        if self.has_gap && self.inputs.push(Input::Gap).is_ok() {
            (self.has_gap, self.state_ns) = (false, 0);
        }
        if t.saturating_sub(self.state_ns) >= STATE_NS
            && let Ok(mut room) = self.rooms.pop()
            && bridge.save(&mut room)
            && self.states.push(room).is_ok()
        {
            self.state_ns = t;
            self.push(Input::State(t));
        }
        let (faults, last) = bridge.faults();
        if let (true, Some((_, reason))) = (faults != self.faults, last) {
            self.faults = faults;
            self.push(Input::Fault(reason));
        }
    }

    /// Number of inputs that found no room so far.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.lost
    }

    fn push(&mut self, input: Input) {
        let is_lost = self.inputs.push(input).is_err();
        self.lost += u64::from(is_lost);
        self.has_gap |= is_lost;
    }
}

/// The end that writes the files.
pub struct JournalWriter {
    inputs: Consumer<Input>,
    commands: Consumer<ActuatorCommand>,
    states: Consumer<Vec<u64>>,
    rooms: Producer<Vec<u64>>,
    configuration: Configuration,
    faults: Option<(FaultFiles, FaultLog)>,
    log: Option<BufWriter<File>>,
    /// Lines of the log so far, or the first error.
    written: io::Result<u64>,
}

/// Creates a log. Opening a FIFO would wait for a reader, and no signal ended it.
fn new_log(path: &Path) -> io::Result<File> {
    if std::fs::metadata(path).is_ok_and(|found| found.file_type().is_fifo()) {
        let kind = io::ErrorKind::InvalidInput;
        return Err(io::Error::new(kind, format!("{} is a FIFO, expected a file", path.display())));
    }
    File::create(path)
}

/// Both ends for the inputs of a bridge: for the files of faults, a log of everything, or both.
///
/// # Errors
/// The log cannot be created.
pub fn journal(
    faults: Option<FaultFiles>,
    log: Option<&Path>,
    bridge: &mut Bridge,
) -> io::Result<(Journal, JournalWriter)> {
    let log = log.map(new_log).transpose()?.map(BufWriter::new);
    let (inputs, taken_inputs) = RingBuffer::new(ROOM);
    let (commands, taken_commands) = RingBuffer::new(COMMANDS);
    let (states, taken_states) = RingBuffer::new(STATES);
    let (mut given_rooms, rooms) = RingBuffer::new(STATES);
    for _ in 0..STATES {
        // as many as there is room for
        let _ = given_rooms.push(bridge.room());
    }
    let journal = Journal {
        inputs,
        commands,
        states,
        rooms,
        state_ns: 0,
        has_gap: false,
        faults: 0,
        lost: 0,
    };
    let writer = JournalWriter {
        inputs: taken_inputs,
        commands: taken_commands,
        states: taken_states,
        rooms: given_rooms,
        configuration: bridge.configuration().without_motors(),
        faults: faults.map(|files| (files, FaultLog::default())),
        log,
        written: Ok(0),
    };
    Ok((journal, writer))
}

impl JournalWriter {
    /// Writes until the [`Journal`] is dropped; the number of lines of the log.
    ///
    /// # Errors
    /// The log could not be written.
    pub fn run(mut self) -> io::Result<u64> {
        loop {
            let is_last = self.inputs.is_abandoned();
            while let Ok(input) = self.inputs.pop() {
                self.take(input);
            }
            if is_last {
                break;
            }
            thread::sleep(PAUSE);
        }
        self.log.as_mut().map_or(Ok(()), BufWriter::flush).and(self.written)
    }

    fn take(&mut self, input: Input) {
        let line = match input {
            Input::Line(line) => line,
            Input::Command(t) => match self.commands.pop() {
                Ok(command) => Line { t, what: What::Command(Box::new(command)) },
                Err(_) => return,
            },
            Input::State(t) => {
                let Ok(words) = self.states.pop() else { return };
                let room = match &mut self.faults {
                    Some((_, kept)) => kept.state(t, words),
                    None => Some(words),
                };
                let _ = room.map(|room| self.rooms.push(room));
                return;
            }
            Input::Gap => {
                if let Some((_, kept)) = &mut self.faults {
                    kept.lose().for_each(|room| drop(self.rooms.push(room)));
                }
                return;
            }
            Input::Fault(reason) => return self.write_fault(reason),
        };
        if let (Some(file), Ok(lines)) = (&mut self.log, &mut self.written) {
            match writeln!(file, "{}", line.text(&self.configuration)) {
                Ok(()) => *lines += 1,
                Err(error) => self.written = Err(error),
            }
        }
        if let Some((_, kept)) = &mut self.faults {
            kept.push(line);
        }
    }

    fn write_fault(&self, reason: Reason) {
        let Some((files, kept)) = &self.faults else { return };
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        match files.write(since.as_millis(), reason, kept, &self.configuration) {
            Ok(path) => {
                let name = reason.name();
                say(format_args!("{name}{}: what led to it is in {}", cure(reason), path.display()))
            }
            Err(error) => say(format_args!(
                "{}: what led to it cannot be written to {}: {error}",
                reason.name(),
                files.folder().display()
            )),
        }
    }
}

/// The remedy of a fault of this program itself.
fn cure(reason: Reason) -> &'static str {
    match reason {
        Reason::Stalled => {
            " (this program did not get to run in time; CAP_SYS_NICE or LimitRTPRIO give it \
                SCHED_FIFO, see `wake` in `sarrus-can top`)"
        }
        _ => "",
    }
}
