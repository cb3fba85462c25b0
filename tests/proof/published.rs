//! Mechanisms with published numbers or with a closed form that is written here by itself: closures at 1e-14 by size, accelerations at 1e-11.

use std::f64::consts::FRAC_PI_2;

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Compiled, Field, FieldSet, Request, Wanted};
use sarrus_models::{Options, Source, load};
use sarrus_tests::compare::assert_close;
use sarrus_tests::run::Robot;
use sarrus_tests::seed::Seeded;

use Field::*;

fn compiled(source: &Source) -> Compiled {
    load(source, &Options::default()).unwrap_or_else(|error| panic!("{error}")).compiled
}

fn bundled(name: &str) -> Compiled {
    compiled(&Source::Bundled(name.into()))
}

fn link(robot: &Robot<f64>, name: &str) -> u16 {
    robot.model.link_names().iter().position(|link| link == name).unwrap() as u16
}

/// Position of the origin of a link, and its orientation x, y, z, w, at y.
fn pose(robot: &mut Robot<f64>, name: &str, y: &[f64]) -> [f64; 7] {
    let wanted = Wanted::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[FramePose])).with_frames(&[link(robot, name)]);
    let answer = robot.ask_for(wanted, &[(Y, y)]).ok();
    std::array::from_fn(|i| answer.get(FramePose)[i])
}

/// y, then q2, q3, G2, G3, g2, g3 at ẏ = 1.
const LAMBDA: [[f64; 7]; 3] = [
    [0.3, 0.43084815391883554, 0.25825016245922332, 1.4011611160212772, 0.047619494691353104, -0.33233541130650645, 0.14516018426959063],
    [
        FRAC_PI_2,
        1.873598506960771,
        0.38236587360798819,
        0.91107910510309498,
        0.10883261889282429,
        -0.2340105049560769,
        -0.030976977164060605,
    ],
    [-1.1, -1.4136800210589492, 0.32932031931445793, 1.0541745729816897, -0.11261557039417324, 0.37901509244370808, 0.018807304726899158],
];

#[test]
fn the_lambda_stands_where_its_table_says() {
    // the table measures from the base line, the robot from its zero pose
    let zero = [0.803719823174243, 1.0833785823281756, 0.29739].map(Dd::from_f64);
    let compiled = bundled("lambda");
    for row in LAMBDA {
        let y = Dd::from_f64(row[0]) - zero[0];
        let want = [Q, G, GBias];
        let exact = Robot::new(compiled.exact.clone()).ask(Request::Kinematics, &[(Y, &[y]), (Yd, &[Dd::ONE])], &want).ok();
        let double = Robot::new(compiled.model.clone()).ask(Request::Kinematics, &[(Y, &[y.hi()]), (Yd, &[1.0])], &want).ok();
        for (what, state) in [("exact", exact.map(Dd::hi)), ("double", double)] {
            let q = [state.get(Q)[1] + zero[1].hi(), state.get(Q)[2] + zero[2].hi()];
            assert_close(&format!("{what} q at {}", row[0]), &q, &row[1..3], 1.0, 1e-15);
            assert_close(&format!("{what} G at {}", row[0]), &state.get(G)[1..], &row[3..5], 1.0, 1e-15);
            assert_close(&format!("{what} g at {}", row[0]), &state.get(GBias)[1..], &row[5..7], 1.0, 1e-15);
        }
    }
}

