//! Legs: the halves of Cassie are mirror images, motors of Digit and Kangaroo by circles and
//! spheres from the points of their sources.

use sarrus_models::Base;
use sarrus_tests::compare::assert_close;
use sarrus_tests::seed::Seeded;

use super::linkages::meet;
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

// Points of Kangaroo's leg at zero [m]: x, y and z, or x and z in the plane of the leg.
const YAW: [f64; 3] = [-0.015, 0.08, 0.0];
const YAW_MOTOR: [f64; 3] = [-0.115113, 0.098831, 0.0];
const YAW_PIN: [f64; 3] = [-0.026026, 0.118451, 0.0];
const HIP: [f64; 3] = [0.0, 0.08, -0.17725];
const HIP_MOTORS: [[f64; 3]; 2] = [[0.0475, 0.115, -0.0846], [0.0475, 0.045, -0.0846]];
const HIP_BALLS: [[f64; 3]; 2] = [[0.06, 0.115, -0.17725], [0.06, 0.045, -0.17725]];
const THIGH: [f64; 2] = [0.0, -0.26725];
const BAR1: [f64; 2] = [-0.089372, -0.194878];
const TRIANGLE: [f64; 2] = [-0.039392, -0.274193];
const TRIANGLE_PIN: [f64; 2] = [-0.078127, -0.284173];
const BAR2: [f64; 2] = [-0.085142, -0.351698];
const KNEE: [f64; 2] = [0.268682, -0.535968];
const SHIN_PIN: [f64; 2] = [0.222931, -0.613471];
const NUT: [f64; 2] = [0.137294, -0.416264];
const ANKLE: [f64; 3] = [-0.002606, 0.1469, -0.802056];
const ROD: [f64; 3] = [0.212277, 0.1899, -0.515515];
const FOOT_BALL: [f64; 3] = [-0.058987, 0.1819, -0.781534];
const BUTTERFLY_PIN: [f64; 2] = [0.222766, -0.57459];
const BAR: [f64; 2] = [-0.045919, -0.305869];
const MOTOR: [f64; 2] = [-0.075084, -0.2239];
const SLIDER: [f64; 2] = [-0.028647, -0.287358];

