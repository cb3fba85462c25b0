//! The five codes that MIT mode and CyberGear share, and the state of a motor that has them.
//!
//! Position and velocity become the nearest codes, stiffness and damping those towards zero; a gain
//! below its first code is added to the torque, by the last measurement.
//! The motor sums τ = t + k (p − q) + d (v − q̇) from these codes: the torque is rounded towards
//! zero, and moved by one more code if the sum would exceed the limit.

use super::Common;
use super::number::limited;
use super::scale::Scale;
use super::turns::Turns;
use crate::drive::{Measurement, Mode, Receipt, Setpoint};
use crate::state::state;

/// A motor with coded numbers: its set-points, and its position unwrapped beyond the range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coded {
    pub(super) codes: Codes,
    common: Common,
    turns: Turns,
    /// Last measured position and velocity `[rad, rad/s]`.
    measured: Option<[f64; 2]>,
    odd: bool,
}

impl Coded {
    pub(super) fn new(codes: Codes, common: Common) -> Coded {
        Coded { codes, common, turns: Turns::default(), measured: None, odd: false }
    }

    /// Codes of position, velocity, stiffness, damping and torque, within ± the torque limit at the
    /// last measured position and velocity.
    #[inline]
    pub(super) fn setpoint(&self, setpoint: &Setpoint) -> [u16; 5] {
        let setpoint = match self.common.mode {
            Mode::Torque => Setpoint { torque: setpoint.torque, ..Setpoint::default() },
            _ => *setpoint,
        };
        let Coded { codes, measured, .. } = self;
        let odd = self.odd;
        let limit = self.common.torque_limit;
        let position = codes.position.code(setpoint.position, odd);
        let velocity = codes.velocity.code(setpoint.velocity, odd);
        let (stiffness, k) = codes.stiffness.toward_zero(setpoint.stiffness, odd);
        let (damping, d) = codes.damping.toward_zero(setpoint.damping, odd);
        // torque of spring and damper for these codes, and of gains without one
        let [by_gains, uncoded] = measured.map_or([0.0; 2], |[q, qd]| {
            let behind = codes.position.value(position) - q;
            let slower = codes.velocity.value(velocity) - qd;
            let uncoded = |code: u16, gain: f64| if code == 0 { gain } else { 0.0 };
            [
                k * behind + d * slower,
                uncoded(stiffness, setpoint.stiffness) * behind
                    + uncoded(damping, setpoint.damping) * slower,
            ]
        });
        let least = -limit - by_gains;
        let most = limit - by_gains;
        let torque = limited(setpoint.torque + uncoded, limit).max(least).min(most);
        let torque = codes.torque.within(codes.torque.toward_zero(torque, odd), least, most);
        [position, velocity, stiffness, damping, torque]
    }

    /// A set-point was sent: codes beside zero alternate from one to the next.
    pub(super) fn alternate(&mut self) {
        self.odd = !self.odd;
    }

    /// The measurement in the codes of position, velocity and torque.
    #[inline]
    pub(super) fn measure(&mut self, codes: [u16; 3], temperature: f64) -> Receipt {
        let [position, velocity, torque] = codes;
        let position = self.codes.position.value_at(self.turns.follow(position));
        let velocity = self.codes.velocity.value(velocity);
        self.measured = Some([position, velocity]);
        let torque = self.codes.torque.value(torque);
        Receipt::Measured(Measurement { position, velocity, torque, temperature })
    }

    /// The fault of a position that has no code, or is not known; else 0.
    #[inline]
    pub(super) fn fault(&self) -> u32 {
        self.turns.fault(self.common.mode)
    }

    /// The motor may start counting its turns again.
    pub(super) fn forget(&mut self) {
        self.measured = None;
        self.turns.forget();
    }

    /// The motor's position is its zero from now on.
    pub(super) fn set_zero(&mut self) {
        self.turns = Turns::default();
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Codes {
    position: Scale,
    velocity: Scale,
    torque: Scale,
    stiffness: Scale,
    damping: Scale,
}

impl Codes {
    /// For ranges in the order of [`RANGES`](super::keys::RANGES), of which all but the position's
    /// 16 have this many bits.
    pub(super) const fn new(ranges: [f64; 5], bits: u32) -> Codes {
        let [position, velocity, torque, stiffness, damping] = ranges;
        Codes {
            position: Scale::between(-position, position, 16),
            velocity: Scale::between(-velocity, velocity, bits),
            torque: Scale::between(-torque, torque, bits),
            stiffness: Scale::between(0.0, stiffness, bits),
            damping: Scale::between(0.0, damping, bits),
        }
    }

    /// Ends of the ranges of position, velocity and torque.
    pub(super) fn ranges(&self) -> [f64; 3] {
        [self.position, self.velocity, self.torque].map(|scale| scale.high)
    }

    /// Stiffness and damping at the ends of their ranges.
    pub(super) fn largest_gains(&self) -> [f64; 2] {
        [self.stiffness, self.damping].map(|scale| scale.value(scale.code(f64::INFINITY, false)))
    }

    /// One step of each.
    pub(super) fn steps(&self) -> Setpoint {
        Setpoint {
            position: self.position.step,
            velocity: self.velocity.step,
            torque: self.torque.step,
            stiffness: self.stiffness.step,
            damping: self.damping.step,
        }
    }
}

state!(Coded { turns, measured, odd; codes, common });

#[cfg(test)]
mod tests {
    use super::*;

    const CODES: Codes = Codes::new([12.5, 45.0, 18.0, 500.0, 5.0], 12);

    fn coded(limit: f64, measured: [f64; 2], odd: bool) -> Coded {
        let common = Common {
            mode: Mode::Impedance,
            watchdog_ms: 0,
            torque_limit: limit,
            velocity_limit: f64::INFINITY,
            period_ns: 0,
        };
        Coded { measured: Some(measured), odd, ..Coded::new(CODES, common) }
    }

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
            let [p, v, k, d, t] = coded(limit, [q, qd], n % 2 == 0).setpoint(&setpoint);
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
        let [_, _, stiffness, ..] = coded(1.0, [0.0, 0.0], false).setpoint(&setpoint);
        assert_eq!(stiffness, 0);
    }

    #[test]
    fn gains_below_a_code_are_torques() {
        // 40 kN/m at a screw of 10 mm lead are 0.101 N m/rad, less than a code of 0.122
        for (stiffness, damping) in [(0.101, 0.0), (0.0, 1e-3), (0.121, 1e-3)] {
            for (q, qd) in [(1.0, 0.0), (-2.0, 3.0), (0.5, -20.0)] {
                let setpoint = Setpoint { stiffness, damping, ..Setpoint::default() };
                let [p, v, k, d, t] = coded(18.0, [q, qd], true).setpoint(&setpoint);
                let [k, d] = [CODES.stiffness.value(k), CODES.damping.value(d)];
                let sum = CODES.torque.value(t)
                    + k * (CODES.position.value(p) - q)
                    + d * (CODES.velocity.value(v) - qd);
                let wanted = (-stiffness * q - damping * qd).clamp(-18.0, 18.0);
                // a code of torque, and half a code of position and velocity
                let near = 36.0 / 4095.0 + 2e-4 * stiffness + 0.012 * damping;
                assert!((sum - wanted).abs() < near, "{stiffness} {damping} {q} {qd}: {sum}");
            }
        }
    }
}