/// N four-bars in a row, upright at zero.
fn four_bars(n: usize) -> Source {
    let inertial = |x: f64, z: f64| {
        let [ixx, izz] = [z, x].map(|length| if length > 0.0 { 1.0 / 12.0 } else { 0.0 });
        format!(
            "<inertial><origin xyz=\"{x} 0 {z}\"/><mass value=\"1\"/><inertia ixx=\"{ixx}\" ixy=\"0\" ixz=\"0\" iyy=\"{}\" iyz=\"0\" izz=\"{izz}\"/></inertial>",
            1.0 / 12.0
        )
    };
    let joint = |name: &str, parent: &str, child: &str, x: usize, z: usize| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/><origin xyz=\"{x} 0 {z}\"/><axis xyz=\"0 -1 0\"/></joint>\n"
        )
    };
    let (mut urdf, mut names, mut loops) = ("<robot name=\"r\"><link name=\"ground\"/>\n".to_owned(), Vec::new(), String::new());
    for i in 0..=n {
        urdf += &format!(
            "<link name=\"crank{i}\">{}</link>{}",
            inertial(0.0, 0.5),
            joint(&format!("A{i}"), "ground", &format!("crank{i}"), i, 0)
        );
        names.push(format!("A{i}"));
        if i < n {
            let (parent, child) = (format!("crank{i}"), format!("coupler{i}"));
            urdf += &format!("<link name=\"{child}\">{}</link>{}", inertial(0.5, 0.0), joint(&format!("B{i}"), &parent, &child, 0, 1));
            names.push(format!("B{i}"));
            loops += &format!(
                "  - {{cut_joint: C{i}, predecessor_body: {child}, successor_body: crank{}, predecessor_placement: {{xyz: [1, 0, 0]}}, successor_placement: {{xyz: [0, 0, 1]}}, cut_joint_type: planar_revolute, axis: [0, 1, 0]}}\n",
                i + 1
            );
        }
    }
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: r\n  jointnames_spanningtree: [{}]\n  jointnames_independent: [A0]\n  jointnames_active: [A0]\n  loop_constraints:\n{loops}",
        names.join(", ")
    );
    Source::Text { urdf: (urdf + "</robot>").into_bytes(), submechanisms: Some(yaml.into_bytes()) }
}

#[test]
fn four_bars_in_a_row_fall_as_one_pendulum() {
    for (n, source) in [(2, Source::Bundled("four_bars_2".into())), (2, four_bars(2)), (7, four_bars(7)), (40, four_bars(40))] {
        let mut robot = Robot::new(compiled(&source).model);
        assert_eq!((robot.model.sizes().n_v, robot.model.sizes().n_c), (2 * n + 1, 2 * n));
        for (y, yd) in [(0.0, -1.0), (0.7, 2.0), (-1.2, 0.5), (1.5, -3.0)] {
            let q = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).ok();
            // every crank turns as the first, every coupler stays level
            let expected: Vec<f64> = (0..2 * n + 1).map(|k| if k % 2 == 0 { y } else { -y }).collect();
            assert_close(&format!("{n} four-bars, q at {y}"), q.get(Q), &expected, 1.0, 1e-14);
            let fall = robot.ask(Request::ForwardDynamics, &[(Y, &[y]), (Yd, &[yd]), (TauU, &[0.0])], &[Ydd]).ok();
            let count = n as f64;
            let angle = FRAC_PI_2 + y;
            let expected = -((count + 1.0) / 2.0 + count) * 9.81 * angle.cos() / ((count + 1.0) / 3.0 + count);
            assert_close(&format!("{n} four-bars, ÿ at {y}"), fall.get(Ydd), &[expected], 1.0, 1e-11);
        }
    }
}

/// β, Θ, γ, Φ, δ, Ω, ε of the squeezing mechanism at the start.
const SQUEEZER: [f64; 7] = [
    -0.0617138900142764496,
    0.0,
    0.455279819163070380,
    0.222668390165885885,
    0.487364979543842550,
    -0.222668390165885885,
    1.23054744454982119,
];

/// How far the six published equations are from zero.
fn squeezer_gaps(q: &[f64]) -> [f64; 6] {
    let a: [f64; 7] = std::array::from_fn(|i| q[i] + SQUEEZER[i]);
    let [beta, theta, gamma, phi, delta, omega, epsilon] = a;
    let [xa, ya, xb, yb] = [-0.06934, -0.00227, -0.03635, 0.03273];
    let [d, e, rr, ss, u, zf, zt] = [0.028, 0.02, 0.007, 0.035, 0.04, 0.02, 0.04];
    let pin = [rr * beta.cos() - d * (beta + theta).cos(), rr * beta.sin() - d * (beta + theta).sin()];
    [
        pin[0] - ss * gamma.sin() - xb,
        pin[1] + ss * gamma.cos() - yb,
        pin[0] - e * (phi + delta).sin() - zt * delta.cos() - xa,
        pin[1] + e * (phi + delta).cos() - zt * delta.sin() - ya,
        pin[0] - zf * (omega + epsilon).cos() - u * epsilon.sin() - xa,
        pin[1] - zf * (omega + epsilon).sin() + u * epsilon.cos() - ya,
    ]
}

