//! Errors of tasks at a pose, as short as the way to their targets, and the targets themselves.

use nalgebra::Vector3;
use sarrus_proto::{Status, TaskParts};

/// Largest deviation of a given quaternion from unit length.
const UNIT: f64 = 1e-6;

/// A target, from its packed numbers.
#[derive(Clone, Copy)]
pub(super) struct Target {
    p: Vector3<f64>,
    quaternion: [f64; 4],
    axis: Vector3<f64>,
    /// Root of the weight.
    pub(super) weight: f64,
}

/// Where a frame is from its target.
#[derive(Clone, Copy)]
pub(super) struct Away {
    /// To the place of the target.
    pub(super) way: Vector3<f64>,
    /// The turn to its orientation, and to the direction of its z axis.
    pub(super) turn: Vector3<f64>,
    pub(super) tilt: Vector3<f64>,
    /// The z axis of the frame.
    pub(super) z: Vector3<f64>,
}

impl Target {
    /// # Errors
    /// [`Status::BadRequest`] for a quaternion or a direction that is none, or a weight that is not
    /// positive.
    pub(super) fn of(parts: TaskParts, numbers: &[f64]) -> Result<Target, Status> {
        let [px, py, pz, x, y, z, w, ax, ay, az, weight] = *numbers else {
            return Err(Status::WrongSize);
        };
        let length = (x * x + y * y + z * z + w * w).sqrt();
        let axis = Vector3::new(ax, ay, az);
        let of_axis = axis.norm();
        let turns = parts.contains(TaskParts::ORIENTATION);
        let tilts = parts.contains(TaskParts::AXIS);
        let is_sound = weight > 0.0
            && (!turns || (length - 1.0).abs() < UNIT)
            && (!tilts || of_axis > f64::MIN_POSITIVE && of_axis.is_finite());
        if !is_sound {
            return Err(Status::BadRequest);
        }
        Ok(Target {
            p: Vector3::new(px, py, pz),
            quaternion: [x, y, z, w].map(|x| x / length),
            axis: axis / of_axis,
            weight: weight.sqrt(),
        })
    }

    /// Where a frame of this pose (position, quaternion) is.
    pub(super) fn away(&self, pose: &[f64; 7]) -> Away {
        let [px, py, pz, x, y, z, w] = *pose;
        let [a, b, c, d] = self.quaternion;
        // target · frame⁻¹
        let v = Vector3::new(a, b, c) * w
            - Vector3::new(x, y, z) * d
            - Vector3::new(a, b, c).cross(&Vector3::new(x, y, z));
        let real = d * w + a * x + b * y + c * z;
        let frame_z =
            Vector3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y));
        Away {
            way: self.p - Vector3::new(px, py, pz),
            turn: turn_of(if real < 0.0 { -v } else { v }, real.abs(), 2.0),
            tilt: tilt_of(&frame_z, &self.axis),
            z: frame_z,
        }
    }
}

impl Away {
    /// The larger one of distance and angle, of the parts of a task.
    pub(super) fn size(&self, parts: TaskParts) -> f64 {
        let of = |part, x: &Vector3<f64>| if parts.contains(part) { x.norm() } else { 0.0 };
        of(TaskParts::POSITION, &self.way)
            .max(of(TaskParts::ORIENTATION, &self.turn))
            .max(of(TaskParts::AXIS, &self.tilt))
    }
}

/// The vector of a turn whose sine vector and cosine these are, of `part` times the angle.
fn turn_of(sine: Vector3<f64>, cosine: f64, part: f64) -> Vector3<f64> {
    let length = sine.norm();
    match length > 0.0 {
        true => sine * (part * length.atan2(cosine) / length),
        false => Vector3::zeros(),
    }
}

/// The shortest turn from one direction to another; about any axis where they are opposite.
fn tilt_of(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let sine = from.cross(to);
    let cosine = from.dot(to);
    if cosine < 0.0 && sine.norm() < 1e-12 {
        let smallest = from.iamin();
        let mut other = Vector3::zeros();
        other[smallest] = 1.0;
        let axis = from.cross(&other);
        return axis * (core::f64::consts::PI / axis.norm());
    }
    turn_of(sine, cosine, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_to_the_target_has_its_axis_and_angle() {
        let half = 0.4_f64;
        let numbers = [0.0, 0.0, 1.0, half.sin(), 0.0, 0.0, half.cos(), 0.0, 1.0, 0.0, 4.0];
        let parts = TaskParts(7);
        let target = Target::of(parts, &numbers).unwrap();
        let away = target.away(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        assert!((away.turn - Vector3::new(0.8, 0.0, 0.0)).norm() < 1e-15);
        // from z to y about −x
        let quarter = core::f64::consts::FRAC_PI_2;
        assert!((away.tilt - Vector3::new(-quarter, 0.0, 0.0)).norm() < 1e-15);
        assert!((away.size(parts) - quarter).abs() < 1e-15 && target.weight == 2.0);
        assert!((away.size(TaskParts::POSITION) - 1.0).abs() < 1e-15);
        // the same orientation by the opposite quaternion, and an opposite direction
        let other = target.away(&[0.0, 0.0, 1.0, -half.sin(), 0.0, 0.0, -half.cos()]);
        assert!(other.turn.norm() < 1e-15 && other.size(TaskParts::POSITION) == 0.0);
        let down = tilt_of(&Vector3::new(0.0, 0.0, 1.0), &Vector3::new(0.0, 0.0, -1.0));
        assert!((down.norm() - core::f64::consts::PI).abs() < 1e-15 && down[2] == 0.0);
        let mut bad = numbers;
        bad[10] = 0.0;
        assert!(Target::of(parts, &bad).is_err());
    }
}
