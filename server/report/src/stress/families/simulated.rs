//! Families of simulations: stiffness, steps and tolerances, conserved energy, inconsistent starts.

use sarrus_dynamics::description::{SubmechanismKind as Kind, Terms};
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Field, LinkId, Request};
use sarrus_simulation::{Input, Method, Run, Settings, Source, Space, Start};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{
    At, Cases, Question, Robot, State, Trial, X, apart, bundled, from, mechanism, offsets, powers,
    reference_run, settings,
};
use crate::stress::mechanisms::rods;

/// A spring and its damper that get stiffer: explicit methods must report their failure, the
/// implicit one holds.
pub(crate) fn springs(cases: &mut Cases, effort: &Effort) -> Outcome {
    stiff(effort).into_iter().try_for_each(|k| oscillation(cases, k, [k, k.sqrt()]))
}

/// A damper that gets stiffer.
pub(crate) fn dampers(cases: &mut Cases, effort: &Effort) -> Outcome {
    stiff(effort).into_iter().try_for_each(|d| oscillation(cases, d, [1.0, d]))
}

/// A mass of 1 kg on a slider, with a spring and a damper, that starts at 1 from rest.
fn oscillation(cases: &mut Cases, value: f64, [stiffness, damping]: [f64; 2]) -> Outcome {
    let mut of = mechanism(Kind::Serial);
    of.gravity([0.0; 3])
        .prismatic("slider", LinkId::BASE, X)
        .spring(stiffness, 0.0)
        .damping(damping);
    let robot = Robot::new("mass on a spring", of.build()?)?;
    let error = |run: &Run| {
        let off = |y: f64, time: f64| (y - swung(stiffness, damping, time)).abs();
        Ok(run.samples.iter().fold(0.0, |e: f64, at| e.max(off(at.y[0], at.time))))
    };
    let start = from(&[1.0], &[0.0]);
    let reference = "closed form";
    let trial = Trial { robot: &robot, inputs: &[], start, error: &error, reference };
    trial.every_method(cases, value)
}

/// Stiffness, damping and gains.
fn stiff(effort: &Effort) -> Vec<f64> {
    powers(effort, 0, 9, 3)
}

/// Two rods with a stiff joint between them.
pub(crate) fn stiff_joints(cases: &mut Cases, effort: &Effort) -> Outcome {
    for value in stiff(effort) {
        let mut of = rods(2)?;
        of.joints[1].terms = Terms { stiffness: value, damping: value.sqrt(), ..Terms::default() };
        against_reference(cases, &Robot::new("2 rods", of)?, value, &[])?;
    }
    Ok(())
}

/// Actuators with stiff position control.
pub(crate) fn gains(cases: &mut Cases, effort: &Effort) -> Outcome {
    for name in ["lambda", "torso"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let n_u = robot.compiled.model.sizes().n_u;
        for value in stiff(effort) {
            let source = Source::Gains {
                stiffness: vec![value; n_u],
                damping: vec![value.sqrt(); n_u],
                target: vec![0.01; n_u],
            };
            let input = Input { space: Space::Actuator, source };
            against_reference(cases, &robot, value, &[input])?;
        }
    }
    Ok(())
}

/// Its position at t, from rest at 1.
fn swung(stiffness: f64, damping: f64, t: f64) -> f64 {
    let decay = 0.5 * damping;
    let square = 0.25 * damping * damping - stiffness;
    if square < 0.0 {
        let (sine, cosine) = ((-square).sqrt() * t).sin_cos();
        return (-decay * t).exp() * (cosine + decay / (-square).sqrt() * sine);
    }
    // the slow root from the product of both, which are k
    let fast = -decay - square.sqrt();
    let slow = stiffness / fast;
    (fast * (slow * t).exp() - slow * (fast * t).exp()) / (fast - slow)
}

/// Every method against the implicit one at its least tolerance.
fn against_reference(cases: &mut Cases, robot: &Robot, value: f64, inputs: &[Input]) -> Outcome {
    let state = State::of(robot, 0.1)?;
    let start = from(&state.y, &vec![0.0; state.yd.len()]);
    let exact = reference_run(robot, inputs, &start, settings(Method::Radau5, 1.0))?;
    let error = |run: &Run| Ok(apart(run, &exact));
    Trial { robot, inputs, start, error: &error, reference: RADAU }.every_method(cases, value)
}

/// The reference of the implicit method.
const RADAU: &str = "Radau at 1e-13";

/// Fixed steps from too long to short.
pub(crate) fn steps(cases: &mut Cases, effort: &Effort) -> Outcome {
    to_the_end(cases, [Method::Euler, Method::RungeKutta], &powers(effort, -4, 0, 4), |plain, x| {
        Settings { step: Some(x), most_steps: 20_000, ..plain }
    })
}

/// Tolerances from strict to none.
pub(crate) fn tolerances(cases: &mut Cases, effort: &Effort) -> Outcome {
    to_the_end(cases, [Method::Dop853, Method::Radau5], &powers(effort, -13, -1, 4), |plain, x| {
        Settings { rtol: x, atol: x, ..plain }
    })
}