/// The spring's wrench on K3 at the origin of K3 {world axes}, at q.
fn squeezer_spring(q: &[f64]) -> [f64; 6] {
    let (s, c) = (q[2] + SQUEEZER[2]).sin_cos();
    let [xb, yb, xc, yc, sc, sd] = [-0.03635, 0.03273, 0.014, 0.072, 0.018, 0.02];
    let arm = [sd * c + sc * s, sd * s - sc * c];
    let out = [xb + arm[0] - xc, yb + arm[1] - yc];
    let length = out[0].hypot(out[1]);
    let force = out.map(|x| -4530.0 * (length - 0.07785) * x / length);
    [0.0, 0.0, arm[0] * force[1] - arm[1] * force[0], force[0], force[1], 0.0]
}

#[test]
fn the_squeezer_closes_and_starts_as_published() {
    let mut robot = Robot::new(bundled("squeezer").model);
    let zero = robot.ask(Request::Kinematics, &[(Y, &[0.0])], &[Q]).ok();
    assert_close("q(0)", zero.get(Q), &[0.0; 7], 1.0, 1e-14);
    for k in 0..20 {
        let y = 0.6 * Seeded::new(k).numbers(1, 1.0)[0];
        let at = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).ok();
        // the mechanism is a few centimetres large
        assert_close(&format!("loops at β − β0 = {y}"), &squeezer_gaps(at.get(Q)), &[0.0; 6], 0.04, 1e-14);
    }
    let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::EMPTY, FieldSet::of(&[Qdd])).with_wrenches(&[link(&robot, "K3")]);
    let given: [(Field, &[f64]); 4] = [(Y, &[0.0]), (Yd, &[0.0]), (TauU, &[0.033]), (Wrenches, &squeezer_spring(&[0.0; 7]))];
    let start = robot.ask_for(wanted, &given).ok();
    // the loops' own rounding, 1e-17 m, is 1e-15 of the smallest crank
    let published = [14222.4439199541387, -10666.8329399655854, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_close("q̈(0)", start.get(Qdd), &published, 1.0, 1e-11);
}

/// A robot of one freedom under way: y, ẏ and its tree coordinates.
#[derive(Default)]
struct Motion {
    y: f64,
    yd: f64,
    q: Vec<f64>,
}

impl Motion {
    /// One step of Runge and Kutta's method; `force` gives ÿ from y, ẏ and a guess of q.
    fn step(&mut self, robot: &mut Robot<f64>, step: f64, force: impl Fn(&mut Robot<f64>, f64, f64, &[f64]) -> f64) {
        let mut rate = |y: f64, yd: f64| (yd, force(robot, y, yd, &self.q));
        let (y, yd) = (self.y, self.yd);
        let a = rate(y, yd);
        let b = rate(y + 0.5 * step * a.0, yd + 0.5 * step * a.1);
        let c = rate(y + 0.5 * step * b.0, yd + 0.5 * step * b.1);
        let d = rate(y + step * c.0, yd + step * c.1);
        let mean = |a: f64, b: f64, c: f64, d: f64| step * (a + 2.0 * (b + c) + d) / 6.0;
        (self.y, self.yd) = (y + mean(a.0, b.0, c.0, d.0), yd + mean(a.1, b.1, c.1, d.1));
        self.q = closed(robot, self.y, &self.q);
    }
}

/// q at y on the branch of a guess.
fn closed(robot: &mut Robot<f64>, y: f64, guess: &[f64]) -> Vec<f64> {
    robot.ask(Request::Kinematics, &[(Y, &[y]), (QGuess, guess)], &[Q]).ok().get(Q).to_vec()
}

