//! From a command to the set-point of one motor: limits, ramps, damping. One function for all modes and all paths.

use sarrus_proto::actuators::{ActuatorCommand, flag};

use super::motor::Motor;
use crate::drive::{Mode, Setpoint};
use crate::mapping::ActuatorSetpoint;

impl Motor {
    /// The set-point of this cycle, on the motor's side. `ramp` goes from 0 to 1 after arming, `elapsed` is the time since the last
    /// set-point `[s]`. Marks what was limited.
    pub(super) fn setpoint(&mut self, command: &ActuatorCommand, ramp: f64, is_damped: bool, elapsed: f64) -> Setpoint {
        self.flags = 0;
        let setpoint = if is_damped { self.damped() } else { self.following(command, ramp, elapsed) };
        let setpoint = self.within_effort(setpoint);
        (self.last_position, self.last_effort) = (setpoint.position, setpoint.effort);
        self.config.mapping.to_motor(&setpoint)
    }

    /// Stays where it is by damping alone: as a velocity of zero where the motor follows velocities, and as the position where commands
    /// stayed away where it follows positions.
    fn damped(&self) -> ActuatorSetpoint {
        ActuatorSetpoint { position: self.hold, velocity: 0.0, effort: 0.0, stiffness: 0.0, damping: self.config.damping }
    }

    fn following(&mut self, command: &ActuatorCommand, ramp: f64, elapsed: f64) -> ActuatorSetpoint {
        let limits = self.config.limits;
        let of = |numbers: &[f64]| numbers.get(self.config.actuator).copied().unwrap_or(0.0);
        let wanted = ActuatorSetpoint {
            position: of(&command.position),
            velocity: of(&command.velocity),
            effort: of(&command.effort),
            stiffness: of(&command.stiffness),
            damping: of(&command.damping),
        };

        // within the limits of the actuator
        let position = self.limited(wanted.position, limits.lower, limits.upper, flag::POSITION_LIMITED);
        let velocity = self.limited(wanted.velocity, -limits.velocity, limits.velocity, flag::VELOCITY_LIMITED);
        let effort = self.limited(wanted.effort, -limits.effort, limits.effort, flag::EFFORT_LIMITED);

        // on the way from the measured position to the commanded one, no faster than the actuator may move
        let position = self.hold + ramp * (position - self.hold);
        let way = limits.velocity * elapsed;
        let position = self.limited(position, self.last_position - way, self.last_position + way, flag::VELOCITY_LIMITED);

        // growing, no faster than the effort may
        let change = limits.effort_rate * elapsed;
        let effort = self.limited(ramp * effort, self.last_effort - change, self.last_effort + change, flag::RATE_LIMITED);
        ActuatorSetpoint { position, velocity: ramp * velocity, effort, stiffness: ramp * wanted.stiffness, damping: ramp * wanted.damping }
    }

    /// Spring, damper and effort together stay within the effort, as far as the last measurement tells. A motor that follows torques
    /// gets their sum, since it has no gains of its own.
    fn within_effort(&mut self, setpoint: ActuatorSetpoint) -> ActuatorSetpoint {
        let ActuatorSetpoint { position, velocity, effort, stiffness, damping } = setpoint;
        if matches!(self.config.common.mode, Mode::Position | Mode::Velocity) {
            return setpoint;
        }
        // a motor that does not tell its velocity counts as standing
        let known = |number: f64, otherwise: f64| if number.is_finite() { number } else { otherwise };
        let behind = position - known(self.measured.position, position);
        let slower = velocity - known(self.measured.velocity, 0.0);
        let by_gains = stiffness * behind + damping * slower;
        let most = self.config.limits.effort;
        let total = self.limited(effort + by_gains, -most, most, flag::EFFORT_LIMITED);
        match self.config.common.mode {
            Mode::Torque => ActuatorSetpoint { effort: total, stiffness: 0.0, damping: 0.0, ..setpoint },
            _ => ActuatorSetpoint { effort: total - by_gains, ..setpoint },
        }
    }

    /// A number between two bounds; marks it where it is not. Both comparisons fail for NaN, which commands never hold.
    fn limited(&mut self, number: f64, least: f64, most: f64, bit: u32) -> f64 {
        let limited = if number < least {
            least
        } else if number > most {
            most
        } else {
            return number;
        };
        self.flags |= bit;
        limited
    }
}
