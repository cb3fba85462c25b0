//! Limits of an actuator over its speed.

use crate::scalar::Real;

/// Limits of one actuator; infinite where it has none.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    /// Largest force of either direction, and largest speed.
    pub(crate) effort: f64,
    pub(crate) velocity: f64,
    /// Largest force over speed, (speed, force) by ascending speed with straight lines between:
    /// along the motion and against it; empty where `effort` alone limits it.
    pub(crate) driving: Vec<[f64; 2]>,
    pub(crate) braking: Vec<[f64; 2]>,
    /// Largest mechanical power given; infinite without a limit.
    pub(crate) power: f64,
    /// Parts of the power that pass the gear, of the motor's and of the joint's.
    pub(crate) efficiency: [f64; 2],
}

impl Motor {
    pub(crate) fn has_effort(&self) -> bool {
        0.0 < self.effort && self.effort < f64::INFINITY
    }

    pub(crate) fn has_velocity(&self) -> bool {
        0.0 < self.velocity && self.velocity < f64::INFINITY
    }

    /// True where the largest force depends on the speed.
    pub(crate) fn has_curve(&self) -> bool {
        let has_points = !self.driving.is_empty() || !self.braking.is_empty();
        has_points || self.power.is_finite() || self.efficiency != [1.0; 2]
    }

    /// Least and greatest force at a speed; at rest those that begin a motion to either side.
    pub(crate) fn forces<T: Real>(&self, speed: T) -> [T; 2] {
        let [forwards, backwards] = self.efficiency.map(T::from_f64);
        let mut driving = self.at(&self.driving, speed.abs());
        if self.power.is_finite() {
            let of_power = T::from_f64(self.power) / speed.abs();
            driving = T::select_lt(of_power, driving, of_power, driving);
        }
        let driving = driving * forwards;
        let braking = self.at(&self.braking, speed.abs()) / backwards;
        let lower = T::select_lt(T::ZERO, speed, braking, driving);
        [-lower, T::select_lt(speed, T::ZERO, braking, driving)]
    }

    /// A polyline at x, but no more than `effort`; beyond its ends their values.
    fn at<T: Real>(&self, line: &[[f64; 2]], x: T) -> T {
        let effort = T::from_f64(self.effort);
        let (Some([_, first]), Some([end, last])) = (line.first(), line.last()) else {
            return effort;
        };
        let mut y = T::from_f64(*first);
        for ends in line.windows(2) {
            let [[x0, y0], [x1, y1]] = [ends[0], ends[1]].map(|point| point.map(T::from_f64));
            y = T::select_lt(x0, x, y0 + (y1 - y0) * (x - x0) / (x1 - x0), y);
        }
        y = T::select_lt(T::from_f64(*end), x, T::from_f64(*last), y);
        T::select_lt(y, effort, y, effort)
    }
}
