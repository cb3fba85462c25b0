//! The inputs that led to faults, kept and written by a separate thread while the bridge runs.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::fault_files::FaultFiles;
use sarrus_can_core::fault_log::{After, FaultLog};
use sarrus_can_core::log::Line;
use sarrus_proto::actuators::Reason;

use crate::locked;

/// Inputs that may wait.
const ROOM: usize = 1 << 16;
/// Time between two looks.
const PAUSE: Duration = Duration::from_millis(20);
/// The rest is written within this time at the end, even if stderr blocks.
const END: Duration = Duration::from_secs(1);

enum Input {
    Line(Line),
    After(After),
    Fault(Reason),
}

/// The bridge's side. Nothing wakes the thread, which looks by itself.
pub(crate) struct FaultKeeper {
    inputs: Arc<Mutex<Vec<Input>>>,
    ends: Arc<AtomicBool>,
    thread: JoinHandle<()>,
    faults: u64,
    lost: u64,
}

impl FaultKeeper {
    /// Begins to keep, with the files of a bridge.
    pub(crate) fn new(
        files: FaultFiles,
        configuration: Configuration,
    ) -> std::io::Result<FaultKeeper> {
        let inputs = Arc::new(Mutex::new(Vec::with_capacity(ROOM)));
        let ends = Arc::new(AtomicBool::new(false));
        let of_thread = inputs.clone();
        let has_ended = ends.clone();
        let thread = thread::Builder::new()
            .name("fault log".to_owned())
            .spawn(move || keep(&files, &configuration, &of_thread, &has_ended))?;
        Ok(FaultKeeper { inputs, ends, thread, faults: 0, lost: 0 })
    }

    /// Adds a line; never waits for the disk.
    pub(crate) fn put(&mut self, line: Line) {
        self.push(Input::Line(line));
    }

    /// After a cycle of the bridge, whose line was put before.
    pub(crate) fn after(&mut self, bridge: &Bridge) {
        self.push(Input::After(After::cycle_of(bridge)));
        let (faults, newest) = bridge.faults();
        if let (true, Some((_, reason))) = (faults != self.faults, newest) {
            self.faults = faults;
            self.push(Input::Fault(reason));
        }
    }

    /// Writes the rest; returns the number of inputs that found no room.
    pub(crate) fn end(self) -> u64 {
        self.ends.store(true, Ordering::Release);
        let begin = Instant::now();
        while !self.thread.is_finished() && begin.elapsed() < END {
            thread::sleep(PAUSE / 4);
        }
        self.lost
    }

    fn push(&mut self, input: Input) {
        let mut inputs = locked(&self.inputs);
        if inputs.len() < ROOM {
            inputs.push(input);
        } else {
            self.lost += 1;
        }
    }
}

fn keep(
    files: &FaultFiles,
    configuration: &Configuration,
    inputs: &Mutex<Vec<Input>>,
    ends: &AtomicBool,
) {
    let mut kept = FaultLog::default();
    let mut taken = Vec::with_capacity(ROOM);
    loop {
        let is_last = ends.load(Ordering::Acquire);
        // the lock is held for an exchange of two pointers
        std::mem::swap(&mut *locked(inputs), &mut taken);
        for input in taken.drain(..) {
            match input {
                Input::Line(line) => kept.push(line),
                Input::After(after) => kept.after(after),
                Input::Fault(reason) => write(files, configuration, &kept, reason),
            }
        }
        if is_last {
            return;
        }
        thread::sleep(PAUSE);
    }
}

fn write(files: &FaultFiles, configuration: &Configuration, kept: &FaultLog, reason: Reason) {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let written = files.write(since.as_millis(), reason, kept, configuration);
    let name = reason.name();
    let folder = files.folder().display();
    // stderr may be closed
    let _ = match written {
        Ok(path) => {
            let path = path.display();
            writeln!(std::io::stderr(), "sarrus.can: {name}: what led to it is in {path}")
        }
        Err(error) => writeln!(
            std::io::stderr(),
            "sarrus.can: {name}: what led to it cannot be written to {folder}: {error}"
        ),
    };
}
