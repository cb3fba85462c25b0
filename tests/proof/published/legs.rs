//! Legs: the halves of Cassie are mirror images, motors of Digit by circles and spheres from the
//! points of its source.

use sarrus_models::Base;
use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::*;

#[test]
fn the_legs_of_cassie_are_mirror_images_and_each_is_the_leg_alone() {
    let [mut whole, mut alone] =
        ["cassie", "cassie_leg"].map(|name| Robot::new(bundled(name).model));
    // hip roll and hip yaw turn the other way
    let signs = [-1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0];
    let mut seeded = Seeded::new(5);
    for _ in 0..20 {
        let [y, yd, ydd] = [0.25, 1.0, 4.0].map(|size| seeded.numbers(7, size));
        let both = |x: &[f64]| -> Vec<f64> {
            x.iter().copied().chain(x.iter().zip(signs).map(|(x, sign)| sign * x)).collect()
        };
        let want = [Q, TauU, MY];
        let given = [(Y, y.clone()), (Yd, yd), (Ydd, ydd)];
        let own = given.each_ref().map(|(field, x)| (*field, x.as_slice()));
        let own = alone.ask(Request::InverseDynamics, &own, &want).ok();
        let given = given.each_ref().map(|(field, x)| (*field, both(x)));
        let given = given.each_ref().map(|(field, x)| (*field, x.as_slice()));
        let found = whole.ask(Request::InverseDynamics, &given, &want).ok();
        let [q, tau] = [Q, TauU].map(|field| found.get(field));
        assert_close("the left leg", &q[..12], own.get(Q), 1.0, 1e-13);
        assert_close("its motors", &tau[..5], own.get(TauU), 1.0, 1e-12);
        let of_right: Vec<f64> = tau[5..].iter().zip(signs).map(|(x, sign)| sign * x).collect();
        assert_close("motors of the right leg", &of_right, own.get(TauU), 1.0, 1e-12);
        let mass = |i: usize, k: usize| found.get(MY)[14 * i + k];
        for (i, k) in (0..7).flat_map(|i| (0..7).map(move |k| (i, k))) {
            let sign = signs[i] * signs[k];
            let [left, right] = [mass(i, k), sign * mass(i + 7, k + 7)];
            assert_close("inertia", &[left, right], &[own.get(MY)[7 * i + k]; 2], 1.0, 1e-12);
            assert_eq!(mass(i, k + 7), 0.0, "a held pelvis keeps the legs apart");
        }
        // points of the feet, whose z is the hinge's, mirrored in the plane of x and z
        for x in [[0.1, 0.2, 0.05], [-0.3, 0.0, 0.1]] {
            let [left, right] = [("left_foot", x), ("right_foot", [x[0], x[1], -x[2]])]
                .map(|(foot, x)| point_of(&pose(&mut whole, foot, &both(&y)), x));
            assert_close("a foot", &right, &[left[0], -left[1], left[2]], 1.0, 1e-13);
        }
    }
}

#[test]
fn cassie_weighs_what_its_source_says_on_a_free_pelvis() {
    let options = Options { base: Base::Floating, ..Options::default() };
    let loaded = load(&Source::Bundled("cassie".into()), &options).unwrap();
    let mut robot = Robot::new(loaded.compiled.model);
    let sizes = robot.model.sizes();
    assert_eq!((sizes.n_v, sizes.n_vy, sizes.n_u, sizes.n_c), (30, 20, 10, 10));
    let y: Vec<f64> = [0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0].into_iter().chain([0.0; 14]).collect();
    let found = robot.ask(Request::InverseDynamics, &[(Y, &y)], &[MY, Com, TauY]).ok();
    let legs =
        [1.82, 1.171, 5.52, 0.1567, 0.7578, 0.186, 0.577, 0.782, 0.126, 0.1261, 0.1186, 0.1498];
    // a cross of a gram stands for each ball joint
    let mass = 10.33 + 2.0 * (legs.iter().sum::<f64>() + 0.001);
    for k in 3..6 {
        assert_close("mass", &[found.get(MY)[21 * k]], &[mass], 1.0, 1e-13);
    }
    assert_close("weight", &found.get(TauY)[3..6], &[0.0, 0.0, 9.81 * mass], 1.0, 1e-12);
    // symmetric legs leave the pelvis' own offset
    assert_close("centre of mass", &[found.get(Com)[1]], &[10.33 * 0.000346 / mass], 1.0, 1e-15);
}

/// A joint's coordinate.
fn joint(robot: &Robot<f64>, q: &[f64], name: &str) -> f64 {
    q[robot.model.tree_names().iter().position(|joint| joint == name).unwrap()]
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| a[i] - b[i])
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    core::array::from_fn(|i| a[i] + b[i])
}

