//! The thread of the rules: a cycle at each absolute deadline.

use std::sync::atomic::{AtomicBool, Ordering};

use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::Timespec;
use sarrus_can_core::bridge::{Bridge, BusEvent};
use sarrus_can_core::telemetry::{CycleTimes, Telemetry};
use sarrus_proto::bridge::BridgeEnd;

use super::bus::BusEnd;
use super::fault_log::FaultLogEnd;
use crate::bus::Heard;
use sarrus_client::now_ns;

/// Everything that a cycle needs.
pub(super) struct Rules<'a> {
    /// First of all: where this ends, the buses send their shutdown frames before anything else is
    /// tidied up.
    pub(super) ends: Vec<BusEnd>,
    pub(super) bridge: Bridge,
    pub(super) telemetry: Telemetry,
    pub(super) services: BridgeEnd,
    pub(super) log: FaultLogEnd,
    pub(super) stop: &'a AtomicBool,
}

impl Rules<'_> {
    /// Cycles until the end is asked for.
    pub(super) fn run(&mut self) {
        let period_ns = self.bridge.configuration().period_ns();
        let mut deadline = now_ns() + period_ns;
        while !self.stop.load(Ordering::Relaxed) {
            sleep_until(deadline);
            let begin = now_ns();
            self.cycle(begin);
            let end = now_ns();
            self.telemetry.cycle(
                &self.bridge,
                CycleTimes { wake_ns: begin.saturating_sub(deadline), work_ns: end - begin },
            );
            if let Some(statistics) = self.telemetry.due(&self.bridge, end) {
                self.services.publish_statistics(&statistics);
            }
            // deadlines that have passed are left out, not made up for
            deadline += period_ns;
            if deadline < end {
                deadline += (end - deadline).div_ceil(period_ns) * period_ns;
            }
        }
    }

    fn cycle(&mut self, now: u64) {
        for (bus, end) in self.ends.iter_mut().enumerate() {
            for (at_ns, heard) in end.heard() {
                match heard {
                    Heard::Frame(frame) => {
                        self.log.frame(at_ns, bus, &frame);
                        self.bridge.receive(at_ns, bus, &frame);
                    }
                    Heard::Event(event) => {
                        self.log.event(at_ns, bus, event);
                        self.bridge.bus_event(at_ns, bus, event);
                    }
                }
            }
        }
        while let Some(request) = self.services.operation() {
            if let Some(operation) = self.bridge.request(now, &request) {
                let actuator = request.actuator.checked_sub(1).map(|place| place as usize);
                self.log.operate(now, operation, actuator);
            }
        }
        if let Some(command) = self.services.command() {
            self.log.command(now, &command);
            self.bridge.command(now, &command);
        }
        self.bridge.cycle(now);
        self.log.cycle(now, &self.bridge);
        let number = self.bridge.counters().cycles;
        for (bus, end) in self.ends.iter_mut().enumerate() {
            let dropped = end.send(number, self.bridge.frames(bus));
            if dropped > 0 {
                self.log.event(now, bus, BusEvent::Dropped(dropped));
                self.bridge.bus_event(now, bus, BusEvent::Dropped(dropped));
            }
        }
        self.services.publish(self.bridge.state());
    }
}

/// Sleeps until a time of the monotonic clock; a signal wakes it early, and then the cycle is
/// early.
fn sleep_until(deadline_ns: u64) {
    let time = Timespec {
        tv_sec: (deadline_ns / 1_000_000_000) as i64,
        tv_nsec: (deadline_ns % 1_000_000_000) as i64,
    };
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &time);
}