/// The way from b to a in the plane of the leg.
fn way(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

fn span(a: [f64; 2], b: [f64; 2]) -> f64 {
    let [x, z] = way(a, b);
    x.hypot(z)
}

/// A point of a body that turns about y: the centre at zero and now, the angle.
fn carried(from: [f64; 2], to: [f64; 2], angle: f64, point: [f64; 2]) -> [f64; 2] {
    let [x, z] = way(point, from);
    [to[0] + angle.cos() * x + angle.sin() * z, to[1] - angle.sin() * x + angle.cos() * z]
}

/// Where the pin of two bars is whose other ends moved from a and b; the side is that of zero.
fn pin(at_zero: [[f64; 2]; 3], a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    let [a0, b0, pin] = at_zero;
    let [[ux, uz], [vx, vz]] = [way(b0, a0), way(pin, a0)];
    meet((a, span(pin, a0)), (b, span(pin, b0)), (ux * vz - uz * vx).signum())
}

/// The angle about y from one direction to another.
fn angle(from: [f64; 2], to: [f64; 2]) -> f64 {
    (from[1] * to[0] - from[0] * to[1]).atan2(from[0] * to[0] + from[1] * to[1])
}

/// Knee, triangle and nut of Kangaroo's leg at the thigh's angle.
fn leg(thigh: f64) -> [f64; 3] {
    let of_thigh = |point| carried(THIGH, THIGH, thigh, point);
    let triangle = of_thigh(TRIANGLE);
    let knee = of_thigh(KNEE);
    let short = pin([TRIANGLE, BAR1, TRIANGLE_PIN], triangle, BAR1);
    let turn = angle(way(TRIANGLE_PIN, TRIANGLE), way(short, triangle));
    let long = carried(TRIANGLE, triangle, turn, BAR2);
    let on_shin = pin([BAR2, KNEE, SHIN_PIN], long, knee);
    let shin = angle(way(SHIN_PIN, KNEE), way(on_shin, knee));
    // the pin as the thigh sees it, and the nut on its line
    let [x, z] = way(carried(THIGH, THIGH, -thigh, on_shin), NUT);
    let size = 0.559139_f64.hypot(0.829074);
    let [ux, uz] = [-0.559139 / size, 0.829074 / size];
    let [along, across] = [x * ux + z * uz, x * uz - z * ux];
    let nut = along + (span(SHIN_PIN, NUT).powi(2) - across * across).sqrt();
    [shin - thigh, turn - thigh, nut]
}

/// The motor of Kangaroo's ankle on the left, and on the right at the opposite roll.
fn ankle(thigh: f64, shin: f64, pitch: f64, roll: f64) -> f64 {
    let knee = carried(THIGH, THIGH, thigh, KNEE);
    let [x, z] = carried(KNEE, knee, shin, [ANKLE[0], ANKLE[2]]);
    let ball = turned(1, shin + pitch, turned(0, roll, minus(FOOT_BALL, ANKLE)));
    // seen along y, from the knee's axis
    let cycled = |[x, y, z]: [f64; 3]| [z, x, y];
    let seen = minus(plus([x, ANKLE[1], z], ball), [knee[0], 0.0, knee[1]]);
    let arm = minus(ROD, [KNEE[0], 0.0, KNEE[1]]);
    let angles = swings(cycled(arm), cycled(seen), length(minus(FOOT_BALL, ROD)));
    // both ends of the parallelogram turn alike but for the roll
    let butterfly = near(angles.map(|x| x - shin - pitch)) + shin + pitch;
    let on_butterfly = carried(KNEE, knee, butterfly, BUTTERFLY_PIN);
    let on_crank = pin([THIGH, BUTTERFLY_PIN, BAR], THIGH, on_butterfly);
    let crank = angle(way(BAR, THIGH), way(on_crank, THIGH));
    span(carried(THIGH, THIGH, crank, SLIDER), MOTOR) - span(SLIDER, MOTOR)
}

#[test]
fn the_six_motors_of_kangaroos_leg_are_where_circles_and_spheres_meet() {
    let mut robot = Robot::new(bundled("kangaroo_leg").model);
    let mut seeded = Seeded::new(8);
    for _ in 0..60 {
        let [yaw, pitch, roll, foot, tilt] = [(); 5].map(|()| seeded.within(-0.25, 0.25));
        let thigh = seeded.within(-0.4, 0.4);
        let y = [yaw, pitch, roll, thigh, foot, tilt];
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[Q, U]).ok();
        let q = state.get(Q).to_vec();
        let [knee, triangle, nut] = leg(thigh);
        let found = ["knee_joint", "triangle_joint"].map(|name| joint(&robot, &q, name));
        assert_close(&format!("knee at {y:?}"), &found, &[knee, triangle], 1.0, 1e-13);
        let pin = plus(YAW, turned(2, yaw, minus(YAW_PIN, YAW)));
        let reach = |a, b| length(minus(a, b));
        let hip = |i: usize| {
            let ball = turned(1, pitch, turned(0, roll, minus(HIP_BALLS[i], HIP)));
            reach(plus(HIP, ball), HIP_MOTORS[i]) - reach(HIP_BALLS[i], HIP_MOTORS[i])
        };
        let side = |tilt| ankle(thigh, thigh + knee, foot, tilt);
        let turn = reach(pin, YAW_MOTOR) - reach(YAW_PIN, YAW_MOTOR);
        let expected = [turn, hip(0), hip(1), nut, side(tilt), side(-tilt)];
        assert_close(&format!("motors at {y:?}"), state.get(U), &expected, 0.1, 1e-12);
    }
}

#[test]
fn kangaroos_leg_has_the_lengths_of_its_design_and_stays_above_its_foot() {
    let found = [
        span(KNEE, THIGH),
        span([ANKLE[0], ANKLE[2]], KNEE),
        span(TRIANGLE, THIGH),
        span(TRIANGLE_PIN, TRIANGLE),
        span(TRIANGLE_PIN, BAR1),
        span(BAR1, THIGH),
        span(BAR2, TRIANGLE),
        span(SHIN_PIN, BAR2),
        span(KNEE, TRIANGLE),
        span(SHIN_PIN, KNEE),
        span(SHIN_PIN, NUT),
        span(BAR, THIGH),
        span(BUTTERFLY_PIN, BAR),
        span(BUTTERFLY_PIN, KNEE),
        span(SLIDER, THIGH),
    ];
    let design = [
        0.38, 0.38, 0.04, 0.04, 0.09, 0.115, 0.09, 0.40427, 0.40427, 0.09, 0.215, 0.06, 0.38, 0.06,
        0.035,
    ];
    assert_close("lengths", &found, &design, 1.0, 4e-6);
    let mut robot = Robot::new(bundled("kangaroo_leg").model);
    for k in -45..=43 {
        // the foot level
        let thigh = 0.01 * f64::from(k);
        let [knee, triangle, _] = leg(thigh);
        let y = [0.0, 0.0, 0.0, thigh, -thigh - knee, 0.0];
        let foot = pose(&mut robot, "foot", &y);
        assert!(foot[0].abs() < 0.003 && foot[3..6].iter().all(|x| x.abs() < 1e-13), "{foot:?}");
        assert!((knee - triangle).abs() < 1e-4, "{knee} {triangle}");
        let state = robot.ask(Request::Kinematics, &[(Y, &y)], &[U]).ok();
        assert!(state.get(U)[4..].iter().all(|x| x.abs() < 4e-5), "{:?}", state.get(U));
    }
}
