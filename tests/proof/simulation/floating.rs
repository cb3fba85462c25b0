//! Robots with quaternions among their independents.

use sarrus_dynamics::{Field, FieldSet, Query, Request};
use sarrus_tests::compare::assert_close;

use super::orders::order;
use super::*;

/// A body in free flight with an arm of two joints and a ball joint.
pub(super) fn satellite(gravity: f64) -> Robot {
    let link = |name: &str, mass: f64, at: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"{at}\" rpy=\"0.1 0.2 0.3\"/><mass \
             value=\"{mass}\"/><inertia ixx=\"0.04\" ixy=\"0.001\" ixz=\"0\" iyy=\"0.05\" \
             iyz=\"0.002\" izz=\"0.06\"/></inertial></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, at: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child \
             link=\"{child}\"/><origin xyz=\"{at}\"/><axis xyz=\"{axis}\"/><limit lower=\"-9\" \
             upper=\"9\" effort=\"1\" velocity=\"9\"/></joint>"
        )
    };
    let urdf = [
        "<robot name=\"satellite\"><link name=\"world\"/>".to_owned(),
        link("body", 4.0, "0 0 0.1"),
        link("upper", 1.0, "0.1 0 0"),
        link("lower", 0.7, "0 0.1 0"),
        link("dish", 0.5, "0 0 0.2"),
        joint("base", "floating", "world", "body", "0 0 0", "0 0 1"),
        joint("shoulder", "revolute", "body", "upper", "0.2 0 0", "0 1 0"),
        joint("elbow", "revolute", "upper", "lower", "0.3 0 0", "1 0 0.5"),
        joint("ball", "spherical", "body", "dish", "-0.2 0 0", "0 0 1"),
        "</robot>".to_owned(),
    ];
    let bytes = urdf.concat().into_bytes();
    Robot::of(
        &sarrus_models::Source::Text { urdf: bytes, submechanisms: None },
        [0.0, 0.0, gravity],
    )
}

/// Linear momentum, and angular momentum about the root.
fn momentum(robot: &Robot, sample: &sarrus_simulation::Sample) -> [f64; 6] {
    let links: Vec<u16> = (0..robot.loaded.description.links.len() as u16).collect();
    let query = Query::new(
        Request::Kinematics,
        FieldSet::EMPTY,
        FieldSet::of(&[Field::FramePose, Field::FrameTwist]),
    )
    .with_frames(&links);
    let mut asked = sarrus_tests::run::Robot::new(robot.loaded.compiled.model.clone());
    let frames = asked.ask_for(query, &[(Field::Y, &sample.y), (Field::Yd, &sample.yd)]).ok();
    let mut sum = [0.0; 6];
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let poses = frames.get(Field::FramePose).chunks(7).zip(frames.get(Field::FrameTwist).chunks(6));
    for ((pose, twist), link) in poses.zip(&robot.loaded.description.links) {
        let Some(inertial) = &link.inertial else { continue };
        let quaternion = &pose[3..7];
        let arm = crate::derivatives::turned(quaternion, &inertial.origin.xyz);
        let w = [twist[0], twist[1], twist[2]];
        let spin = cross(w, arm);
        let force: [f64; 3] = std::array::from_fn(|k| inertial.mass * (twist[3 + k] + spin[k]));
        let at: [f64; 3] = std::array::from_fn(|k| pose[k] + arm[k]);
        // I ω in the axes of the inertia, rotated back
        let R = sarrus_tests::rigid::Pose::from_rpy(inertial.origin.rpy, [0.0; 3]).R;
        let back = [-quaternion[0], -quaternion[1], -quaternion[2], quaternion[3]];
        let in_link = crate::derivatives::turned(&back, &w);
        let [xx, xy, xz, yy, yz, zz] = inertial.inertia;
        let I = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let inside: [f64; 3] = std::array::from_fn(|k| (0..3).map(|i| R[i][k] * in_link[i]).sum());
        let turned: [f64; 3] = std::array::from_fn(|k| (0..3).map(|j| I[k][j] * inside[j]).sum());
        let out: [f64; 3] = std::array::from_fn(|i| (0..3).map(|k| R[i][k] * turned[k]).sum());
        let moment = crate::derivatives::turned(quaternion, &out);
        let orbit = cross(at, force);
        for k in 0..3 {
            sum[k] += force[k];
            sum[3 + k] += moment[k] + orbit[k];
        }
    }
    sum
}

