//! Poses of links and gaps of loops, computed from a description without any code of the kernels
//! that it checks.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use sarrus_dynamics::description::{Cut, Description, Joint, JointKind, Placement};

/// The largest misfit of all rows of all loops, in radians and in parts of `length`; q by joint.
/// None where a joint has more than one freedom.
pub(crate) fn open_by(of: &Description, q: &[(String, f64)], length: f64) -> Option<f64> {
    let poses = poses(of, q)?;
    let mut open: f64 = 0.0;
    for cut in of.submechanisms.iter().flat_map(|part| &part.loops) {
        let Cut::Placed { predecessor, successor } = &cut.cut else { return None };
        let on = |link: usize, place: &Placement| poses[link] * placed(place);
        let gap = on(cut.predecessor, predecessor).inv_mul(&on(cut.successor, successor));
        let turn = gap.rotation.scaled_axis();
        for row in &cut.rows {
            let [a, l] = [&row.axis[..3], &row.axis[3..]].map(Vector3::from_column_slice);
            let phi = match row.against {
                Some(b) => a.dot(&(gap.rotation * Vector3::from(b))),
                None => a.dot(&turn) + l.dot(&gap.translation.vector) / length,
            };
            open = open.max(phi.abs());
        }
    }
    Some(open)
}

/// Poses of all links {root}.
fn poses(of: &Description, q: &[(String, f64)]) -> Option<Vec<Isometry3<f64>>> {
    let mut poses = vec![None; of.links.len()];
    let root = (0..of.links.len()).find(|link| of.joints.iter().all(|j| j.child != *link))?;
    poses[root] = Some(Isometry3::identity());
    // joints may have any order
    for _ in 0..of.joints.len() {
        for joint in &of.joints {
            if let (Some(parent), None) = (poses[joint.parent], poses[joint.child]) {
                poses[joint.child] = Some(parent * placed(&joint.origin) * motion(joint, q)?);
            }
        }
    }
    poses.into_iter().collect()
}

fn motion(joint: &Joint, q: &[(String, f64)]) -> Option<Isometry3<f64>> {
    let x = q.iter().find(|(name, _)| *name == joint.name).map_or(0.0, |(_, x)| *x);
    let axis = Vector3::from(joint.axis).normalize();
    match joint.kind {
        JointKind::Fixed => Some(Isometry3::identity()),
        JointKind::Revolute | JointKind::Continuous => Some(Isometry3::rotation(axis * x)),
        JointKind::Prismatic => Some(Translation3::from(axis * x).into()),
        _ => None,
    }
}

fn placed(place: &Placement) -> Isometry3<f64> {
    let [roll, pitch, yaw] = place.rpy;
    let turn = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(place.xyz), turn)
}

#[cfg(test)]
mod tests {
    use sarrus_dynamics::description::SubmechanismKind as Kind;
    use sarrus_dynamics::{Field, Status};

    use super::*;
    use crate::stress::harness::{Question, Robot, State, bundled, numerical};
    use crate::stress::mechanisms::{LOOSE, bricard, four_bar};

    #[test]
    fn a_pose_that_the_library_closes_is_closed_and_one_off_it_is_open() {
        for of in [
            four_bar(LOOSE, Kind::Numerical, "xyzabc").expect("bars"),
            four_bar(LOOSE, Kind::FourBar, "xy").expect("bars"),
            bricard(true).expect("a cube"),
            numerical(bundled("five_bar").expect("a robot")),
        ] {
            let robot = Robot::new("robot", of).expect("a model");
            let state = State::of(&robot, 0.2).expect("a state");
            let answer = Question::pose(&state).run(&robot.compiled.model).expect("a plan");
            assert_eq!(answer.status(), Status::Ok);
            let names = robot.compiled.model.tree_q_names().iter().cloned();
            let mut q: Vec<_> = names.zip(answer.get(Field::Q).iter().copied()).collect();
            let Some(open) = open_by(&robot.description, &q, robot.length) else { continue };
            assert!(open < 1e-14, "{open}");
            q[1].1 += 1e-3;
            let open = open_by(&robot.description, &q, robot.length).expect("revolute joints");
            assert!(open > 1e-4, "{open}");
        }
    }
}
