//! Gaps of a log: the bridge's state at a gap, and the continuation after it.

use sarrus_proto::actuators::{MechanismState, Reason};

use super::{Bookmark, Bridge};

impl Bridge {
    /// The state of each actuator after the last cycle, for a log that may begin here.
    pub fn bookmark(&self) -> Bookmark {
        let mut mark = Bookmark { live: 0, fault: 0, in_time: 0 };
        for (actuator, number) in self.configuration.mechanisms.iter().enumerate() {
            let Some(mechanism) = self.mechanisms.get(*number) else { continue };
            mark.live |= u64::from(mechanism.is_live()) << actuator;
            mark.fault |= u64::from(mechanism.state == MechanismState::Fault) << actuator;
        }
        for motor in &self.motors {
            let is_in_time = !motor.monitors.age.is_unknown();
            mark.in_time |= u64::from(is_in_time) << motor.config.actuator;
        }
        mark
    }

    /// Continues after a gap of a log at `now_ns` by the log: mechanisms with power continue,
    /// except those that lost it in the gap. Time does not advance during the gap, for drives
    /// neither: subtract [`Bridge::skipped_ns`] from all later times of the log.
    pub fn resume(&mut self, now_ns: u64, mark: &Bookmark) {
        if let Some(last_ns) = self.last_cycle_ns {
            let next_ns = last_ns + self.configuration.period_ns();
            self.skipped_ns = now_ns.saturating_sub(next_ns);
            self.resumes = true;
        }
        let is_in = |bits: u64, actuator: usize| bits >> actuator & 1 == 1;
        for motor in &mut self.motors {
            motor.resume_log(is_in(mark.in_time, motor.config.actuator));
        }
        for (actuator, number) in self.configuration.mechanisms.iter().enumerate() {
            let Some(mechanism) = self.mechanisms.get_mut(*number) else { continue };
            if is_in(mark.fault, actuator) {
                mechanism.latch(Reason::None);
            } else if !is_in(mark.live, actuator) {
                mechanism.disable(Reason::None);
            }
        }
    }

    /// The first cycle after a gap: set-points go on from the commands of then.
    pub(super) fn go_on(&mut self) {
        if std::mem::take(&mut self.resumes) {
            for motor in &mut self.motors {
                let desired = self.command.position.get(motor.config.actuator).copied();
                motor.resume_from(desired.unwrap_or(motor.place()));
            }
        }
    }

    /// Length of all gaps of the log so far `[ns]`.
    pub fn skipped_ns(&self) -> u64 {
        self.skipped_ns
    }
}
