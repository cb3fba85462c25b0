//! Poses of links and gaps of loops, computed from a description without any code of the kernels
//! that it checks.

use sarrus_dynamics::description::{Cut, Description, Joint, JointKind, Placement};

type Matrix = [[f64; 3]; 3];

/// Rotation and translation {root}.
#[derive(Clone, Copy, Debug)]
struct Pose {
    turn: Matrix,
    at: [f64; 3],
}

/// The largest misfit of all rows of all loops, in radians and in parts of `length`; q by joint.
/// None where a joint has more than one freedom.
pub(crate) fn open_by(of: &Description, q: &[(String, f64)], length: f64) -> Option<f64> {
    let poses = poses(of, q)?;
    let mut open: f64 = 0.0;
    for cut in of.submechanisms.iter().flat_map(|part| &part.loops) {
        let Cut::Placed { predecessor, successor } = &cut.cut else { return None };
        let on = |link: usize, place: &Placement| after(&poses[link], &placed(place));
        let [p, s] = [on(cut.predecessor, predecessor), on(cut.successor, successor)];
        let back = transposed(&p.turn);
        let turn = log(&times(&back, &s.turn));
        let apart = apply(&back, std::array::from_fn(|k| s.at[k] - p.at[k]));
        for row in &cut.rows {
            let [a, l]: [[f64; 3]; 2] =
                [std::array::from_fn(|k| row.axis[k]), std::array::from_fn(|k| row.axis[k + 3])];
            let phi = match row.against {
                Some(b) => dot(a, apply(&times(&back, &s.turn), b)),
                None => dot(a, turn) + dot(l, apart) / length,
            };
            open = open.max(phi.abs());
        }
    }
    Some(open)
}

fn poses(of: &Description, q: &[(String, f64)]) -> Option<Vec<Pose>> {
    let still = Pose { turn: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], at: [0.0; 3] };
    let mut poses = vec![None; of.links.len()];
    let root = (0..of.links.len()).find(|link| of.joints.iter().all(|j| j.child != *link))?;
    poses[root] = Some(still);
    // joints may have any order
    for _ in 0..of.joints.len() {
        for joint in &of.joints {
            if let (Some(parent), None) = (poses[joint.parent], poses[joint.child]) {
                let moved = motion(joint, q)?;
                poses[joint.child] = Some(after(&after(&parent, &placed(&joint.origin)), &moved));
            }
        }
    }
    poses.into_iter().collect()
}

fn motion(joint: &Joint, q: &[(String, f64)]) -> Option<Pose> {
    let x = q.iter().find(|(name, _)| *name == joint.name).map_or(0.0, |(_, x)| *x);
    let size = dot(joint.axis, joint.axis).sqrt();
    let axis = joint.axis.map(|a| a / size);
    let (turn, way) = match joint.kind {
        JointKind::Fixed => (0.0, 0.0),
        JointKind::Revolute | JointKind::Continuous => (x, 0.0),
        JointKind::Prismatic => (0.0, x),
        _ => return None,
    };
    Some(Pose { turn: rotation(axis, turn), at: axis.map(|a| a * way) })
}

fn placed(place: &Placement) -> Pose {
    let [roll, pitch, yaw] = place.rpy;
    let turn = times(
        &rotation([0.0, 0.0, 1.0], yaw),
        &times(&rotation([0.0, 1.0, 0.0], pitch), &rotation([1.0, 0.0, 0.0], roll)),
    );
    Pose { turn, at: place.xyz }
}

/// Rodrigues' formula.
fn rotation([x, y, z]: [f64; 3], angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    let v = 1.0 - c;
    [
        [x * x * v + c, x * y * v - z * s, x * z * v + y * s],
        [x * y * v + z * s, y * y * v + c, y * z * v - x * s],
        [x * z * v - y * s, y * z * v + x * s, z * z * v + c],
    ]
}

/// The vector of a rotation; turns below π.
fn log(r: &Matrix) -> [f64; 3] {
    let axis = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]].map(|x| 0.5 * x);
    let sine = dot(axis, axis).sqrt();
    let cosine = 0.5 * (r[0][0] + r[1][1] + r[2][2] - 1.0);
    let angle = f64::atan2(sine, cosine);
    axis.map(|x| if sine > 0.0 { x * angle / sine } else { x })
}

fn after(a: &Pose, b: &Pose) -> Pose {
    let shifted = apply(&a.turn, b.at);
    Pose { turn: times(&a.turn, &b.turn), at: std::array::from_fn(|k| a.at[k] + shifted[k]) }
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn apply(a: &Matrix, v: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| dot(a[i], v))
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
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