#[test]
fn the_squeezer_arrives_as_published() {
    let mut robot = Robot::new(bundled("squeezer").model);
    let on = [link(&robot, "K3")];
    let mut motion = Motion { q: vec![0.0; 7], ..Motion::default() };
    for _ in 0..3000 {
        motion.step(&mut robot, 0.03 / 3000.0, |robot, y, yd, guess| {
            let q = closed(robot, y, guess);
            let wanted = Wanted::new(Request::ForwardDynamics, FieldSet::EMPTY, FieldSet::of(&[Ydd])).with_wrenches(&on);
            let given: [(Field, &[f64]); 5] = [(Y, &[y]), (Yd, &[yd]), (TauU, &[0.033]), (QGuess, &q), (Wrenches, &squeezer_spring(&q))];
            robot.ask_for(wanted, &given).ok().get(Ydd)[0]
        });
    }
    let q: Vec<f64> = motion.q.iter().zip(SQUEEZER).map(|(q, start)| q + start).collect();
    let published = [
        15.81077119629904,
        -15.75637105984298,
        0.04082224013073101,
        -0.5347301163226948,
        0.5244099658805304,
        0.5347301163226948,
        1.048080741042263,
    ];
    // the published solution is good to 1e-9
    assert_close("q(0.03)", &q, &published, 1.0, 1e-9);
    assert_close("v(0.03)", &[motion.yd], &[1139.920302151208], 1.0, 1e-9);
}

#[test]
fn bricards_mechanism_moves_and_falls_as_published() {
    let compiled = bundled("bricard");
    let closure = &compiled.model.closures()[0];
    assert_eq!((closure.rows, closure.rank, compiled.model.sizes().n_vy), (5, 4, 1));
    let mut robot = Robot::new(compiled.model);
    let mut motion = Motion { q: vec![0.0; 5], ..Motion::default() };
    let p3 = [link(&robot, "rod3")];
    for (seconds, published) in
        [(0.5, [0.968283679107, -1.224625159436, 0.750146609438]), (1.0, [0.510501461187, -1.649167599395, 0.140123114553])]
    {
        for _ in 0..400 {
            motion.step(&mut robot, 0.5 / 400.0, |robot, y, yd, guess| {
                let given: [(Field, &[f64]); 4] = [(Y, &[y]), (Yd, &[yd]), (TauU, &[0.0]), (QGuess, guess)];
                robot.ask(Request::ForwardDynamics, &given, &[Ydd]).ok().get(Ydd)[0]
            });
        }
        let wanted = Wanted::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(&[FramePose])).with_frames(&p3);
        let state = robot.ask_for(wanted, &[(Y, &[motion.y]), (QGuess, &motion.q)]).ok();
        // published with y up
        let [x, north, up] = [0, 1, 2].map(|i| state.get(FramePose)[i]);
        // twelve decimals were published
        assert_close(&format!("P3({seconds})"), &[x, up, -north], &published, 1.0, 1e-12);
    }
}

#[test]
fn the_delta_stands_where_three_spheres_meet() {
    let mut robot = Robot::new(bundled("delta").model);
    let tree = robot.model.tree_names().to_vec();
    let index = |name: &str| tree.iter().position(|x| x == name).unwrap();
    for k in 0..20 {
        let y = Seeded::new(k).numbers(3, 0.5);
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok();
        // the elbows, moved inwards by the platform's radius, are the centres of spheres of the rods' length
        let centre = |leg: usize| {
            let (s, c) = (leg as f64 * std::f64::consts::TAU / 3.0).sin_cos();
            let out = 0.15 + 0.2 * y[leg].cos() - 0.05;
            [out * c, out * s, -0.2 * y[leg].sin()]
        };
        let p = lower_meeting([centre(0), centre(1), centre(2)], 0.5);
        let ours = ["x", "y", "z"].map(|axis| state.get(Q)[index(&format!("platform_{axis}"))]);
        assert_close(&format!("platform at {y:?}"), &[ours[0], ours[1], ours[2] - 0.4], &p, 1.0, 1e-14);
        let turns = ["rx", "ry", "rz"].map(|axis| state.get(Q)[index(&format!("platform_{axis}"))]);
        assert_close(&format!("orientation at {y:?}"), &turns, &[0.0; 3], 1.0, 1e-14);
    }
}

