//! Platforms: delta, active ankle, and the Stewart platform that floats.

use sarrus_models::bundled_text;
use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

#[test]
fn the_delta_stands_where_three_spheres_meet() {
    let mut robot = Robot::new(bundled("delta").model);
    let tree = robot.model.tree_names().to_vec();
    let index = |name: &str| tree.iter().position(|x| x == name).unwrap();
    for k in 0..20 {
        let y = Seeded::new(k).numbers(3, 0.5);
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok();
        // the elbows, moved inwards by the platform's radius, are the centres of spheres with the
        // rods' length as radius
        let centre = |leg: usize| {
            let angle = leg as f64 * std::f64::consts::TAU / 3.0;
            let (s, c) = angle.sin_cos();
            let out = 0.15 + 0.2 * y[leg].cos() - 0.05;
            [out * c, out * s, -0.2 * y[leg].sin()]
        };
        let p = lower_meeting([centre(0), centre(1), centre(2)], 0.5);
        let ours = ["x", "y", "z"].map(|axis| state.get(Q)[index(&format!("platform_{axis}"))]);
        assert_close(
            &format!("platform at {y:?}"),
            &[ours[0], ours[1], ours[2] - 0.4],
            &p,
            1.0,
            1e-14,
        );
        let turns = ["rx", "ry", "rz"].map(|axis| state.get(Q)[index(&format!("platform_{axis}"))]);
        assert_close(&format!("orientation at {y:?}"), &turns, &[0.0; 3], 1.0, 1e-14);
    }
}

/// The lower of the two points at this distance from three others.
fn lower_meeting(c: [[f64; 3]; 3], radius: f64) -> [f64; 3] {
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let a = minus(c[1], c[0]);
    let b = minus(c[2], c[0]);
    let n = cross(a, b);
    // the centre of the circle through the three, from the first of them
    let along = minus(b.map(|x| x * dot(a, a)), a.map(|x| x * dot(b, b)));
    let middle = cross(along, n).map(|x| x / (2.0 * dot(n, n)));
    let height = ((radius * radius - dot(middle, middle)) / dot(n, n)).sqrt();
    std::array::from_fn(|i| c[0][i] + middle[i] - n[i] * height * n[2].signum())
}

#[test]
fn the_rods_of_the_active_ankle_keep_their_length_and_it_turns_almost_about_a_point() {
    let mut robot = Robot::new(bundled("active_ankle").model);
    for k in 0..20 {
        let y = Seeded::new(k).numbers(3, 0.3);
        let foot = pose(&mut robot, "foot", &y);
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let crank = pose(&mut robot, &format!("crank_{name}"), &y);
            let mut out = [0.0; 3];
            for side in [0.035, -0.035] {
                out[(axis + 1) % 3] = side;
                let [a, b] = [point_of(&foot, out), point_of(&crank, out)];
                let length = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
                assert_close(&format!("rod of {name} at {y:?}"), &[length], &[0.12], 0.12, 1e-14);
            }
        }
        // the foot moves by the second order of the turn
        let moved = foot[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = y.iter().map(|x| x * x).sum::<f64>();
        assert!(moved < 0.12 * size, "the foot moves {moved} m at {y:?}");
    }
}

/// A platform on six joints and a floating one move alike and need the same forces.
#[test]
fn a_floating_platform_needs_the_forces_of_the_one_on_six_joints() {
    let (urdf, submechanisms) = bundled_text("stewart").unwrap();
    // the bodies between the six joints become massless: the floating platform has none
    let weight = "<mass value=\"0.001\"/><inertia ixx=\"1e-06\" ixy=\"0\" ixz=\"0\" iyy=\"1e-06\" \
        iyz=\"0\" izz=\"1e-06\"/>";
    let nothing =
        "<mass value=\"0\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>";
    assert_eq!(urdf.matches(weight).count(), 5);
    let source = Source::Text {
        urdf: urdf.replace(weight, nothing).into(),
        submechanisms: Some(submechanisms.into()),
    };
    let mut six = Robot::new(compiled(&source).model);
    let mut one = Robot::new(bundled("stewart_floating").model);
    let sizes = one.model.sizes();
    assert_eq!(
        (sizes.n_q, sizes.n_v, sizes.n_qy, sizes.n_vy, sizes.n_u, sizes.n_c),
        (25, 24, 7, 6, 6, 18)
    );
    let platform = [link(&six, "HipRotZ_Link")];
    for k in 0..20 {
        let mut seeded = Seeded::new(k);
        let y: Vec<f64> =
            (0..6).map(|i| seeded.within(-1.0, 1.0) * if i < 3 { 0.05 } else { 0.2 }).collect();
        let yd = seeded.numbers(6, 1.0);
        let ydd = seeded.numbers(6, 5.0);
        let motion: [(Field, &[f64]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
        let query = FieldSet::of(&[U, Ud, Udd, FramePose, FrameTwist, FrameAcc]);
        let state = six
            .ask_for(
                Query::new(Request::Kinematics, FieldSet::EMPTY, query).with_frames(&platform),
                &motion,
            )
            .ok();
        let forces = six.ask(Request::InverseDynamics, &motion, &[TauU]).ok();

        // pose, twist and acceleration of the platform, in its own axes
        let pose: [f64; 7] = std::array::from_fn(|i| state.get(FramePose)[i]);
        let back = [0.0, 0.0, 0.0, -pose[3], -pose[4], -pose[5], pose[6]];
        let body = |x: &[f64]| point_of(&back, [x[0], x[1], x[2]]);
        let twist = state.get(FrameTwist);
        let acc = state.get(FrameAcc);
        let w = body(&twist[..3]);
        let v = body(&twist[3..]);
        let alpha = body(&acc[..3]);
        let a = body(&acc[3..]);
        let wv = cross(w, v);
        let at = [pose[0], pose[1], pose[2] - 0.45, pose[3], pose[4], pose[5], pose[6]];
        let rate = [w, v].concat();
        let second = [alpha, std::array::from_fn(|i| a[i] - wv[i])].concat();
        let motion: [(Field, &[f64]); 3] = [(Y, &at), (Yd, &rate), (Ydd, &second)];
        let floating = one.ask(Request::Kinematics, &motion, &[U, Ud, Udd]).ok();
        for (field, name) in [(U, "u"), (Ud, "u̇"), (Udd, "ü")] {
            assert_close(
                &format!("{name} of {k}"),
                floating.get(field),
                state.get(field),
                1.0,
                1e-13,
            );
        }
        let same = one.ask(Request::InverseDynamics, &motion, &[TauU]).ok();
        assert_close(&format!("τ_u of {k}"), same.get(TauU), forces.get(TauU), 0.0, 1e-12);
        let given: [(Field, &[f64]); 3] = [(Y, &at), (Yd, &rate), (TauU, forces.get(TauU))];
        let back = one.ask(Request::ForwardDynamics, &given, &[Ydd]).ok();
        assert_close(&format!("ÿ of {k}"), back.get(Ydd), &second, 1.0, 1e-11);
    }
}
