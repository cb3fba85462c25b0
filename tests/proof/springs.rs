//! Springs between motors and joints in simulations.

use sarrus_dynamics::Model;
use sarrus_dynamics::description::Motor;
use sarrus_models::{Options, Source, load};
use sarrus_simulation::{Input, Method, Settings, Setup, Source as Force, Space, Start, simulate};
use sarrus_tests::compare::assert_close;

use crate::actuators::driven;

/// Motion of the pendulum of `driven` and of its rotor by a method of the test's own: θ, θ̇, u, u̇
/// from rest under a constant force τ of the motor, or with gains on it.
fn elastic_pendulum(
    [k, J]: [f64; 2],
    [tau, kp, kd, target]: [f64; 4],
    start: f64,
    duration: f64,
) -> [f64; 4] {
    // 2 kg at 0.5 m with 0.01 kg m² about its centre
    let rate = |[theta, speed, u, v]: [f64; 4]| {
        let force = k * (theta - u);
        let motor = tau + kp * (target - theta) - kd * speed;
        [speed, (motor - force) / J, v, (force - 2.0 * 9.81 * 0.5 * u.sin()) / 0.51]
    };
    let along = |x: [f64; 4], h: f64, d: [f64; 4]| [0, 1, 2, 3].map(|i| x[i] + h * d[i]);
    let mut x = [start, 0.0, start, 0.0];
    let steps = 200_000;
    let h = duration / f64::from(steps);
    for _ in 0..steps {
        let a = rate(x);
        let b = rate(along(x, 0.5 * h, a));
        let c = rate(along(x, 0.5 * h, b));
        let d = rate(along(x, h, c));
        x = [0, 1, 2, 3].map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
    }
    x
}

/// This motion by `simulate`.
fn simulated(
    loaded: &sarrus_models::Loaded,
    (method, step): (Method, Option<f64>),
    [tau, kp, kd, target]: [f64; 4],
    duration: f64,
) -> sarrus_simulation::Run {
    let space = Space::Actuator;
    let [stiffness, damping, target] = [kp, kd, target].map(|x| vec![x]);
    let inputs = [
        Input { space, source: Force::Constant(vec![tau]) },
        Input { space, source: Force::Gains { stiffness, damping, target } },
    ];
    let setup = Setup {
        description: &loaded.description,
        compiled: &loaded.compiled,
        springs: &[],
        inputs: &inputs,
    };
    let usual = Settings::new(method, duration);
    let settings = Settings { step, rtol: 1e-11, atol: 1e-12, ..usual };
    let start = Start::Independent { y: vec![0.2], yd: vec![0.0], guess: None };
    simulate(&setup, &start, &settings, &mut |_| {}).unwrap()
}

fn sprung(stiffness: &str) -> sarrus_models::Loaded {
    driven(&format!("  rotor_inertia: 2e-4\n  gear_ratio: 10\n{stiffness}"))
}

#[test]
fn a_motor_behind_a_spring_moves_as_a_rotor_and_a_joint_of_their_own() {
    for k in [30.0, 900.0] {
        let loaded = sprung(&format!("  series_stiffness: {k}\n"));
        for forces in [[3.0, 0.0, 0.0, 0.0], [1.0, 15.0, 0.4, 0.7]] {
            let exact = elastic_pendulum([k, 0.02], forces, 0.2, 0.6);
            for (method, step, tolerance) in [
                (Method::Dop853, None, 1e-8),
                (Method::Radau5, None, 1e-6),
                (Method::RungeKutta, Some(1e-4), 1e-8),
                (Method::Euler, Some(1e-5), 1e-3),
            ] {
                let run = simulated(&loaded, (method, step), forces, 0.6);
                let last = run.last().unwrap();
                let found = [last.theta[0], last.y[0], last.yd[0]];
                assert_close("motion", &found, &[exact[0], exact[2], exact[3]], 1.0, tolerance);
                assert_eq!(run.elastic, ["pivot"]);
                // ½ J θ̇² + ½ k (θ − u)² and those of the joint, by a way of the test's own
                let [theta, speed, u, v] = exact;
                let kinetic = 0.5 * 0.02 * speed * speed + 0.5 * 0.51 * v * v;
                let potential = 0.5 * k * (theta - u) * (theta - u) - 2.0 * 9.81 * 0.5 * u.cos();
                let found = [last.energy.kinetic, last.energy.potential];
                assert_close("energy", &found, &[kinetic, potential], 10.0, 3.0 * tolerance);
                let drift = if method == Method::Euler { 1e-2 } else { tolerance };
                assert!(run.drift() < drift, "{} {k} {:e}", method.name(), run.drift());
            }
        }
    }
}

#[test]
fn a_stiffer_spring_is_nearer_to_none_by_its_stiffness() {
    let forces = [3.0, 0.0, 0.0, 0.0];
    let way = (Method::Radau5, None);
    let rigid = simulated(&sprung(""), way, forces, 0.5);
    assert!(rigid.elastic.is_empty() && rigid.last().unwrap().theta.is_empty());
    // the largest distance on the way, as the end may be at any phase of the vibration
    let off = |k: f64| {
        let loaded = sprung(&format!("  series_stiffness: {k:e}\n"));
        let run = simulated(&loaded, way, forces, 0.5);
        let pairs = run.samples.iter().map(|sample| (sample.time, sample.y[0]));
        let u = |time: f64| {
            let after = rigid.samples.partition_point(|sample| sample.time < time).max(1);
            let [a, b] = [after - 1, after].map(|i| &rigid.samples[i]);
            let step = b.time - a.time;
            let s = (time - a.time) / step;
            let low = (1.0 - s) * (1.0 - s);
            let high = s * s;
            low * ((1.0 + 2.0 * s) * a.y[0] + s * step * a.yd[0])
                + high * ((3.0 - 2.0 * s) * b.y[0] - (1.0 - s) * step * b.yd[0])
        };
        pairs.map(|(time, y)| (y - u(time)).abs()).fold(0.0, f64::max)
    };
    let distances = [1e3, 1e4, 1e5].map(off);
    for pair in distances.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((8.0..12.5).contains(&ratio), "{distances:?}");
    }
}

