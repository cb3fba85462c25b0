//! Origins: a translation with roll, pitch and yaw, or with a quaternion.

use core::f64::consts::FRAC_PI_2;

use roxmltree::Node;
use sarrus_dynamics::description::Placement;

use super::xml::{Reader, Shape};

const ORIGIN: Shape = Shape::of(&["xyz", "rpy", "quat_xyzw"]);

/// Deviations of a quaternion's length from 1: that of rounding, and that of a coarse file.
const ROUNDED: f64 = 1e-6;
const COARSE: f64 = 1e-3;

/// Reads an origin, of a joint or of an inertial; `None` after an error.
pub(super) fn origin<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Placement> {
    reader.children(node, &ORIGIN);
    let placement = placement(reader, node);
    if !node.has_attribute("quat_xyzw") {
        return placement;
    }
    let quaternion = reader.numbers::<4>(node, "quat_xyzw")?;
    let span = reader.span(node);
    if !reader.version.has_quaternions() {
        let found = "`quat_xyzw` in a file of version 1.0";
        let help = "write version=\"1.1\" on `robot` or use `rpy`";
        reader.diagnostics.error(span, found, "`rpy`", help);
        return None;
    }
    if node.has_attribute("rpy") {
        let found = "`origin` has both `rpy` and `quat_xyzw`";
        reader.diagnostics.error(span, found, "one of them", "remove the other");
    }
    let rpy = turned(reader, node, quaternion)?;
    placement.map(|placement| Placement { rpy, ..placement })
}

/// `xyz` and `rpy` of an element, zero without; `None` after an error.
pub(super) fn placement<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Placement> {
    let [xyz, rpy] = ["xyz", "rpy"].map(|name| match node.has_attribute(name) {
        true => reader.numbers::<3>(node, name),
        false => Some([0.0; 3]),
    });
    Some(Placement { xyz: xyz?, rpy: rpy? })
}

/// Roll, pitch and yaw of a quaternion x, y, z, w near unit length; `None` after an error.
pub(super) fn turned<'t>(
    reader: &mut Reader<'t, '_>,
    node: Node<'_, 't>,
    quaternion: [f64; 4],
) -> Option<[f64; 3]> {
    let length = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    let span = reader.span(node);
    let found = format!("the quaternion of `{}` has the length {length}", node.tag_name().name());
    if (length - 1.0).abs() >= COARSE {
        reader.diagnostics.error(span, found, "1", "normalise it");
        return None;
    }
    if (length - 1.0).abs() > ROUNDED {
        let help = "write more digits; it is read as a direction, normalised";
        reader.diagnostics.warning(span, found, "1", help);
    }
    Some(rpy(quaternion))
}

/// Roll φ, pitch θ and yaw ψ of a quaternion of any length:
///
/// ```text
/// (w + y, x − z) ∝ sin(θ/2 + π/4) (cos, sin)((φ − ψ)/2)
/// (w − y, x + z) ∝ cos(θ/2 + π/4) (cos, sin)((φ + ψ)/2)
/// ```
///
/// Near θ = ±π/2 one of the two pairs vanishes; its angle, then without meaning, changes the
/// rotation by no more than the pair's length. So the rotation is exact to rounding everywhere.
fn rpy([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    let difference = (x - z).atan2(w + y);
    let sum = (x + z).atan2(w - y);
    let pitch = 2.0 * (x - z).hypot(w + y).atan2((x + z).hypot(w - y)) - FRAC_PI_2;
    let turn = |angle: f64| {
        use core::f64::consts::{PI, TAU};
        if angle > PI {
            angle - TAU
        } else if angle < -PI {
            angle + TAU
        } else {
            angle
        }
    };
    [turn(sum + difference), pitch, turn(sum - difference)]
}

#[cfg(test)]
mod tests {
    use super::rpy;

    /// Columns of the rotation matrix of a unit quaternion.
    fn of_quaternion([x, y, z, w]: [f64; 4]) -> [[f64; 3]; 3] {
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    }

    fn of_rpy([roll, pitch, yaw]: [f64; 3]) -> [[f64; 3]; 3] {
        let (sr, cr) = roll.sin_cos();
        let (sp, cp) = pitch.sin_cos();
        let (sy, cy) = yaw.sin_cos();
        [
            [cy * cp, sy * cp, -sp],
            [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr],
            [cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr],
        ]
    }

    /// As near to the vertical as numbers go, and at it.
    #[test]
    fn a_quaternion_keeps_its_rotation_at_every_pitch() {
        for pitch_off in [0.0, 1e-17, 1e-12, 1e-8, 1e-5, 2.8e-3, 0.3, 1.0, 3.0] {
            for sign in [1.0, -1.0] {
                for [roll, yaw] in [[0.0, 0.0], [0.3, -0.7], [2.5, 3.0], [-3.1, 1.0]] {
                    let pitch: f64 = sign * (core::f64::consts::FRAC_PI_2 - pitch_off);
                    let half = |angle: f64| (angle / 2.0).sin_cos();
                    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
                    let quaternion = [
                        sr * cp * cy - cr * sp * sy,
                        cr * sp * cy + sr * cp * sy,
                        cr * cp * sy - sr * sp * cy,
                        cr * cp * cy + sr * sp * sy,
                    ];
                    let found = of_rpy(rpy(quaternion));
                    let expected = of_quaternion(quaternion);
                    let gaps = found.iter().flatten().zip(expected.iter().flatten());
                    let gap = gaps.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(gap < 4e-15, "{pitch} {roll} {yaw}: {gap:e}");
                }
            }
        }
        assert_eq!(rpy([0.0, 0.0, 0.0, 1.0]), [0.0; 3]);
        assert_eq!(rpy([0.0, 0.0, 0.0, 7.0]), [0.0; 3]);
    }
}
