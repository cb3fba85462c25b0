//! Rotations as quaternions x, y, z, w and as roll, pitch, yaw.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// Roll φ, pitch θ and yaw ψ of a quaternion of any length:
///
/// ```text
/// (w + y, x − z) ∝ sin(θ/2 + π/4) (cos, sin)((φ − ψ)/2)
/// (w − y, x + z) ∝ cos(θ/2 + π/4) (cos, sin)((φ + ψ)/2)
/// ```
///
/// Near θ = ±π/2 one of the two pairs vanishes; its angle, then without meaning, changes the
/// rotation by no more than the pair's length. So the rotation is exact to rounding everywhere.
pub(crate) fn rpy([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    let difference = (x - z).atan2(w + y);
    let sum = (x + z).atan2(w - y);
    let pitch = 2.0 * (x - z).hypot(w + y).atan2((x + z).hypot(w - y)) - FRAC_PI_2;
    let turn = |angle: f64| match angle {
        _ if angle > PI => angle - TAU,
        _ if angle < -PI => angle + TAU,
        _ => angle,
    };
    [turn(sum + difference), pitch, turn(sum - difference)]
}

/// The unit quaternion of roll, pitch and yaw.
pub(crate) fn quaternion(rpy: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = rpy.map(|angle| (angle / 2.0).sin_cos());
    [
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    ]
}

/// The rotation `b`, then `a`.
pub(crate) fn product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let [va, vb] = [a, b].map(|[x, y, z, _]| [x, y, z]);
    let [x, y, z] = cross(va, vb);
    [
        a[3] * b[0] + b[3] * a[0] + x,
        a[3] * b[1] + b[3] * a[1] + y,
        a[3] * b[2] + b[3] * a[2] + z,
        a[3] * b[3] - dot(va, vb),
    ]
}

/// A vector, rotated by a unit quaternion.
pub(crate) fn rotated([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let once = cross([x, y, z], v).map(|part| 2.0 * part);
    let twice = cross([x, y, z], once);
    core::array::from_fn(|k| v[k] + w * once[k] + twice[k])
}

/// The shortest rotation that turns the line along `from` into that along `to`, of any lengths but
/// zero; `None` where they are parallel to rounding.
pub(crate) fn between(from: [f64; 3], to: [f64; 3]) -> Option<[f64; 4]> {
    let [a, b] = [from, to].map(|v| v.map(|x| x / dot(v, v).sqrt()));
    let cosine = dot(a, b);
    let sign = if cosine < 0.0 { -1.0 } else { 1.0 };
    let [x, y, z] = cross(a, b).map(|part| part * sign);
    let w = 1.0 + cosine.abs();
    let length = (x * x + y * y + z * z + w * w).sqrt();
    let is_turned = x * x + y * y + z * z > 1e-28;
    is_turned.then_some([x, y, z, w].map(|part| part / length))
}

pub(crate) fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|k| {
        let i = (k + 1) % 3;
        let j = (k + 2) % 3;
        a[i] * b[j] - a[j] * b[i]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As near to the vertical as numbers go, and at it.
    #[test]
    fn a_quaternion_keeps_its_rotation_at_every_pitch() {
        for off in [0.0, 1e-17, 1e-12, 1e-8, 1e-5, 2.8e-3, 0.3, 1.0, 3.0] {
            for sign in [1.0, -1.0] {
                for [roll, yaw] in [[0.0, 0.0], [0.3, -0.7], [2.5, 3.0], [-3.1, 1.0]] {
                    let given = quaternion([roll, sign * (FRAC_PI_2 - off), yaw]);
                    let found = quaternion(rpy(given));
                    for v in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                        let gap = rotated(found, v).into_iter().zip(rotated(given, v));
                        let gap = gap.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                        assert!(gap < 4e-15, "{off} {roll} {yaw}: {gap:e}");
                    }
                }
            }
        }
        assert_eq!(rpy([0.0, 0.0, 0.0, 1.0]), [0.0; 3]);
        assert_eq!(rpy([0.0, 0.0, 0.0, 7.0]), [0.0; 3]);
    }

    #[test]
    fn the_rotation_between_two_lines_turns_one_into_the_other() {
        let [a, b] = [[1.0, 2.0, -0.5], [0.3, 0.1, 4.0]];
        for sign in [1.0, -1.0] {
            let turn = between(a, b.map(|x| sign * x)).unwrap_or_default();
            let [x, y, z] = cross(rotated(turn, a), b);
            assert!(x.hypot(y).hypot(z) < 1e-14);
        }
        assert_eq!(between(a, a.map(|x| -3.0 * x)), None);
        // roll, then yaw
        let both = product(quaternion([0.0, 0.0, 0.4]), quaternion([0.3, 0.0, 0.0]));
        let gap = rpy(both).into_iter().zip([0.3, 0.0, 0.4]).map(|(x, y)| (x - y).abs());
        assert!(gap.fold(0.0, f64::max) < 1e-15);
    }
}
