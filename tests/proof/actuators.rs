//! Actuators of model files: published motors, limits over speed, friction, stops, and simulations
//! with them.

use sarrus_dynamics::description::Friction;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, Model, QueryOptions, Request, Warnings};
use sarrus_models::{CheckReport, Options, Source, load};
use sarrus_simulation::{
    EventKind, Input, Method, Settings, Setup, Source as Force, Space, Start, simulate,
};
use sarrus_tests::compare::assert_close;
use sarrus_tests::run::Robot;

use crate::motors::query;

use Field::*;

/// A pendulum with a motor, by the text of its files.
pub(crate) fn driven(actuator: &str) -> sarrus_models::Loaded {
    let urdf = r#"<robot name="arm"><link name="base"/><link name="bob"><inertial>
        <origin xyz="0 0 -0.5"/><mass value="2"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
        <joint name="pivot" type="revolute"><parent link="base"/><child link="bob"/>
        <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="50" velocity="20"/></joint></robot>"#;
    let yml = format!(
        "submechanisms:\n- {{type: 1R, contextual_name: arm, jointnames_spanningtree: [pivot], \
         jointnames_independent: [pivot], jointnames_active: [pivot]}}\nactuators:\n- joint: pivot\n{actuator}"
    );
    let source = Source::Text { urdf: urdf.into(), submechanisms: Some(yml.into_bytes()) };
    load(&source, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_published_motor_gives_less_the_faster_it_turns_and_more_where_it_brakes() {
    let loaded = driven("  model: N5020-16\n");
    let mut robot = Robot::new(loaded.compiled.model);
    let d = [1.0, -1.0];
    for (speed, along, against) in [
        (0.0, 31.9, 31.9),
        (20.0, 24.8, 31.9),
        (30.86, 24.8, 31.9),
        (35.495, 12.4, 15.95),
        (40.13, 0.0, 0.0),
        (60.0, 0.0, 0.0),
    ] {
        for sign in [1.0, -1.0] {
            let given: [(Field, &[f64]); 3] =
                [(Y, &[0.3]), (Yd, &[sign * speed]), (Directions, &d)];
            let base = query(Request::Kinematics, &[TorqueSupport]).with_directions(2);
            let x = robot.ask_for(base, &given).ok();
            let found = if sign > 0.0 { [0, 1] } else { [1, 0] }.map(|k| x.get(TorqueSupport)[k]);
            if speed > 0.0 {
                assert_close("forces", &found, &[along, against], 1.0, 1e-12);
            }
        }
    }
    let x = robot.ask(Request::Kinematics, &[(Y, &[0.3])], &[ReflectedInertia]).ok();
    assert_eq!(x.get(ReflectedInertia), [0.003609725]);
}

#[test]
fn numbers_of_an_actuator_come_before_those_of_its_model_and_of_the_urdf() {
    let loaded = driven(
        "  peak_torque: 10\n  max_speed: 5\n  power: 20\n  stroke: [-1, 4]\n  efficiency: [0.8, 0.5]\n  \
         rotor_inertia: 1e-4\n  gear_ratio: 10\n  friction: {coulomb: 0.5, viscous: 0.1, speed: 0.2}\n",
    );
    let joint = &loaded.description.joints[0];
    let limits = joint.limits.unwrap();
    assert_eq!(
        [limits.lower, limits.upper, limits.velocity, limits.effort],
        [-1.0, 3.0, 5.0, 10.0]
    );
    let model = loaded.compiled.model;
    assert_eq!(model.actuator_forces(0, 1.0), Some([-20.0, 8.0]));
    assert_eq!(model.actuator_forces(0, -4.0), Some([-4.0, 20.0]));
    // at rest the axis has no direction
    assert_eq!(model.actuator_forces(0, 0.0), Some([-8.0, 8.0]));
    assert_eq!(model.actuator_forces(0, -0.0), Some([-8.0, 8.0]));
    let mut robot = Robot::new(model);
    let given: [(Field, &[f64]); 3] = [(Y, &[0.3]), (Yd, &[0.7]), (Ydd, &[-2.0])];
    let plain = robot.ask(Request::InverseDynamics, &given, &[TauU, CY]).ok();
    let base = query(Request::InverseDynamics, &[TauU, CY]).with_options(QueryOptions::FRICTION);
    let rough = robot.ask_for(base, &given).ok();
    let expected = 0.5 * (0.7_f64 / 0.2).tanh() + 0.1 * 0.7;
    for field in [TauU, CY] {
        let found = rough.get(field)[0] - plain.get(field)[0];
        assert!((found - expected).abs() < 1e-14 * 10.0, "{found} {expected}");
    }
    let base = query(Request::ForwardDynamics, &[Ydd]).with_options(QueryOptions::FRICTION);
    let given: [(Field, &[f64]); 3] = [(Y, &[0.3]), (Yd, &[0.7]), (TauU, rough.get(TauU))];
    let back = robot.ask_for(base, &given).ok();
    assert_close("ÿ with friction", back.get(Ydd), &[-2.0], 1.0, 1e-13);
}

#[test]
fn derivatives_have_the_friction_of_serial_and_of_closed_joints() {
    for name in ["torso", "lambda", "delta", "rh5v2_upper_body"] {
        let loaded = load(&Source::Bundled(name.to_owned()), &Options::default()).unwrap();
        let mut description = loaded.description;
        for (j, joint) in description.joints.iter_mut().enumerate() {
            let k = j as f64;
            joint.terms.friction = Friction { coulomb: 1.0 + 0.1 * k, viscous: 0.3, speed: 0.5 };
        }
        let mut robot = Robot::new(Model::compile(&description).unwrap().model);
        let n = robot.model.sizes().n_vy;
        let wave = |at: f64| (0..n).map(|k| 0.1 * (at + k as f64).sin()).collect::<Vec<f64>>();
        let (y, yd, last) = (wave(0.3), wave(1.7), wave(2.9));
        for (request, given, of, fields) in [
            (Request::InverseDynamics, Ydd, TauY, [DtauYDy, DtauYDyd]),
            (Request::ForwardDynamics, TauY, Ydd, [DyddDy, DyddDyd]),
        ] {
            let mut ask = |y: &[f64], yd: &[f64], field: Field| {
                let base = query(request, &[field]).with_options(QueryOptions::FRICTION);
                let x = robot.ask_for(base, &[(Y, y), (Yd, yd), (given, &last)]).ok();
                x.get(field).to_vec()
            };
            for (moved, field) in fields.into_iter().enumerate() {
                let found = ask(&y, &yd, field);
                let most = found.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
                for j in 0..n {
                    let h = 1e-5;
                    let [after, before] = [h, -h].map(|h| {
                        let mut state = [y.clone(), yd.clone()];
                        state[moved][j] += h;
                        ask(&state[0], &state[1], of)
                    });
                    for i in 0..n {
                        let difference = (after[i] - before[i]) / (2.0 * h);
                        let error = (found[i * n + j] - difference).abs() / most;
                        assert!(error < 1e-6, "{name}, {field:?}, {i} by {j}: {error:e}");
                    }
                }
            }
        }
    }
}

#[test]
fn faults_of_actuators_have_their_place_and_remedy() {
    let fault = |text: &str| {
        let caught = std::panic::catch_unwind(|| driven(text)).err().unwrap();
        caught.downcast_ref::<String>().unwrap().clone()
    };
    for (text, word) in [
        ("  model: N5020\n", "N5020-16"),
        ("  peak_torque: -1\n", "peak_torque"),
        ("  thermal_time: 0\n  continuous_torque: 1\n", "thermal_time"),
        ("  thermal_time: 9\n", "continuous_torque"),
        ("  series_stiffness: -2\n", "series_stiffness"),
        ("  torque_speed: [[1, 2], [0, 1]]\n", "higher speed"),
        ("  efficiency: [1.2, 1]\n", "efficiencies"),
        ("  torque: 1\n", "not known"),
        ("- joint: pivot\n", "once"),
        ("- joint: elbow\n", "no joint"),
    ] {
        let found = fault(text);
        assert!(found.contains(word) && found.contains(":4:") || found.contains(":5:"), "{found}");
    }
}

#[test]
fn hyperbolic_tangents_are_those_of_the_library_and_keep_every_digit() {
    for k in -4000..=4000 {
        let x = f64::from(k) * 0.0113;
        let [a, b] = [Real::tanh(x), x.tanh()];
        assert!((a - b).abs() <= 16.0 * f64::EPSILON * b.abs(), "{x}: {a} {b}");
        let exact = Real::tanh(Dd::from_f64(x));
        assert!((exact.to_f64() - b).abs() <= 2.0 * f64::EPSILON * b.abs(), "{x}");
        // tanh 2x = 2 tanh x / (1 + tanh² x)
        let half = Real::tanh(Dd::from_f64(0.5 * x));
        let twice = (half + half) / (half * half + Dd::ONE);
        assert!((exact - twice).abs().to_f64() <= 1e-29, "{x}");
    }
    assert_eq!([Real::tanh(1e9), Real::tanh(-1e9)], [1.0, -1.0]);
}

#[test]
fn a_simulated_motor_gives_no_more_than_it_can_and_friction_balances_the_energy() {
    let loaded = driven(
        "  peak_torque: 4\n  max_speed: 20\n  friction: {coulomb: 0.4, viscous: 0.1, speed: 0.05}\n",
    );
    let run = |friction, limited| {
        let inputs = [Input { space: Space::Actuator, source: Force::Constant(vec![9.0]) }];
        let setup = Setup {
            description: &loaded.description,
            compiled: &loaded.compiled,
            springs: &[],
            inputs: &inputs,
        };
        let settings = Settings {
            friction,
            limited,
            rtol: 1e-11,
            atol: 1e-12,
            ..Settings::new(Method::Dop853, 0.5)
        };
        let start = Start::Independent { y: vec![0.1], yd: vec![0.0], guess: None };
        simulate(&setup, &start, &settings, &mut |_| {}).unwrap()
    };
    let work = |run: &sarrus_simulation::Run| {
        let [first, last] = [&run.samples[0], run.last().unwrap()];
        let energy =
            |sample: &sarrus_simulation::Sample| sample.energy.kinetic + sample.energy.potential;
        energy(last) - energy(first)
    };
    let free = run(false, false);
    assert!(free.events.is_empty());
    let limited = run(false, true);
    let names: Vec<_> = limited.events.iter().map(|event| &event.kind).collect();
    assert_eq!(names, [&EventKind::Limited("pivot".into())]);
    // a constant force does its work over the way
    let way = |run: &sarrus_simulation::Run| run.last().unwrap().y[0] - 0.1;
    assert!((work(&free) - 9.0 * way(&free)).abs() < 1e-8);
    assert!((work(&limited) - 4.0 * way(&limited)).abs() < 1e-8);
    let rough = run(true, true);
    assert!(work(&rough) < 4.0 * way(&rough) - 0.1);
    assert!(rough.drift() < 1e-8, "{}", rough.drift());
}

#[test]
fn a_joint_bounces_off_its_stop_at_the_time_of_contact_and_loses_energy_there() {
    let loaded = driven("  peak_torque: 40\n  stroke: [-0.5, 0.5]\n");
    let run = |stops, method, step| {
        let inputs = [Input { space: Space::Actuator, source: Force::Constant(vec![9.0]) }];
        let setup = Setup {
            description: &loaded.description,
            compiled: &loaded.compiled,
            springs: &[],
            inputs: &inputs,
        };
        let usual = Settings::new(method, 1.0);
        let settings = Settings { stops, step, rtol: 1e-10, atol: 1e-12, ..usual };
        let start = Start::Independent { y: vec![0.0], yd: vec![0.0], guess: None };
        simulate(&setup, &start, &settings, &mut |_| {}).unwrap()
    };
    let free = run(None, Method::Dop853, None);
    assert!(free.events.is_empty() && free.last().unwrap().y[0] > 0.6);
    // the time at which the free motion passes the limit
    let after = free.samples.iter().position(|sample| sample.y[0] > 0.5).unwrap();
    let [before, after] = [&free.samples[after - 1], &free.samples[after]];
    for (method, step) in
        [(Method::Dop853, None), (Method::Radau5, None), (Method::RungeKutta, Some(1e-4))]
    {
        let stopped = run(Some(1e5), method, step);
        let event = &stopped.events[0];
        assert_eq!(event.kind, EventKind::Stopped("pivot".into()));
        assert!(event.time > before.time && event.time < after.time, "{}", event.time);
        let at = stopped.samples.iter().find(|sample| sample.time == event.time).unwrap();
        assert!((at.y[0] - 0.5).abs() < 1e-8, "{}", at.y[0]);
        let most = stopped.samples.iter().map(|sample| sample.y[0]).fold(0.0, f64::max);
        assert!(most > 0.5 && most < 0.52, "{most}");
        let least = stopped.samples.iter().filter(|sample| sample.time > event.time);
        assert!(least.map(|sample| sample.yd[0]).fold(0.0, f64::min) < -0.5);
        assert!(stopped.drift() < 1e-6, "{}", stopped.drift());
    }
}

#[test]
fn a_winding_that_is_warm_bears_the_continuous_torque_alone() {
    let usual = "  peak_torque: 6\n  friction: {viscous: 40}\n  continuous_torque: 3\n";
    let run = |more: &str, limited, method, step| {
        let loaded = driven(&format!("{usual}{more}"));
        let inputs = [Input { space: Space::Actuator, source: Force::Constant(vec![5.0]) }];
        let setup = Setup {
            description: &loaded.description,
            compiled: &loaded.compiled,
            springs: &[],
            inputs: &inputs,
        };
        let settings = Settings { friction: true, limited, step, ..Settings::new(method, 60.0) };
        let start = Start::Independent { y: vec![0.0], yd: vec![0.0], guess: None };
        simulate(&setup, &start, &settings, &mut |_| {}).unwrap()
    };
    // a method may also tell that the motion is stiff
    let limited_at = |run: &sarrus_simulation::Run| {
        let kind = EventKind::Limited("pivot".into());
        run.events.iter().find(|event| event.kind == kind).map(|event| event.time)
    };
    // where gravity balances a force
    let at = |force: f64| (force / (2.0 * 9.81 * 0.5)).asin();
    let warm = "  thermal_time: 2\n";
    for (more, limited) in [("", true), (warm, false)] {
        let cold = run(more, limited, Method::Dop853, None);
        assert_eq!(limited_at(&cold), None);
        assert!((cold.last().unwrap().y[0] - at(5.0)).abs() < 1e-4);
    }
    for (method, step) in
        [(Method::Dop853, None), (Method::Radau5, None), (Method::RungeKutta, Some(2e-3))]
    {
        let hot = run(warm, true, method, step);
        let end = hot.last().unwrap().y[0];
        assert!((end - at(3.0)).abs() < 1e-3, "{end} {}", at(3.0));
        assert!(hot.drift() < 1e-5, "{}", hot.drift());
        let time = limited_at(&hot).unwrap();
        // (5 / 3)² (1 − exp(−t / T)) = 1 − 0.05 (5 − 3) / (6 − 3)
        let expected = -2.0 * (1.0 - (1.0 - 0.05 * 2.0 / 3.0) * 9.0 / 25.0_f64).ln();
        assert!(time >= expected, "{} {expected}", time);
        if step.is_some() {
            assert!(time < expected + 4e-3, "{} {expected}", time);
        }
    }
}

#[test]
fn notes_tell_who_reads_the_winding_and_the_spring_of_a_motor() {
    let loaded = driven(
        "  peak_torque: 6\n  continuous_torque: 3\n  thermal_time: 2\n  series_stiffness: 350\n",
    );
    let notes: Vec<_> = loaded.report.notes.iter().map(|note| note.found.as_str()).collect();
    assert_eq!(notes, ["`thermal_time` is kept", "`series_stiffness` is kept"]);
    let motor = loaded.description.joints[0].motor.clone().unwrap();
    assert_eq!([motor.continuous, motor.thermal_time, motor.series_stiffness], [3.0, 2.0, 350.0]);
    let report = serde_json::to_value(CheckReport::new(&Ok(loaded)).unwrap()).unwrap();
    let shown = serde_json::json!([{"joint": "pivot", "peak_torque": 6.0,
        "continuous_torque": 3.0, "thermal_time": 2.0, "series_stiffness": 350.0,
        "max_speed": 20.0, "torque_speed": [], "braking_torque_speed": [], "power": null,
        "rotor_inertia": 0.0, "gear_ratio": 1.0, "efficiency": [1.0, 1.0]}]);
    assert_eq!(report["actuators"], shown);
}

#[test]
fn a_force_beyond_the_limit_at_its_speed_has_the_warning_wherever_it_is_asked_for() {
    let loaded = driven("  model: N5020-16\n  power: 500\n  efficiency: [0.9, 0.8]\n");
    let model = loaded.compiled.model;
    let mut robot = Robot::new(model.clone());
    let mut beyond = 0;
    let mut cases = 0;
    for speed in [0.0, -0.0, 7.0, -21.0, 33.0, -38.0, 60.0] {
        let [lower, upper] = model.actuator_forces(0, speed).unwrap();
        for part in [0.9, 1.0 - 1e-9, 1.0 + 1e-9, 1.1] {
            for limit in [lower, upper] {
                // M ÿ = τ − C
                let still: [(Field, &[f64]); 3] = [(Y, &[0.3]), (Yd, &[speed]), (Ydd, &[0.0])];
                let rest = robot.ask(Request::InverseDynamics, &still, &[TauU]).ok();
                let ydd = (part * limit + 1e-3 * (part - 1.0) - rest.get(TauU)[0]) / 0.51;
                let given = [still[0], still[1], (Ydd, std::slice::from_ref(&ydd))];
                let wants: [&[Field]; 8] = [
                    &[TauU],
                    &[TauU, TauY],
                    &[TauU, Margin],
                    &[Margin],
                    &[Clip],
                    &[ClipNearest],
                    &[Binding],
                    &[Limits, Margin],
                ];
                let found = wants.map(|want| {
                    let x = robot.ask(Request::InverseDynamics, &given, want).ok();
                    x.answer.warnings.contains(Warnings::LIMITS_EXCEEDED)
                });
                let all = robot.ask(Request::InverseDynamics, &given, &[TauU, Margin, Limits]);
                let x = all.ok();
                let tau = x.get(TauU)[0];
                // the motor's greatest speed is that of the joint
                let fast = speed.abs() > 40.13;
                let over = tau < lower || tau > upper;
                assert_eq!(found, [fast || over; 8], "{speed} {tau} {lower} {upper}");
                let excess = x.get(Limits)[2];
                let expected = (tau - upper).max(0.0) + (tau - lower).min(0.0);
                assert_eq!(excess, expected, "{speed} {tau} {lower} {upper}");
                // the margin is that of the same limits
                let margin = x.get(Margin)[0];
                let sure = (margin - 1.0).abs() > 1e-12;
                assert!(!sure || over == (margin < 1.0), "{speed} {tau} {margin}");
                beyond += usize::from(over);
                cases += 1;
            }
        }
    }
    assert!(beyond > 10 && beyond < cases - 10, "{beyond} of {cases}");
}

#[test]
fn speeds_are_compared_with_their_limits_wherever_velocities_are_computed() {
    for name in ["lambda", "torso", "rh5v2_upper_body"] {
        let loaded = load(&Source::Bundled(name.to_owned()), &Options::default()).unwrap();
        let model = loaded.compiled.model;
        let info = model.info().clone();
        let mut robot = Robot::new(model);
        let n = info.independent.len();
        let y = vec![0.05; n];
        for speed in [1e-3, 40.0] {
            let yd = vec![speed; n];
            let given: [(Field, &[f64]); 2] = [(Y, &y), (Yd, &yd)];
            let wants: [&[Field]; 4] = [&[Qd], &[Q, Limits], &[Ud], &[U, Q, Qd, G]];
            for want in wants {
                let x = robot.ask(Request::Kinematics, &given, want).ok();
                let warned = x.answer.warnings.contains(Warnings::LIMITS_EXCEEDED);
                assert_eq!(warned, speed > 1.0, "{name} {speed} {want:?}");
            }
        }
    }
}
