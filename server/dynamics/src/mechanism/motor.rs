//! Limits of an actuator over its speed.

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

    /// Least and greatest force at a speed; at rest those that begin a motion to either side.
    pub(crate) fn forces(&self, speed: f64) -> [f64; 2] {
        let [forwards, backwards] = self.efficiency;
        let driving = self.effort.min(at(&self.driving, speed.abs())).min(self.power / speed.abs());
        let driving = driving * forwards;
        let braking = self.effort.min(at(&self.braking, speed.abs())) / backwards;
        match speed {
            0.0 => [-driving, driving],
            _ if speed < 0.0 => [-driving, braking],
            _ => [-braking, driving],
        }
    }
}

/// A polyline at x; beyond its ends their values, without points infinite.
fn at(line: &[[f64; 2]], x: f64) -> f64 {
    let after = line.partition_point(|point| point[0] < x);
    match (after.checked_sub(1).and_then(|before| line.get(before)), line.get(after)) {
        (Some([x0, y0]), Some([x1, y1])) => y0 + (y1 - y0) * (x - x0) / (x1 - x0),
        (Some([_, y]), None) | (None, Some([_, y])) => *y,
        (None, None) => f64::INFINITY,
    }
}
