//! Moves from rest to rest.

/// A move from rest to rest, by the part of its way.
pub(super) struct Move {
    pub(super) begin_ns: u64,
    pub(super) seconds: f64,
    pub(super) is_smooth: bool,
}

impl Move {
    /// Greatest speed and acceleration of a move of one second and one radian.
    pub(super) fn greatest(is_smooth: bool) -> [f64; 2] {
        if is_smooth { [1.875, 5.78] } else { [2.0, 4.0] }
    }

    /// Part of the way, its velocity and its acceleration.
    pub(super) fn at(&self, now_ns: u64) -> [f64; 3] {
        let t = self.seconds;
        let x = ((now_ns - self.begin_ns) as f64 * 1e-9 / t).min(1.0);
        let [part, speed, acceleration] = if self.is_smooth {
            [
                x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x),
                30.0 * x * x * (1.0 - x).powi(2),
                60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
            ]
        } else if x < 0.5 {
            [2.0 * x * x, 4.0 * x, 4.0]
        } else {
            [1.0 - 2.0 * (1.0 - x).powi(2), 4.0 * (1.0 - x), if x < 1.0 { -4.0 } else { 0.0 }]
        };
        [part, speed / t, acceleration / (t * t)]
    }

    pub(super) fn is_over(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.begin_ns) as f64 * 1e-9 >= self.seconds
    }
}