/// The lower of the two points at this distance from three others.
fn lower_meeting(c: [[f64; 3]; 3], radius: f64) -> [f64; 3] {
    let minus = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| a[i] - b[i]) };
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let (a, b) = (minus(c[1], c[0]), minus(c[2], c[0]));
    let n = cross(a, b);
    // the centre of the circle through the three, from the first of them
    let along = minus(b.map(|x| x * dot(a, a)), a.map(|x| x * dot(b, b)));
    let middle = cross(along, n).map(|x| x / (2.0 * dot(n, n)));
    let height = ((radius * radius - dot(middle, middle)) / dot(n, n)).sqrt();
    std::array::from_fn(|i| c[0][i] + middle[i] - n[i] * height * n[2].signum())
}

#[test]
fn the_five_bar_stands_where_two_circles_meet() {
    let mut robot = Robot::new(bundled("five_bar").model);
    for k in 0..20 {
        let y = Seeded::new(k).numbers(2, 0.4);
        let left = pose(&mut robot, "left_rod", &y);
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok();
        // the cranks at zero stand 3 to 4 outwards
        let elbow = |side: f64, y: f64| {
            let (s, c) = y.sin_cos();
            let [x, z] = [side * 0.09, -0.12];
            [side * 0.08 + c * x + s * z, c * z - s * x]
        };
        let (a, b) = (elbow(-1.0, y[0]), elbow(1.0, y[1]));
        assert_close("elbow", &[left[0], left[2]], &a, 1.0, 1e-14);
        let [dx, dz] = [b[0] - a[0], b[1] - a[1]];
        let square = dx * dx + dz * dz;
        let height = (0.0625 / square - 0.25).sqrt();
        let pin = [a[0] + 0.5 * dx + height * dz, a[1] + 0.5 * dz - height * dx];
        // the left rod's turn in all is that of its crank and its own
        let turn = state.get(Q)[0] + state.get(Q)[1] + 0.17_f64.atan2(-(0.25_f64 * 0.25 - 0.17 * 0.17).sqrt());
        let ours = [a[0] + 0.25 * turn.sin(), a[1] + 0.25 * turn.cos()];
        assert_close(&format!("pin at {y:?}"), &ours, &pin, 1.0, 1e-14);
    }
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
        // it moves by the second order of the turn
        let moved = foot[..3].iter().map(|x| x * x).sum::<f64>().sqrt();
        let size = y.iter().map(|x| x * x).sum::<f64>();
        assert!(moved < 0.12 * size, "the foot moves {moved} m at {y:?}");
    }
}

/// A point of a frame, from position and quaternion.
fn point_of(frame: &[f64; 7], x: [f64; 3]) -> [f64; 3] {
    let [px, py, pz, qx, qy, qz, w] = *frame;
    let cross = |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let v = [qx, qy, qz];
    let t = cross(v, x).map(|x| 2.0 * x);
    let u = cross(v, t);
    [px + x[0] + w * t[0] + u[0], py + x[1] + w * t[1] + u[1], pz + x[2] + w * t[2] + u[2]]
}

/// A body on six joints, with a seventh above them for the weld, and one cut of this kind between it and the base.
fn cut_body(cut: &str, independent: &str) -> Source {
    const BODY: &str = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
    let joints = [("s", "0.6 0 0.8"), ("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1"), ("rx", "1 0 0"), ("ry", "0 1 0"), ("rz", "0 0 1")];
    let skipped = usize::from(!cut.contains("weld"));
    let (mut urdf, mut parent, mut names) = ("<robot name=\"r\"><link name=\"base\"/>\n".to_owned(), "base".to_owned(), Vec::new());
    for (name, axis) in &joints[skipped..] {
        let child = if *name == "rz" { "body".to_owned() } else { format!("{name}_link") };
        let kind = if name.len() == 1 && *name != "s" { "prismatic" } else { "revolute" };
        urdf += &format!(
            "<link name=\"{child}\">{BODY}</link><joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/><axis xyz=\"{axis}\"/><limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>\n"
        );
        parent = child;
        names.push(*name);
    }
    let yaml = format!(
        "submechanisms:\n- type: NUMERICAL\n  contextual_name: r\n  jointnames_spanningtree: [{}]\n  jointnames_independent: [{independent}]\n  jointnames_active: [{independent}]\n  loop_constraints:\n  - cut_joint: c\n    predecessor_body: base\n    successor_body: body\n    predecessor_placement: {{xyz: [{XYZ}], rpy: [{RPY}]}}\n    successor_placement: {{xyz: [{XYZ}], rpy: [{RPY}]}}\n    cut_joint_type: {cut}\n",
        names.join(", ")
    );
    Source::Text { urdf: (urdf + "</robot>").into_bytes(), submechanisms: Some(yaml.into_bytes()) }
}

