//! The thread of the rules: a cycle at each absolute deadline.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::thread::{ClockId, clock_nanosleep_absolute};
use sarrus_can_core::bridge::{Bridge, BusEvent};
use sarrus_can_core::log::{Line, What};
use sarrus_can_core::telemetry::Telemetry;
use sarrus_proto::bridge::BridgeEnd;
use sarrus_proto::socket::timespec;
use sarrus_proto::watch::Times;

use crate::bus::Heard;
use crate::bus_thread::BusEnd;
use crate::journal::Journal;
use crate::positions::Noted;
use sarrus_client::now_ns;

/// Counts and times of a bridge that has ended.
#[derive(Clone, Copy, Debug)]
pub struct Report {
    /// Deadlines that passed during a cycle and were left out.
    pub missed: u64,
    /// Inputs that are missing in the logs.
    pub lost: u64,
    /// From the deadline of a cycle to its begin `[ns]`.
    pub wake: Times,
    /// From the begin of a cycle to its last frame `[ns]`.
    pub work: Times,
}

/// The state of the thread of the rules.
pub(crate) struct Rules {
    /// First of all: where this ends, the buses send their shutdown frames before anything else is
    /// tidied up.
    pub(crate) ends: Vec<BusEnd>,
    pub(crate) bridge: Bridge,
    pub(crate) telemetry: Telemetry,
    pub(crate) services: BridgeEnd,
    pub(crate) journal: Journal,
    /// Where positions are noted; `None` without a file for them.
    pub(crate) positions: Option<Noted>,
    pub(crate) stop: Arc<AtomicBool>,
    /// Deadlines that passed during a cycle and were left out.
    pub(crate) missed: u64,
}

impl Rules {
    /// Cycles until the end is asked for.
    pub(crate) fn run(&mut self) {
        let period_ns = self.bridge.configuration().period_ns();
        let mut deadline = now_ns() + period_ns;
        while !self.stop.load(Ordering::Relaxed) {
            sleep_until(deadline);
            let begin = now_ns();
            self.cycle(begin);
            let end = now_ns();
            self.telemetry.cycle(&self.bridge, begin.saturating_sub(deadline), end - begin);
            if let Some(statistics) = self.telemetry.due(&self.bridge, end) {
                self.services.publish_statistics(&statistics);
            }
            // deadlines that have passed are left out, not made up for
            deadline += period_ns;
            if deadline < end {
                let missed = (end - deadline).div_ceil(period_ns);
                self.missed += missed;
                deadline += missed * period_ns;
            }
        }
    }

    /// Ends the queues, at which each bus sends its shutdown frames, and only then computes the
    /// report: motors under power do not wait for it.
    pub(crate) fn end(self) -> Report {
        drop(self.ends);
        let statistics = self.telemetry.statistics(&self.bridge, 0);
        let lost = self.journal.lost();
        Report { missed: self.missed, lost, wake: statistics.wake, work: statistics.work }
    }

    fn cycle(&mut self, now: u64) {
        let give = |journal: &mut Journal, bridge: &mut Bridge, t: u64, what: What| {
            let line = Line { t, what };
            line.apply(bridge);
            journal.add(line.t, line.what);
        };
        for (bus, end) in self.ends.iter_mut().enumerate() {
            if end.is_late() {
                let late = What::Event(bus, BusEvent::Late);
                give(&mut self.journal, &mut self.bridge, now, late);
            }
            for (at_ns, heard) in end.heard() {
                let what = match heard {
                    Heard::Frame(frame) => What::Frame(bus, frame),
                    Heard::Event(event) => What::Event(bus, event),
                };
                give(&mut self.journal, &mut self.bridge, at_ns, what);
            }
        }
        while let Some(request) = self.services.operation() {
            if let Some(operation) = self.bridge.request(now, &request) {
                let actuator = request.actuator.checked_sub(1).map(|place| place as usize);
                self.journal.add(now, What::Operate(operation, actuator));
            }
        }
        if let Some(command) = self.services.command() {
            self.journal.command(now, &command);
            self.bridge.command(now, &command);
        }
        self.bridge.cycle(now);
        self.journal.cycle(now, &mut self.bridge);
        self.positions.iter().for_each(|positions| positions.note(&self.bridge));
        let number = self.bridge.counters().cycles;
        for (bus, end) in self.ends.iter_mut().enumerate() {
            let dropped = end.send(number, self.bridge.frames(bus));
            if dropped > 0 {
                let dropped = What::Event(bus, BusEvent::Dropped(dropped));
                give(&mut self.journal, &mut self.bridge, now, dropped);
            }
        }
        self.services.publish(self.bridge.state());
    }
}

/// Sleeps until a time of the monotonic clock; a signal wakes it early, and then the cycle is
/// early.
fn sleep_until(deadline_ns: u64) {
    let time = timespec(Duration::from_nanos(deadline_ns));
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
}