fn length(a: [f64; 3]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A point turned about x, y or z (0, 1, 2).
fn turned(axis: usize, angle: f64, x: [f64; 3]) -> [f64; 3] {
    let [i, k] = [(axis + 1) % 3, (axis + 2) % 3];
    let mut y = x;
    y[i] = angle.cos() * x[i] - angle.sin() * x[k];
    y[k] = angle.sin() * x[i] + angle.cos() * x[k];
    y
}

/// The angles about z at which an arm's tip is at a distance from a point.
fn swings(arm: [f64; 3], point: [f64; 3], distance: f64) -> [f64; 2] {
    let a = arm[0] * point[0] + arm[1] * point[1];
    let b = arm[0] * point[1] - arm[1] * point[0];
    let square = |x: [f64; 3]| x.iter().map(|x| x * x).sum::<f64>();
    let c = (square(arm) + square(point) - distance * distance) / 2.0 - arm[2] * point[2];
    let across = (a * a + b * b - c * c).sqrt();
    [1.0, -1.0].map(|side| b.atan2(a) + (side * across).atan2(c))
}

/// The angle that is nearest to zero.
fn near(angles: [f64; 2]) -> f64 {
    let turn = core::f64::consts::TAU;
    let [a, b] = angles.map(|x| x - turn * (x / turn).round());
    if a.abs() < b.abs() { a } else { b }
}

/// The way of Digit's source from tarsus to motor, the tip of the crank, the point on the foot.
struct Toe {
    motor: [f64; 3],
    is_turned: bool,
    ball: [f64; 3],
}

impl Toe {
    /// A point of the tarsus in the frame of the motor.
    fn seen(&self, x: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = turned(2, 88.96_f64.to_radians(), minus(x, self.motor));
        if self.is_turned { [x, -y, -z] } else { [x, y, z] }
    }

    /// The rod's ball in the frame of the motor.
    fn end(&self, pitch: f64, roll: f64) -> [f64; 3] {
        let on_cross = turned(1, core::f64::consts::FRAC_PI_2, turned(2, roll, self.ball));
        let on_tarsus = turned(2, 71.75_f64.to_radians() + pitch, on_cross);
        self.seen(plus([0.408, -0.04, 0.0], on_tarsus))
    }
}

#[test]
fn the_motors_of_digits_toes_are_where_circles_meet_spheres() {
    let mut robot = Robot::new(bundled("digit_tarsus").model);
    let toes = [(-0.0276, true, 0.059, 0.0179), (0.0276, false, 0.111, -0.0181)];
    let toes = toes.map(|(z, is_turned, x, ball)| Toe {
        motor: [x, -0.034, z],
        is_turned,
        ball: [ball, -0.009551, -0.054164],
    });
    let crank = [0.057, 0.0, -0.008];
    let rods = toes.each_ref().map(|toe| length(minus(toe.end(0.0, 0.0), crank)));
    assert_close("rods", &rods, &[0.340095, 0.288098], 1.0, 1e-6);
    for k in 0..40 {
        let k = f64::from(k);
        let [pitch, roll] = [-0.1 + 0.6 * k.sin(), 0.5 * (1.7 * k).cos()];
        let y = [0.0, 0.0, 0.0, pitch, roll];
        let q = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok().get(Q).to_vec();
        let expected: [f64; 2] =
            core::array::from_fn(|i| near(swings(crank, toes[i].end(pitch, roll), rods[i])));
        let found = ["toe_a_joint", "toe_b_joint"].map(|name| joint(&robot, &q, name));
        assert_close(&format!("motors at {pitch} {roll}"), &found, &expected, 1.0, 1e-13);
    }
}

#[test]
fn the_tarsus_of_digit_is_where_a_circle_meets_the_sphere_of_the_achilles_rod() {
    let mut robot = Robot::new(bundled("digit_tarsus").model);
    let degrees = f64::to_radians;
    // the rod's ball on the thigh as the shin sees it, from the tarsus' axis
    let thigh = |knee: f64, shin: f64| {
        let on_knee =
            turned(2, degrees(90.0) - knee, minus([0.0, 0.0, 0.046], [0.12, 0.0, 0.0045]));
        let on_shin = turned(2, -shin, minus(on_knee, [0.060677, 0.047406, 0.0]));
        minus(on_shin, [0.434759, 0.02, 0.0])
    };
    // its other ball on the tarsus
    let heel = |spring: f64| {
        let ball = turned(2, degrees(155.8) + spring, [0.113789, -0.011056, 0.0]);
        let on_tarsus = turned(0, degrees(4.47), turned(1, degrees(0.32), ball));
        turned(2, degrees(103.0), plus([-0.01766, -0.029456, 0.00104], on_tarsus))
    };
    let rod = length(minus(thigh(0.0, 0.0), heel(0.0)));
    assert_close("the Achilles rod", &[rod], &[0.501194], 1.0, 1e-6);
    for k in 0..40 {
        let k = f64::from(k);
        let [knee, shin] = [-0.2 + 0.9 * k.sin(), 0.1 * (1.3 * k).cos()];
        let y = [knee, shin, 0.1 * (0.7 * k).sin(), 0.0, 0.0];
        let q = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok().get(Q).to_vec();
        let angles = swings(heel(y[2]), thigh(knee, shin), rod);
        // of the two the one on the way from zero, where the tarsus turns back as the knee turns
        let expected = near(angles.map(|x| x + knee)) - knee;
        let found = joint(&robot, &q, "tarsus_joint");
        assert_close(&format!("tarsus at {y:?}"), &[found], &[expected], 1.0, 1e-13);
        // springs at rest
        let y = [knee.clamp(-0.8, 0.8), 0.0, 0.0, 0.0, 0.0];
        let q = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q]).ok().get(Q).to_vec();
        assert!((joint(&robot, &q, "tarsus_joint") + y[0]).abs() < 4e-4, "{q:?}");
    }
}
