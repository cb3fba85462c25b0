//! The controlled stop of one motor.
//!
//! A velocity v* goes from the measured one to zero, and the motor follows it as a spring and a
//! damper follow a set-point:
//!
//! ```text
//! τ = g + k (p* − p) + d (v* − v),   p* = p₀ + ∫ v* dt,   k = d · 10/s
//! ```
//!
//! This is a velocity servo whose integral is the spring: after a tenth of a second or two it holds
//! a load in addition to gravity g. Where the robot is sound and the motor is at rest, the last
//! effort replaces a g that no model gives. p* stays within the position limits, and so close to p
//! that spring and damper together do not exceed the greatest effort: a load that this effort
//! cannot stop at once is not thrown back. Against an inertia J the servo does not swing where d ≥
//! 40/s · J.
//!
//! A heavier load swings, and a weak damper takes its time. So while the speed is above a line from
//! its first value to zero at half of the stop's time, or above the one from which the monitor of
//! positions sees a stop before the limit ahead, damping and spring grow: they double every 20 ms,
//! up to 16 times and within the motor's gains. An inertia that the greatest effort can stop in
//! half of that time is almost at rest at the end, as long as J ≤ d · 0.4 s.
//!
//! Lowering has no spring, and v* = −g/d, limited to the allowed speed v: τ = g − clamp(g, ±d v) −
//! d v. The load comes to rest at its equilibrium or on its support.
//!
//! A motor that follows torques gets the sum at the bridge's rate, with a cycle of delay, Δt: the
//! speed goes on as v₊ = v − a v₋ with a = d Δt / J, which is stable for a < 1 (with two cycles of
//! delay for a < 0.61). J is unknown, so [`Chatter`](super::chatter::Chatter) halves spring and
//! damper as long as the speed alternates. Where the greatest effort reverses the motor within one
//! cycle, halving does not help, and the monitors find a runaway.

use super::course::{RETURN_EFFORT, Reference};
use super::monitors::position;
use super::motor::Motor;
use super::reaction::Reaction;
use crate::mapping::ActuatorSetpoint;

/// Stiffness of a stop for its damping `[1/s]`.
const STIFFNESS: f64 = 10.0;

/// Time in which the damping of a stop doubles `[s]`, its greatest factor, and the part of the
/// stop's time after which the motor must be at rest.
const DOUBLING: f64 = 0.02;
const MOST_GAIN: f64 = 16.0;
const STOPPED: f64 = 0.5;
/// Part of the greatest velocity that counts as none.
const STILL: f64 = 0.01;

/// A motor slower than this part of its greatest velocity carries a load rather than accelerates.
const SLOW: f64 = 0.1;

/// Part of the greatest velocity at which an actuator comes back inside its limits, and how far it
/// comes, as part of the range between them.
const RETURN_SPEED: f64 = 0.05;
const RETURN_INSIDE: f64 = 0.02;

impl Motor {
    /// A stop begins from where the motor is, as fast as it is.
    pub(super) fn begin_stop(&mut self, reaction: Reaction) {
        let limits = self.config.limits;
        let is_slow = self.velocity.abs() < SLOW * limits.speed();
        let carries = reaction == Reaction::Ramp && is_slow && self.gravity == 0.0;
        self.stop = Reference {
            position: self.place(),
            velocity: self.velocity.max(-limits.velocity).min(limits.velocity),
            speed: self.velocity.abs(),
            gain: 1.0,
            load: if carries { self.last_total } else { 0.0 },
            away: self.velocity.abs() + limits.speed(),
        };
    }

    /// It is accelerated by the stop.
    pub(super) fn runs_away(&self) -> bool {
        self.velocity.abs() > self.stop.away
    }