/// Compares at the end alone: samples on the way would shorten the steps.
fn to_the_end(
    cases: &mut Cases,
    methods: [Method; 2],
    values: &[f64],
    set: fn(Settings, f64) -> Settings,
) -> Outcome {
    for name in ["pendulum", "lambda", "four_bars_2"] {
        let robot = Robot::new(name, if name == "pendulum" { rods(1)? } else { bundled(name)? })?;
        let start = from(&[0.3], &[1.0]);
        let at_end = |method| Settings { every: Some(1.0), ..settings(method, 1.0) };
        let exact = reference_run(&robot, &[], &start, at_end(Method::Radau5))?;
        let error = |run: &Run| Ok(apart(run, &exact));
        let trial = Trial { robot: &robot, inputs: &[], start, error: &error, reference: RADAU };
        for method in methods {
            for &value in values {
                let at = At { value, method: method.name() };
                trial.run(cases, at, &set(at_end(method), value))?;
            }
        }
    }
    Ok(())
}

/// Without gravity and damping the energy is conserved, and so is the angular momentum about the
/// first axis: (M_y ẏ) of the first joint.
pub(crate) fn conservation(cases: &mut Cases, effort: &Effort) -> Outcome {
    let mut of = rods(3)?;
    of.gravity = [0.0; 3];
    let robot = Robot::new("3 rods", of)?;
    let state = State::of(&robot, 0.5)?;
    let momentum = |y: &[f64], yd: &[f64]| -> Outcome<f64> {
        let given = vec![(Field::Y, y.to_vec())];
        let mass = Question::new(Request::InverseDynamics, given, &[Field::MY])
            .run(&robot.compiled.exact)?;
        Ok(mass.get(Field::MY).iter().zip(yd).map(|(m, v)| m.to_f64() * v).sum())
    };
    let error = |run: &Run| -> Outcome<f64> {
        let first = momentum(&run.samples[0].y, &run.samples[0].yd)?;
        let mut worst = run.drift();
        for sample in &run.samples {
            worst = worst.max(((momentum(&sample.y, &sample.yd)? - first) / first).abs());
        }
        Ok(worst)
    };
    let start = from(&state.y, &state.yd);
    let reference = "energy and momentum";
    let trial = Trial { robot: &robot, inputs: &[], start, error: &error, reference };
    for value in powers(effort, -1, if effort.quick { 1 } else { 2 }, 2) {
        for method in Method::ALL {
            let step = method.is_fixed().then_some(1e-3);
            let settings = Settings { step, most_steps: 400_000, ..settings(method, value) };
            trial.run(cases, At { value, method: method.name() }, &settings)?;
        }
    }
    Ok(())
}

/// Starts off their loops are projected onto them, and the distance is reported.
pub(crate) fn off_loops(cases: &mut Cases, effort: &Effort) -> Outcome {
    for name in ["lambda", "wrist", "four_bars_2"] {
        let robot = &Robot::new(name, bundled(name)?)?;
        let model = &robot.compiled.model;
        let closed = Question::kinematics(&State::of(robot, 0.1)?).run(model)?;
        let q = closed.get(Field::Q);
        let start = |q: Vec<f64>| Start::Tree { q, qd: closed.get(Field::Qd).to_vec() };
        let radau = settings(Method::Radau5, 0.1);
        let exact = reference_run(robot, &[], &start(q.to_vec()), radau)?;
        let error = |run: &Run| Ok(apart(run, &exact));
        let independent = model.independent_q_names();
        for value in powers(effort, -15, -1, 4) {
            let mut moved = q.to_vec();
            for (k, off) in offsets(robot, value, 0).into_iter().enumerate() {
                if !independent.contains(&model.tree_q_names()[k]) {
                    moved[k] += off;
                }
            }
            let start = start(moved);
            let reference = "from the closed pose";
            let trial = Trial { robot, inputs: &[], start, error: &error, reference };
            trial.run(cases, At { value, method: "dop853" }, &settings(Method::Dop853, 0.1))?;
        }
    }
    Ok(())
}

/// Invalid settings are refused.
pub(crate) fn of_nothing(cases: &mut Cases, _: &Effort) -> Outcome {
    let robot = Robot::new("lambda", bundled("lambda")?)?;
    let at_end = |method| Settings { every: Some(0.1), ..settings(method, 0.1) };
    let exact = reference_run(&robot, &[], &from(&[0.1], &[0.0]), at_end(Method::Radau5))?;
    // a step longer than the duration becomes the duration
    let error = |run: &Run| Ok(if run.time == 0.1 { apart(run, &exact) } else { f64::INFINITY });
    let plain = at_end(Method::RungeKutta);
    for (value, bad) in
        [(1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 0.0), (4.0, -1.0), (5.0, 1e300)]
    {
        let mut trials = vec![
            ("step", [0.1, 0.0], Settings { step: Some(bad), ..plain }),
            ("duration", [0.1, 0.0], Settings { duration: bad, ..plain }),
        ];
        if bad != 0.0 && bad != -1.0 {
            trials.extend([("y", [bad, 0.0], plain), ("ẏ", [0.1, bad], plain)]);
        }
        for (method, [y, yd], settings) in trials {
            let start = from(&[y], &[yd]);
            let trial =
                Trial { robot: &robot, inputs: &[], start, error: &error, reference: RADAU };
            trial.run(cases, At { value, method }, &settings)?;
        }
    }
    Ok(())
}