/// A start in which everything turns and moves.
fn spinning(robot: &Robot) -> Start {
    let names = robot.loaded.compiled.model.independent_names();
    assert_eq!(names.len(), 11, "{names:?}");
    let yd: Vec<f64> =
        (0..11).map(|k| 0.4 + 0.3 * f64::from(k % 4) - 0.2 * f64::from(k % 3)).collect();
    let mut y = vec![0.0; 13];
    let place = |part: &str| {
        robot
            .loaded
            .compiled
            .model
            .independent_q_names()
            .iter()
            .position(|name| name == part)
            .unwrap()
    };
    for (joint, turn) in [("base", [0.5, -0.1, 0.1, 0.7]), ("ball", [0.1, 0.7, 0.5, -0.5])] {
        let length = turn.iter().map(|x| x * x).sum::<f64>().sqrt();
        for (part, x) in ["qx", "qy", "qz", "qw"].iter().zip(turn) {
            y[place(&format!("{joint}/{part}"))] = x / length;
        }
    }
    y[place("shoulder")] = 0.4;
    from(&y, &yd)
}

#[test]
fn methods_converge_with_their_order_on_a_floating_base() {
    let mut robot = satellite(-9.81);
    robot.spring(("world", [1.0, 0.0, 2.0]), ("lower", [0.0, 0.2, 0.0]), [30.0, 0.5, 0.5]);
    let start = spinning(&robot);
    for (method, expected, steps) in [
        (Method::Euler, 1.0, [4e-3, 2e-3, 1.25e-4]),
        (Method::RungeKutta, 4.0, [2e-2, 1e-2, 1.25e-3]),
    ] {
        let found = order(&robot, &start, method, steps, 0.4);
        println!("{} {found}", method.name());
        assert!((found - expected).abs() < 0.25, "{} converges with order {found}", method.name());
    }
}

#[test]
fn without_gravity_momentum_stays_and_quaternions_keep_their_length() {
    let robot = satellite(0.0);
    let start = spinning(&robot);
    for (settings, allowed) in [
        (fixed(Method::RungeKutta, 2e-3, 5.0), 1e-9),
        (adaptive(Method::Dop853, 1e-11, 5.0), 1e-9),
        (adaptive(Method::Radau5, 1e-9, 5.0), 1e-7),
        (fixed(Method::Euler, 1e-3, 5.0), 1e-1),
    ] {
        let run = robot.run(&start, &settings);
        let end = arrived(&run);
        let [before, after] = [&run.samples[0], end].map(|sample| momentum(&robot, sample));
        println!(
            "{} {before:?} {after:?} drift {:e} {:?}",
            settings.method.name(),
            run.drift(),
            run.counts
        );
        assert_close(settings.method.name(), &after, &before, 1.0, allowed);
        assert!(run.drift() < allowed, "drift {:e}", run.drift());
        for (k, name) in robot.loaded.compiled.model.independent_q_names().iter().enumerate() {
            if name.ends_with("/qx") {
                let length = end.y[k..k + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
                assert!((length - 1.0).abs() < 1e-14, "{length}");
            }
        }
    }
}

#[test]
fn every_method_arrives_at_the_same_state_of_a_floating_robot() {
    let robot = satellite(-9.81);
    let start = spinning(&robot);
    let reference = robot.run(&start, &fixed(Method::RungeKutta, 2e-4, 0.5));
    for method in [Method::Dop853, Method::Radau5] {
        let run = robot.run(&start, &adaptive(method, 1e-11, 0.5));
        assert_close(method.name(), &arrived(&run).y, &arrived(&reference).y, 1.0, 1e-9);
        assert_close(method.name(), &arrived(&run).yd, &arrived(&reference).yd, 1.0, 1e-8);
    }
}