    /// The set-point of a stop, with this part of the first velocity, after this part of its time.
    pub(super) fn braking(&mut self, part: f64, passed: f64, elapsed: f64) -> ActuatorSetpoint {
        // a motor behind the line to zero is braked harder, unless the damper makes it swing
        let allowed = self.stop.speed * (1.0 - passed / STOPPED).max(0.0);
        let still = STILL * self.config.limits.speed();
        let is_behind = self.velocity.abs() > allowed + still || self.is_too_near(still);
        if is_behind && !self.chatter.is_weakened() {
            self.stop.gain = (self.stop.gain * (elapsed / DOUBLING).exp2()).min(MOST_GAIN);
        }
        let damping = (self.stop.gain * self.stop_damping).min(self.most_damping);
        let stiffness = STIFFNESS * damping;
        ActuatorSetpoint { stiffness, ..self.moving(part * self.stop.velocity, damping, elapsed) }
    }

    /// It moves to a limit and would not stop before it by the braking distance.
    fn is_too_near(&self, still: f64) -> bool {
        let limits = &self.config.limits;
        let place = self.place();
        let speed = self.velocity.abs();
        let room = if self.velocity > 0.0 { limits.upper - place } else { place - limits.lower };
        speed > still && position::way(speed, self.braking) > room
    }

    /// The set-point of a way down with gravity, no faster than `speed`.
    pub(super) fn lowering(&mut self, speed: f64, elapsed: f64) -> ActuatorSetpoint {
        let damping = self.stop_damping;
        self.moving((-self.gravity / damping).max(-speed).min(speed), damping, elapsed)
    }

    /// The set-point of the way back inside the limits: a spring whose other end goes there slowly,
    /// and no farther ahead than where it has the effort of that way.
    pub(super) fn returning(&mut self, elapsed: f64) -> ActuatorSetpoint {
        let limits = self.config.limits;
        let reach = self.reach(RETURN_EFFORT);
        let inside = (RETURN_INSIDE * (limits.upper - limits.lower)).min(reach);
        let target = self.place().max(limits.lower + inside).min(limits.upper - inside);
        self.approaching(target, reach, elapsed)
    }

    /// The set-point of the way to the rest pose, as on the way back.
    pub(super) fn resting(&mut self, elapsed: f64) -> ActuatorSetpoint {
        let target = self.config.rest.unwrap_or(self.stop.position);
        let setpoint = self.approaching(target, self.reach(1.0), elapsed);
        ActuatorSetpoint { effort: setpoint.effort + self.stop.load, ..setpoint }
    }

    /// Whether it lies where it may rest.
    pub(super) fn is_resting(&self) -> bool {
        let margin = self.monitors.margin(&self.config.limits);
        self.config.rest.is_none_or(|rest| (self.place() - rest).abs() <= margin)
    }

    /// Where the spring has this part of the greatest effort.
    fn reach(&self, part: f64) -> f64 {
        part * self.config.limits.effort / (STIFFNESS * self.stop_damping)
    }

    fn approaching(&mut self, target: f64, reach: f64, elapsed: f64) -> ActuatorSetpoint {
        let limits = self.config.limits;
        let damping = self.stop_damping;
        let stiffness = STIFFNESS * damping;
        let place = self.place();
        let speed = (target - self.last_position).signum() * RETURN_SPEED * limits.speed();
        let way = (target - self.last_position).abs().min(speed.abs() * elapsed) * speed.signum();
        let position = (self.last_position + way).max(place - reach).min(place + reach);
        ActuatorSetpoint { position, velocity: speed, effort: self.gravity, stiffness, damping }
    }

    /// A velocity, without a spring.
    fn moving(&mut self, velocity: f64, damping: f64, elapsed: f64) -> ActuatorSetpoint {
        let limits = self.config.limits;

        // no farther away than the spring could hold beside the damper, and within the limits
        let left = (limits.effort - damping * (velocity - self.velocity).abs()).max(0.0);
        let place = self.place();
        let reach = left / (STIFFNESS * damping);
        let free = self.stop.position + velocity * elapsed;
        let free = free.max(place - reach).min(place + reach);
        self.stop.position = free.max(limits.lower).min(limits.upper);

        ActuatorSetpoint {
            position: self.stop.position,
            velocity: if self.stop.position == free { velocity } else { 0.0 },
            effort: self.gravity + self.stop.load,
            stiffness: 0.0,
            damping,
        }
    }
}