#[test]
fn a_spring_of_a_rotor_without_inertia_gives_the_force_at_once() {
    let forces = [3.0, 15.0, 0.4, 0.7];
    let way = (Method::Dop853, None);
    let [with, without] = ["  series_stiffness: 30\n", ""]
        .map(|key| simulated(&driven(&format!("  peak_torque: 90\n{key}")), way, forces, 0.5));
    assert_eq!(with, without);
}

#[test]
fn energy_stays_where_it_is_in_closed_mechanisms_whose_motors_stand_behind_springs() {
    for (name, y, yd) in [
        ("lambda", vec![0.4], vec![0.3]),
        ("torso", vec![0.1, -0.05], vec![0.4, 0.6]),
        ("four_bars_2", vec![0.3], vec![1.0]),
    ] {
        let loaded = load(&Source::Bundled(name.to_owned()), &Options::default()).unwrap();
        let active = loaded.compiled.model.active_names().to_vec();
        // rotors about as heavy as the robot, whose springs have the same frequency
        let with = |stiffness: f64| {
            let mut description = loaded.description.clone();
            for joint in description.joints.iter_mut().filter(|of| active.contains(&of.name)) {
                joint.terms.damping = 0.0;
                joint.terms.rotor_inertia = 0.5;
                joint.motor = Some(Motor {
                    continuous: f64::INFINITY,
                    thermal_time: f64::INFINITY,
                    series_stiffness: stiffness,
                    driving: Vec::new(),
                    braking: Vec::new(),
                    power: f64::INFINITY,
                    efficiency: [1.0; 2],
                });
            }
            let compiled = Model::compile(&description).unwrap();
            let inputs = [Input {
                space: Space::Actuator,
                source: Force::Gains {
                    stiffness: vec![40.0; active.len()],
                    damping: vec![1.0; active.len()],
                    target: vec![0.01; active.len()],
                },
            }];
            let setup = Setup {
                description: &description,
                compiled: &compiled,
                springs: &[],
                inputs: &inputs,
            };
            let usual = Settings::new(Method::Radau5, 0.3);
            let settings = Settings { rtol: 1e-11, atol: 1e-12, ..usual };
            let start = Start::Independent { y: y.clone(), yd: yd.clone(), guess: None };
            let run = simulate(&setup, &start, &settings, &mut |_| {}).unwrap();
            assert!(run.end.is_finished(), "{name}: {:?}", run.end);
            assert!(run.drift() < 1e-7, "{name}, {stiffness}: {:e}", run.drift());
            run
        };
        let soft = with(200.0);
        assert_eq!(soft.elastic, active, "{name}");
        assert_eq!(soft.last().unwrap().theta.len(), active.len());
        let rigid = with(f64::INFINITY);
        let off = [1e4, 1e5, 1e6].map(|stiffness| {
            let run = with(stiffness);
            let ends = [&run, &rigid].map(|run| &run.last().unwrap().y);
            ends[0].iter().zip(ends[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        });
        // of the first order in 1 / k, at any phase of the vibration
        println!("{name}: soft {:?}, off {off:?}", soft.last().unwrap().y);
        assert!(off[1] < 0.3 * off[0] && off[2] < 0.3 * off[1], "{name}: {off:?}");
    }
}

#[test]
fn a_motor_behind_a_spring_is_limited_at_its_own_speed() {
    // no joint turns as fast as the rotor, whose spring is soft
    let text = "  torque_speed: [[0, 4], [6, 0]]\n  rotor_inertia: 2e-4\n  gear_ratio: 10\n  \
                series_stiffness: 0.5\n";
    let loaded = driven(text);
    let inputs = [Input { space: Space::Actuator, source: Force::Constant(vec![9.0]) }];
    let setup = Setup {
        description: &loaded.description,
        compiled: &loaded.compiled,
        springs: &[],
        inputs: &inputs,
    };
    let usual = Settings::new(Method::Dop853, 0.4);
    let settings = Settings { limited: true, rtol: 1e-10, atol: 1e-10, ..usual };
    let start = Start::Independent { y: vec![0.0], yd: vec![0.0], guess: None };
    let run = simulate(&setup, &start, &settings, &mut |_| {}).unwrap();
    // J θ̈ = 4 (1 − θ̇ / 6) − k θ while the pendulum hardly moves
    let mut theta = 0.0;
    let mut speed = 0.0;
    let h = 1e-6;
    assert!(run.samples.iter().all(|sample| sample.y[0].abs() < 0.2));
    for _ in 0..400_000 {
        speed += h * (4.0 * (1.0 - speed / 6.0) - 0.5 * theta) / 0.02;
        theta += h * speed;
    }
    let last = run.last().unwrap();
    assert!((last.theta[0] - theta).abs() < 0.03 * theta, "{} {theta}", last.theta[0]);
    assert!(run.drift() < 1e-7, "{:e}", run.drift());
}
