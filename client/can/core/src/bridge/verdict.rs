//! Which commands are taken.

use sarrus_proto::actuators::{ActuatorCommand, MAX_ACTUATORS};

use super::Bridge;

/// A stamp may lie this far in the future: clocks of two processors differ a little `[ns]`.
const AHEAD_NS: u64 = 1_000_000;
/// Numbers of a command beyond this are no numbers of a robot; with gears and gains they could
/// overflow.
const LARGEST: f64 = 1e60;

/// Whether a command was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is the command from now on.
    Accepted,
    /// A number is NaN, infinite or beyond 1e60; the whole command is not used.
    NotFinite,
    /// A stiffness or damping is negative; the whole command is not used.
    Negative,
    /// Its sequence or stamp is not newer than that of the command before.
    Old,
    /// Its stamp lies in the future.
    Ahead,
    /// It was computed with another model.
    WrongModel,
    /// It is for another number of actuators.
    WrongSize,
}

impl Bridge {
    /// Judges a command that came at `now_ns`.
    pub(super) fn judge(&self, now_ns: u64, command: &ActuatorCommand) -> Verdict {
        let n_u = self.configuration.actuators.len();
        if command.n_u != n_u as u64 {
            return Verdict::WrongSize;
        }
        if command.fingerprint != self.configuration.fingerprint {
            return Verdict::WrongModel;
        }
        let ActuatorCommand { position, velocity, effort, stiffness, damping, .. } = command;
        let used = |numbers: &[f64; MAX_ACTUATORS], good: fn(f64) -> bool| {
            numbers.iter().take(n_u).all(|number| good(*number))
        };
        if ![position, velocity, effort, stiffness, damping]
            .into_iter()
            .all(|numbers| used(numbers, |number| number.abs() <= LARGEST))
        {
            return Verdict::NotFinite;
        }
        if ![stiffness, damping].into_iter().all(|numbers| used(numbers, |number| number >= 0.0)) {
            return Verdict::Negative;
        }
        if command.stamp_ns > now_ns.saturating_add(AHEAD_NS) {
            return Verdict::Ahead;
        }
        // while nothing has power another controller may begin to count anew
        let is_idle = self.mechanisms.iter().all(|mechanism| !mechanism.is_live());
        let is_newer = command.sequence > self.command.sequence || is_idle;
        if self.commanded && !(is_newer && command.stamp_ns > self.command.stamp_ns) {
            return Verdict::Old;
        }
        Verdict::Accepted
    }
}
