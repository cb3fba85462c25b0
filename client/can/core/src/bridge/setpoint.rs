//! From a command to the set-point of one motor: limits, ramps, damping, stops. One function for
//! all modes and all paths.

use std::f64::consts::TAU;

use sarrus_proto::actuators::{ActuatorCommand, flag};

use super::course::{Course, RETURN_EFFORT};
use super::monitors::DITHER;
use super::motor::Motor;
use crate::drive::{Mode, Setpoint};
use crate::mapping::ActuatorSetpoint;

/// Part of a limit's distance in which set-points stop, by their deceleration and by the delay.
const CALM: f64 = 0.5;

impl Motor {
    /// The set-point of this cycle, on the motor's side. `elapsed` is the time since the last
    /// set-point `[s]`. Flags the limits that it reached.
    pub(super) fn setpoint(
        &mut self,
        command: &ActuatorCommand,
        course: Course,
        elapsed: f64,
    ) -> Setpoint {
        self.flags = 0;
        let mut setpoint = match course {
            Course::Follow(ramp) => self.following(command, ramp, elapsed),
            Course::Damp => self.damped(),
            Course::Brake { speed, passed } => self.braking(speed, passed, elapsed),
            Course::QuickStop => self.braking(0.0, 0.0, elapsed),
            Course::Lower(speed) => self.lowering(speed, elapsed),
            Course::Return => self.returning(elapsed),
            Course::Rest => self.resting(elapsed),
        };
        // a motor that does not report its velocity counts as still while it follows
        let velocity = match course {
            Course::Follow(_) if !self.measured.velocity.is_finite() => 0.0,
            _ => self.velocity,
        };
        let stiffness = setpoint.stiffness;
        if self.config.common.mode == Mode::Torque {
            // a motor without gains gets their sum
            if !matches!(course, Course::Follow(_)) {
                let error = setpoint.damping * (setpoint.velocity - velocity);
                let gain = self.chatter.gain(error, self.config.limits.effort);
                (setpoint.stiffness, setpoint.damping) =
                    (gain * setpoint.stiffness, gain * setpoint.damping);
            }
            setpoint = ActuatorSetpoint {
                effort: setpoint.effort + self.by_gains(&setpoint, velocity),
                stiffness: 0.0,
                damping: 0.0,
                ..setpoint
            };
        }
        let mut swing = 0.0;
        if let Course::Follow(ramp) = course {
            let change = self.config.limits.effort_rate * elapsed;
            let least = self.last_effort - change;
            let most = self.last_effort + change;
            setpoint.effort = self.limited(setpoint.effort, least, most, flag::RATE_LIMITED);
            if self.config.dither > 0.0 {
                swing = ramp * self.swing(elapsed);
                match self.config.common.mode {
                    Mode::Position => setpoint.position += swing,
                    _ => setpoint.effort += swing,
                }
            }
        }
        self.stiffness = stiffness;
        let setpoint = self.within_limits(setpoint, velocity);
        let part = if course == Course::Return { RETURN_EFFORT } else { 1.0 };
        let setpoint = self.within_effort(setpoint, velocity, part);
        (self.last_position, self.last_effort) = (setpoint.position, setpoint.effort);
        if self.config.dither > 0.0 {
            self.is_dithered = course == Course::Follow(1.0);
            match self.config.common.mode {
                Mode::Position => self.last_position -= swing,
                _ => self.last_effort -= swing,
            }
        }
        let [last, _] = self.asked;
        self.asked = [self.monitors.given(setpoint), last];
        self.config.mapping.to_motor(&setpoint)
    }

    /// The greatest speeds of set-points, back and ahead, at which they stop before the limits.
    fn stopping_speeds(&self, most: f64) -> [f64; 2] {
        let limits = &self.config.limits;
        let [braking, delay] = self.braking;
        [self.last_position - limits.lower, limits.upper - self.last_position].map(|room| {
            let room = room.max(0.0);
            (CALM * braking * 2.0 * room).sqrt().min(CALM * room / delay).min(most)
        })
    }

    /// The dither: slow enough for a joint, and fast enough to find a frozen encoder soon.
    fn swing(&mut self, elapsed: f64) -> f64 {
        self.phase = (self.phase + elapsed / DITHER).fract();
        self.config.dither * (TAU * self.phase).sin()
    }

    /// Stays where it is by damping alone: as a velocity of zero where the motor follows
    /// velocities, and as the position where commands stayed away where it follows positions.
    fn damped(&self) -> ActuatorSetpoint {
        ActuatorSetpoint {
            position: self.hold.max(self.config.limits.lower).min(self.config.limits.upper),
            velocity: 0.0,
            effort: 0.0,
            stiffness: 0.0,
            damping: self.config.damping,
        }
    }

