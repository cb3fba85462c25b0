//! A set-point in the five codes that MIT mode and CyberGear share.
//!
//! Position and velocity become the nearest codes, stiffness and damping those towards zero. The
//! motor sums τ = t + k (p − q) + d (v − q̇) from these codes: the torque is rounded towards zero,
//! and moved by a code more where the sum, by the last measurement, would leave the limit.

use super::number::limited;
use super::scale::Scale;
use crate::drive::Setpoint;

#[derive(Clone, Copy, Debug)]
pub(super) struct Codes {
    pub(super) position: Scale,
    pub(super) velocity: Scale,
    pub(super) torque: Scale,
    pub(super) stiffness: Scale,
    pub(super) damping: Scale,
}

impl Codes {
    /// Ends of the ranges of position, velocity and torque.
    pub(super) fn ranges(&self) -> [f64; 3] {
        [self.position, self.velocity, self.torque].map(Scale::end)
    }

    /// Codes of position, velocity, stiffness, damping and torque, within ± `limit` N m for a motor
    /// whose position and velocity were last `measured`. `odd` as for [`Scale::code`].
    pub(super) fn of(
        &self,
        setpoint: &Setpoint,
        limit: f64,
        measured: Option<[f64; 2]>,
        odd: bool,
    ) -> [u16; 5] {
        let position = self.position.code(setpoint.position, odd);
        let velocity = self.velocity.code(setpoint.velocity, odd);
        let (stiffness, k) = self.stiffness.toward_zero(setpoint.stiffness, odd);
        let (damping, d) = self.damping.toward_zero(setpoint.damping, odd);
        // torque of spring and damper for these codes
        let by_gains = measured.map_or(0.0, |[q, qd]| {
            k * (self.position.value(position) - q) + d * (self.velocity.value(velocity) - qd)
        });
        let least = -limit - by_gains;
        let most = limit - by_gains;
        let torque = limited(setpoint.torque, limit).max(least).min(most);
        let torque = self.torque.within(self.torque.toward_zero(torque, odd), least, most);
        [position, velocity, stiffness, damping, torque]
    }

    /// Stiffness and damping at the ends of their ranges.
    pub(super) fn largest_gains(&self) -> [f64; 2] {
        [self.stiffness, self.damping].map(|scale| scale.value(scale.code(f64::INFINITY, false)))
    }

    /// One step of each.
    pub(super) fn steps(&self) -> Setpoint {
        Setpoint {
            position: self.position.step(),
            velocity: self.velocity.step(),
            torque: self.torque.step(),
            stiffness: self.stiffness.step(),
            damping: self.damping.step(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CODES: Codes = Codes {
        position: Scale::around_zero(12.5, 16),
        velocity: Scale::around_zero(45.0, 12),
        torque: Scale::around_zero(18.0, 12),
        stiffness: Scale::from_zero(500.0, 12),
        damping: Scale::from_zero(5.0, 12),
    };

    #[test]
    fn what_the_motor_sums_is_within_the_limit() {
        let mut bits = 1_u64;
        let mut random = |low: f64, high: f64| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
            low + (bits >> 11) as f64 / (1_u64 << 53) as f64 * (high - low)
        };
        for n in 0..100_000 {
            let limit = random(0.5, 10.0);
            let [q, qd] = [random(-12.0, 12.0), random(-40.0, 40.0)];
            let mut setpoint = Setpoint {
                position: random(-12.0, 12.0),
                velocity: random(-40.0, 40.0),
                torque: random(-10.0, 10.0),
                stiffness: random(0.0, 1.0),
                damping: random(0.0, 0.05),
            };
            // as the bridge does: all three shrink alike
            let total = setpoint.torque
                + setpoint.stiffness * (setpoint.position - q)
                + setpoint.damping * (setpoint.velocity - qd);
            let part = (limit / total.abs()).min(1.0);
            setpoint.torque *= part;
            setpoint.stiffness *= part;
            setpoint.damping *= part;
            let [p, v, k, d, t] = CODES.of(&setpoint, limit, Some([q, qd]), n % 2 == 0);
            let k = CODES.stiffness.value(k);
            let d = CODES.damping.value(d);
            assert!(k <= setpoint.stiffness + 1e-9 && d <= setpoint.damping + 1e-9);
            let sum = CODES.torque.value(t)
                + k * (CODES.position.value(p) - q)
                + d * (CODES.velocity.value(v) - qd);
            assert!(sum.abs() <= limit + 1e-6, "{setpoint:?} {q} {qd}: {sum} beyond {limit}");
        }
    }

    #[test]
    fn a_coarse_stiffness_is_never_rounded_up() {
        // half a code and more of 0.122 N m/rad, 10 rad behind
        let setpoint = Setpoint { position: 10.0, stiffness: 0.1, ..Setpoint::default() };
        let [_, _, stiffness, ..] = CODES.of(&setpoint, 1.0, Some([0.0, 0.0]), false);
        assert_eq!(stiffness, 0);
    }
}
