//! Rigid-body geometry that places the parts of a random robot.

/// A vector.
pub type Vector = [f64; 3];

/// A pose: maps coordinates of a frame to those of its base.
#[derive(Clone, Copy, Debug)]
pub struct Pose {
    /// Rotation, row by row.
    pub R: [Vector; 3],
    /// Origin.
    pub p: Vector,
}

/// a + s b.
pub fn add(a: Vector, s: f64, b: Vector) -> Vector {
    [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]]
}

/// a · b.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
pub fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|.
pub fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

/// a / |a|.
pub fn unit(a: Vector) -> Vector {
    add([0.0; 3], 1.0 / norm(a), a)
}

impl Pose {
    /// The frame itself.
    pub const IDENTITY: Pose =
        Pose { R: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], p: [0.0; 3] };

    /// Columns of the rotation and the origin.
    pub fn from_columns(x: Vector, y: Vector, z: Vector, p: Vector) -> Pose {
        Pose { R: [[x[0], y[0], z[0]], [x[1], y[1], z[1]], [x[2], y[2], z[2]]], p }
    }

    /// R v.
    pub fn direction(&self, v: Vector) -> Vector {
        [dot(self.R[0], v), dot(self.R[1], v), dot(self.R[2], v)]
    }

    /// R v + p.
    pub fn point(&self, v: Vector) -> Vector {
        add(self.p, 1.0, self.direction(v))
    }

    /// The inverse pose.
    pub fn inverse(&self) -> Pose {
        let column = |k: usize| [self.R[0][k], self.R[1][k], self.R[2][k]];
        let R = [column(0), column(1), column(2)];
        let back = Pose { R, p: [0.0; 3] }.direction(self.p);
        Pose { R, p: add([0.0; 3], -1.0, back) }
    }

    /// self · other.
    pub fn then(&self, other: &Pose) -> Pose {
        let column = |k: usize| self.direction([other.R[0][k], other.R[1][k], other.R[2][k]]);
        Pose::from_columns(column(0), column(1), column(2), self.point(other.p))
    }

    /// From fixed-axis roll, pitch, yaw.
    pub fn from_rpy(rpy: Vector, p: Vector) -> Pose {
        let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(f64::sin_cos);
        let R = [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ];
        Pose { R, p }
    }

    /// Fixed-axis roll, pitch, yaw.
    pub fn rpy(&self) -> Vector {
        let R = &self.R;
        [R[2][1].atan2(R[2][2]), (-R[2][0]).atan2(R[0][0].hypot(R[1][0])), R[1][0].atan2(R[0][0])]
    }
}