    fn following(
        &mut self,
        command: &ActuatorCommand,
        ramp: f64,
        elapsed: f64,
    ) -> ActuatorSetpoint {
        let limits = self.config.limits;
        let of = |numbers: &[f64]| numbers.get(self.config.actuator).copied().unwrap_or(0.0);
        let desired = ActuatorSetpoint {
            position: of(&command.position),
            velocity: of(&command.velocity),
            effort: of(&command.effort),
            stiffness: of(&command.stiffness),
            damping: of(&command.damping),
        };

        // within the limits of the actuator
        let position =
            self.limited(desired.position, limits.lower, limits.upper, flag::POSITION_LIMITED);
        // a hot motor is slow, and near a limit nothing is faster than the brake can stop
        let derated = self.monitors.derated();
        if derated < 1.0 {
            self.flags |= flag::DERATED;
        }
        let most = derated * limits.velocity;
        let [low, high] = self.free;
        let [back, ahead] = match self.last_position < low || self.last_position > high {
            true => self.stopping_speeds(most),
            false => [most, most],
        };
        let velocity = self.limited(desired.velocity, -back, ahead, flag::VELOCITY_LIMITED);
        let effort =
            self.limited(desired.effort, -limits.effort, limits.effort, flag::EFFORT_LIMITED);

        // on the way from the measured position to the commanded one, no faster than the actuator
        // may move
        let position = self.hold + ramp * (position - self.hold);
        let position = self.limited(
            position,
            self.last_position - back * elapsed,
            self.last_position + ahead * elapsed,
            flag::VELOCITY_LIMITED,
        );

        ActuatorSetpoint {
            position,
            velocity: ramp * velocity,
            effort: ramp * effort,
            stiffness: ramp * desired.stiffness,
            damping: ramp * desired.damping,
        }
    }

    /// Effort of stiffness and damping at the last measurement `[N m, N]`.
    fn by_gains(&self, setpoint: &ActuatorSetpoint, velocity: f64) -> f64 {
        if matches!(self.config.common.mode, Mode::Position | Mode::Velocity) {
            return 0.0;
        }
        let place = self.measured.position;
        let behind = if place.is_finite() { setpoint.position - place } else { 0.0 };
        let slower = setpoint.velocity - velocity;
        setpoint.stiffness * behind + setpoint.damping * slower
    }

    /// Beyond a position limit nothing pushes or leads outwards; damping against the motion stays.
    fn within_limits(&mut self, setpoint: ActuatorSetpoint, velocity: f64) -> ActuatorSetpoint {
        let outwards = self.monitors.outwards(&self.config.limits, self.measured.position);
        if outwards == 0.0 {
            return setpoint;
        }
        let leads = outwards * setpoint.velocity > 0.0;
        let pushes = outwards * (setpoint.effort + self.by_gains(&setpoint, velocity)) > 0.0;
        if leads || pushes {
            self.flags |= flag::OUTWARD_LIMITED;
        }
        let setpoint =
            ActuatorSetpoint { velocity: if leads { 0.0 } else { setpoint.velocity }, ..setpoint };
        if !pushes {
            return setpoint;
        }
        let damping = setpoint.damping.max(self.config.damping);
        let (effort, damping) = match self.config.common.mode {
            Mode::Torque if outwards * velocity > 0.0 => (-damping * velocity, 0.0),
            Mode::Torque => (0.0, 0.0),
            _ => (0.0, damping),
        };
        ActuatorSetpoint { velocity: 0.0, effort, stiffness: 0.0, damping, ..setpoint }
    }

    /// Spring, damper and effort together stay within a part of the limit, by the last
    /// measurement. All three shrink alike, so that none is left alone where the motor itself
    /// saturates another.
    fn within_effort(
        &mut self,
        setpoint: ActuatorSetpoint,
        velocity: f64,
        part: f64,
    ) -> ActuatorSetpoint {
        let most = part * self.config.limits.effort;
        let total = setpoint.effort + self.by_gains(&setpoint, velocity);
        self.last_total = total.max(-most).min(most);
        if total.abs() <= most {
            return setpoint;
        }
        self.flags |= flag::EFFORT_LIMITED;
        let part = most / total.abs();
        let ActuatorSetpoint { effort, stiffness, damping, .. } = setpoint;
        ActuatorSetpoint {
            effort: part * effort,
            stiffness: part * stiffness,
            damping: part * damping,
            ..setpoint
        }
    }

    /// A number between two bounds; marks it where it is not. Both comparisons fail for NaN, which
    /// commands never hold.
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
