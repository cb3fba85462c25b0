//! The thread that keeps what the bridge was given, and writes it to a file on each fault.
//!
//! The rules only push into queues of fixed size; keeping, writing and forgetting is done here, at
//! no priority.

use std::thread;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rtrb::{Consumer, Producer, RingBuffer};
use sarrus_can_core::bridge::{Bridge, BusEvent};
use sarrus_can_core::config::Configuration;
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::fault_log::{After, FaultLog};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::log::{Line, What};
use sarrus_client::actuators::{ActuatorCommand, Operation, Reason};

use crate::stderr::say;

/// Inputs and commands that may wait.
const ROOM: usize = 1 << 15;
const COMMANDS: usize = 256;
/// Time between two looks.
const PAUSE: Duration = Duration::from_millis(20);

/// What goes from the rules to the thread.
#[derive(Clone, Copy)]
enum Input {
    Frame(u64, usize, Frame),
    Event(u64, usize, BusEvent),
    Operate(u64, Operation, Option<usize>),
    /// The command itself is in a queue of its own.
    Command(u64),
    Cycle(u64, After),
    Fault(Reason),
}

/// The rules' side.
pub(super) struct FaultLogEnd {
    inputs: Producer<Input>,
    commands: Producer<ActuatorCommand>,
    faults: u64,
    /// Inputs that found no room.
    lost: u64,
}

impl FaultLogEnd {
    pub(super) fn frame(&mut self, t: u64, bus: usize, frame: &Frame) {
        self.push(Input::Frame(t, bus, *frame));
    }

    pub(super) fn event(&mut self, t: u64, bus: usize, event: BusEvent) {
        self.push(Input::Event(t, bus, event));
    }

    pub(super) fn operate(&mut self, t: u64, operation: Operation, actuator: Option<usize>) {
        self.push(Input::Operate(t, operation, actuator));
    }

    pub(super) fn command(&mut self, t: u64, command: &ActuatorCommand) {
        if self.commands.push(*command).is_ok() {
            self.push(Input::Command(t));
        } else {
            self.lost += 1;
        }
    }

    /// After a cycle of the bridge.
    pub(super) fn cycle(&mut self, t: u64, bridge: &Bridge) {
        self.push(Input::Cycle(t, After::cycle_of(bridge)));
        let (faults, last) = bridge.faults();
        if let (true, Some((_, reason))) = (faults != self.faults, last) {
            self.faults = faults;
            self.push(Input::Fault(reason));
        }
    }

    fn push(&mut self, input: Input) {
        self.lost += u64::from(self.inputs.push(input).is_err());
    }
}

impl Drop for FaultLogEnd {
    fn drop(&mut self) {
        if self.lost > 0 {
            say(format_args!("{} input(s) are missing in the logs of faults", self.lost));
        }
    }
}

/// The thread's side.
pub(super) struct FaultLogThread {
    inputs: Consumer<Input>,
    commands: Consumer<ActuatorCommand>,
    configuration: Configuration,
    files: FaultFiles,
    kept: FaultLog,
}

/// Both sides.
pub(super) fn fault_log(
    files: FaultFiles,
    configuration: Configuration,
) -> (FaultLogEnd, FaultLogThread) {
    let (inputs, taken) = RingBuffer::new(ROOM);
    let (commands, of_commands) = RingBuffer::new(COMMANDS);
    let end = FaultLogEnd { inputs, commands, faults: 0, lost: 0 };
    let thread = FaultLogThread {
        inputs: taken,
        commands: of_commands,
        configuration,
        files,
        kept: FaultLog::default(),
    };
    (end, thread)
}

impl FaultLogThread {
    /// Until the rules are gone.
    pub(super) fn run(mut self) {
        loop {
            let is_last = self.inputs.is_abandoned();
            while let Ok(input) = self.inputs.pop() {
                self.take(input);
            }
            if is_last {
                return;
            }
            thread::sleep(PAUSE);
        }
    }

    fn take(&mut self, input: Input) {
        let (t, what) = match input {
            Input::Frame(t, bus, frame) => (t, What::Frame(bus, frame)),
            Input::Event(t, bus, event) => (t, What::Event(bus, event)),
            Input::Operate(t, operation, actuator) => (t, What::Operate(operation, actuator)),
            Input::Command(t) => match self.commands.pop() {
                Ok(command) => (t, What::Command(Box::new(command))),
                Err(_) => return,
            },
            Input::Cycle(t, after) => {
                self.kept.push(Line { t, what: What::Cycle });
                return self.kept.after(after);
            }
            Input::Fault(reason) => return self.write(reason),
        };
        self.kept.push(Line { t, what });
    }

    fn write(&self, reason: Reason) {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        match self.files.write(since.as_millis(), reason, &self.kept, &self.configuration) {
            Ok(path) => {
                say(format_args!("{}: what led to it is in {}", reason.name(), path.display()))
            }
            Err(error) => say(format_args!(
                "{}: what led to it cannot be written to {}: {error}",
                reason.name(),
                self.files.folder().display()
            )),
        }
    }
}