const XYZ: &str = "0.3, -0.2, 0.4";
const RPY: &str = "0.5, -0.3, 0.8";
const AXIS: [f64; 3] = [0.36, 0.48, -0.8];
const AXIS2: [f64; 3] = [0.8, -0.6, 0.0];

/// Rz(yaw) Ry(pitch) Rx(roll) x of the cut frames, or its inverse.
fn cut_frame(x: [f64; 3], inverse: bool) -> [f64; 3] {
    let mut turns = [(1, 2, 0.5), (2, 0, -0.3), (0, 1, 0.8)];
    if inverse {
        turns.reverse();
    }
    turns.into_iter().fold(x, |mut x, (i, j, angle)| {
        let (s, c) = f64::sin_cos(if inverse { -angle } else { angle });
        (x[i], x[j]) = (c * x[i] - s * x[j], s * x[i] + c * x[j]);
        x
    })
}

#[test]
fn a_cut_by_name_leaves_exactly_the_motions_of_its_joint_at_finite_angles() {
    let one = format!("\n    axis: {AXIS:?}");
    let two = format!("{one}\n    axis2: {AXIS2:?}");
    // what stays where it was: the origin in all directions or across the axis, all turns or the axis, the two axes of a universal joint
    for (kind, axes, independent, point, line, turn, axis, cross) in [
        ("spherical", "", "rx, ry, rz", true, true, false, false, false),
        ("planar_revolute", &one, "z, rx, ry, rz", false, true, false, false, false),
        ("revolute", &one, "rz", true, true, false, true, false),
        ("cylindrical", &one, "z, rz", false, true, false, true, false),
        ("prismatic", &one, "z", false, true, true, true, false),
        ("universal", &two, "rx, ry", true, true, false, false, true),
        ("weld", "", "s", true, true, true, true, false),
    ] {
        let mut robot = Robot::new(compiled(&cut_body(&format!("{kind}{axes}"), independent)).model);
        for k in 0..20 {
            let y = Seeded::new(k).numbers(robot.model.sizes().n_vy, 0.7);
            let body = pose(&mut robot, "body", &y);
            // the motion of the successor's cut frame, seen from the predecessor's
            let moved = |x: [f64; 3]| {
                let out = cut_frame(x, false);
                let there = point_of(&body, std::array::from_fn(|i| out[i] + [0.3, -0.2, 0.4][i]));
                cut_frame(std::array::from_fn(|i| there[i] - [0.3, -0.2, 0.4][i]), true)
            };
            let origin = moved([0.0; 3]);
            let turned = |x: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| moved(x)[i] - origin[i]) };
            let along: f64 = (0..3).map(|i| AXIS[i] * origin[i]).sum();
            let what = |which: &str| format!("{kind} at {y:?}: {which}");
            if point {
                assert_close(&what("point"), &origin, &[0.0; 3], 1.0, 1e-14);
            }
            if line {
                assert_close(&what("line"), &origin, &AXIS.map(|x| x * along), 1.0, 1e-14);
            }
            if turn {
                assert_close(&what("turn"), &turned(AXIS2), &AXIS2, 1.0, 1e-14);
            }
            if axis {
                assert_close(&what("axis"), &turned(AXIS), &AXIS, 1.0, 1e-14);
            }
            if cross {
                let second = turned(AXIS2);
                let cosine: f64 = (0..3).map(|i| AXIS[i] * second[i]).sum();
                assert_close(&what("cross"), &[cosine], &[0.0], 1.0, 1e-14);
            }
        }
    }
}
