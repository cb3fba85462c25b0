//! Accepts or rejects commands.

use sarrus_proto::actuators::{ActuatorCommand, MAX_ACTUATORS};
use sarrus_proto::counts::CommandVerdict;

use super::Bridge;

/// A stamp may lie this far in the future: clocks of two processors differ a little `[ns]`.
const AHEAD_NS: u64 = 1_000_000;
/// Larger numbers of a command are implausible; with gears and gains they could overflow.
const LARGEST: f64 = 1e60;

impl Bridge {
    /// Assesses a command that came at `now_ns`.
    pub(super) fn assess(&self, now_ns: u64, command: &ActuatorCommand) -> CommandVerdict {
        let n_u = self.configuration.actuators.len();
        if command.n_u != n_u as u64 {
            return CommandVerdict::WrongSize;
        }
        if command.fingerprint != self.configuration.fingerprint {
            return CommandVerdict::WrongModel;
        }
        let ActuatorCommand { position, velocity, effort, stiffness, damping, .. } = command;
        let used = |numbers: &[f64; MAX_ACTUATORS], good: fn(f64) -> bool| {
            numbers.iter().take(n_u).all(|number| good(*number))
        };
        if ![position, velocity, effort, stiffness, damping]
            .into_iter()
            .all(|numbers| used(numbers, |number| number.abs() <= LARGEST))
        {
            return CommandVerdict::NotFinite;
        }
        if ![stiffness, damping].into_iter().all(|numbers| used(numbers, |number| number >= 0.0)) {
            return CommandVerdict::Negative;
        }
        if command.stamp_ns > now_ns.saturating_add(AHEAD_NS) {
            return CommandVerdict::Ahead;
        }
        // while no mechanism has power another controller may restart the count
        let is_idle = self.mechanisms.iter().all(|mechanism| !mechanism.is_live());
        let is_newer = command.sequence > self.command.sequence || is_idle;
        if self.commanded && !(is_newer && command.stamp_ns > self.command.stamp_ns) {
            return CommandVerdict::Old;
        }
        CommandVerdict::Accepted
    }
}
