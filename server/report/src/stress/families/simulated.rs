//! Simulations: stiff springs and dampers, high gains, steps and tolerances, what must be
//! conserved, starts that are none.

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind, Terms};
use sarrus_dynamics::scalar::Scalar;
use sarrus_dynamics::{Field, Request};
use sarrus_simulation::{Input, Method, Run, Settings, Setup, Source, Space, Start, simulate};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::robot::{Draft, Robot, Slide, X, bundled};
use crate::stress::harness::runs::{Comparison, apart, setup};
use crate::stress::mechanisms::rods;
use crate::stress::sweep;

/// Samples of a run.
const SAMPLES: f64 = 100.0;

/// What the methods are asked for: a fixed step, or tolerances, and no more steps than a user would
/// wait for.
fn settings(method: Method, duration: f64) -> Settings {
    let step = method.is_fixed().then_some(1e-3 * duration);
    Settings {
        step,
        rtol: 1e-12,
        atol: 1e-13,
        every: Some(duration / SAMPLES),
        most_steps: 5_000,
        ..Settings::new(method, duration)
    }
}

/// By the implicit method as exactly as it can.
fn reference(setup: &Setup<'_>, start: &Start, like: Settings) -> Outcome<Run> {
    let exact = Settings { rtol: 1e-13, atol: 1e-15, most_steps: 1_000_000, ..like };
    let run = simulate(setup, start, &exact, &mut |_| ())?;
    if run.end.is_finished() {
        Ok(run)
    } else {
        Err(format!("the reference ended as {}", run.end.name()).into())
    }
}

/// A mass of 1 kg on a slider, with a spring and a damper.
fn oscillator(stiffness: f64, damping: f64) -> Outcome<Robot> {
    let mut of = Draft::new(Kind::Serial);
    of.joint(0, Slide, [0.0; 3], X);
    of.description.gravity = [0.0; 3];
    let mut of = of.finish(&[0], &[0]);
    of.joints[0].terms = Terms { stiffness, damping, ..Terms::default() };
    Robot::new("mass on a spring", of)
}

/// Where it is after t when it starts at 1 from rest.
fn swung(stiffness: f64, damping: f64, t: f64) -> f64 {
    let (decay, square) = (0.5 * damping, 0.25 * damping * damping - stiffness);
    if square < 0.0 {
        let (sine, cosine) = ((-square).sqrt() * t).sin_cos();
        return (-decay * t).exp() * (cosine + decay / (-square).sqrt() * sine);
    }
    // the slow root from the product of both, which are k
    let fast = -decay - square.sqrt();
    let slow = stiffness / fast;
    (fast * (slow * t).exp() - slow * (fast * t).exp()) / (fast - slow)
}

/// Springs, dampers and gains that get stiffer: explicit methods have to say that they fail, the
/// implicit one holds.
pub(crate) fn stiff(cases: &mut Cases, effort: &Effort) -> Outcome {
    let kinds: [(&str, &str, fn(f64) -> (f64, f64)); 2] = [
        ("simulated spring", "stiffness, N/m", |k| (k, k.sqrt())),
        ("simulated damper", "damping, N s/m", |c| (1.0, c)),
    ];
    for (family, parameter, constants) in kinds {
        cases.family(family, parameter);
        for value in sweep(effort, 0, 9, 3) {
            let (stiffness, damping) = constants(value);
            let robot = oscillator(stiffness, damping)?;
            let error = |run: &Run| {
                Ok(run.samples.iter().fold(0.0, |e: f64, at| {
                    e.max((at.y[0] - swung(stiffness, damping, at.time)).abs())
                }))
            };
            let comparison = Comparison { error: &error, reference: "closed form" };
            every_method(
                cases,
                "mass on a spring",
                value,
                &setup(&robot),
                &from(&[1.0], &[0.0]),
                &comparison,
            )?;
        }
    }
    cases.family("simulated stiff joint", "stiffness, N m/rad");
    for value in sweep(effort, 0, 9, 3) {
        let mut of = rods(2);
        of.joints[1].terms = Terms { stiffness: value, damping: value.sqrt(), ..Terms::default() };
        against_reference(cases, "2 rods", value, of, &[])?;
    }
    cases.family("simulated gains", "kp of all actuators, kd its root");
    for name in ["lambda", "torso"] {
        for value in sweep(effort, 0, 9, 3) {
            let of = bundled(name)?;
            let n_u = Robot::new(name, of.clone())?.compiled.model.sizes().n_u;
            let source = Source::Gains {
                stiffness: vec![value; n_u],
                damping: vec![value.sqrt(); n_u],
                target: vec![0.01; n_u],
            };
            against_reference(cases, name, value, of, &[Input { space: Space::Actuator, source }])?;
        }
    }
    Ok(())
}

fn from(y: &[f64], yd: &[f64]) -> Start {
    Start::Independent { y: y.to_vec(), yd: yd.to_vec(), guess: None }
}

fn against_reference(
    cases: &mut Cases,
    name: &str,
    value: f64,
    of: Description,
    inputs: &[Input],
) -> Outcome {
    let robot = Robot::new(name, of)?;
    let setup = Setup { inputs, ..setup(&robot) };
    let state = State::of(&robot, 0.1)?;
    let start = from(&state.y, &vec![0.0; state.yd.len()]);
    let reference = reference(&setup, &start, settings(Method::Radau5, 1.0))?;
    let comparison =
        Comparison { error: &|run| Ok(apart(run, &reference)), reference: "Radau at 1e-13" };
    every_method(cases, name, value, &setup, &start, &comparison)
}

fn every_method(
    cases: &mut Cases,
    name: &str,
    value: f64,
    setup: &Setup<'_>,
    start: &Start,
    comparison: &Comparison<'_>,
) -> Outcome {
    for method in Method::ALL {
        cases.simulation(
            name,
            At { value, method: method.name() },
            setup,
            start,
            &settings(method, 1.0),
            comparison,
        )?;
    }
    Ok(())
}

/// Fixed steps from too long to short, tolerances from none to all.
pub(crate) fn steps(cases: &mut Cases, effort: &Effort) -> Outcome {
    for name in ["pendulum", "lambda", "four_bars_2"] {
        let robot = Robot::new(name, if name == "pendulum" { rods(1) } else { bundled(name)? })?;
        let start = from(&[0.3], &[1.0]);
        // compared at the end alone: samples on the way would shorten the steps
        let reference = reference(
            &setup(&robot),
            &start,
            Settings { every: Some(1.0), ..settings(Method::Radau5, 1.0) },
        )?;
        let comparison =
            Comparison { error: &|run| Ok(apart(run, &reference)), reference: "Radau at 1e-13" };
        cases.family("step", "s");
        for method in [Method::Euler, Method::RungeKutta] {
            for value in sweep(effort, -4, 0, 4) {
                let settings = Settings {
                    step: Some(value),
                    every: Some(1.0),
                    most_steps: 20_000,
                    ..settings(method, 1.0)
                };
                cases.simulation(
                    name,
                    At { value, method: method.name() },
                    &setup(&robot),
                    &start,
                    &settings,
                    &comparison,
                )?;
            }
        }
        cases.family("tolerance", "relative and absolute tolerance");
        for method in [Method::Dop853, Method::Radau5] {
            for value in sweep(effort, -13, -1, 4) {
                let settings = Settings {
                    rtol: value,
                    atol: value,
                    every: Some(1.0),
                    ..settings(method, 1.0)
                };
                cases.simulation(
                    name,
                    At { value, method: method.name() },
                    &setup(&robot),
                    &start,
                    &settings,
                    &comparison,
                )?;
            }
        }
    }
    Ok(())
}

/// Without gravity and damping the energy stays, and the angular momentum about the first axis:
/// (M_y ẏ) of the first joint.
pub(crate) fn conserved(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("conservation", "s simulated without gravity, damping and forces");
    let mut of = rods(3);
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
    let comparison = Comparison { error: &error, reference: "energy and momentum" };
    for value in sweep(effort, -1, if effort.quick { 1 } else { 2 }, 2) {
        for method in Method::ALL {
            let settings = Settings {
                step: method.is_fixed().then_some(1e-3),
                most_steps: 400_000,
                ..settings(method, value)
            };
            cases.simulation(
                "3 rods",
                At { value, method: method.name() },
                &setup(&robot),
                &from(&state.y, &state.yd),
                &settings,
                &comparison,
            )?;
        }
    }
    Ok(())
}

/// Starts off their loops are put on them, and how far is reported; numbers that are none are refused.
pub(crate) fn starts(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("simulation off its loops", "rad or tenths of the length");
    for name in ["lambda", "wrist", "four_bars_2"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let state = State::of(&robot, 0.1)?;
        let closed = Question::kinematics(&state).run(&robot.compiled.model)?;
        let (q, qd, units) = (
            closed.get(Field::Q),
            closed.get(Field::Qd),
            robot.units(Field::Q).unwrap_or_default(),
        );
        let names = robot.compiled.model.tree_q_names();
        let independent = |k: usize| robot.compiled.model.independent_q_names().contains(&names[k]);
        let reference = reference(
            &setup(&robot),
            &Start::Tree { q: q.to_vec(), qd: qd.to_vec() },
            settings(Method::Radau5, 0.1),
        )?;
        let comparison = Comparison {
            error: &|run| Ok(apart(run, &reference)),
            reference: "from the closed pose",
        };
        for value in sweep(effort, -15, -1, 4) {
            let off = |k: usize| {
                if independent(k) {
                    0.0
                } else {
                    value * (2.4 * k as f64).sin() / units[k]
                        * if units[k] == 1.0 { 1.0 } else { 0.1 }
                }
            };
            let start = Start::Tree {
                q: q.iter().enumerate().map(|(k, q)| q + off(k)).collect(),
                qd: qd.to_vec(),
            };
            cases.simulation(
                name,
                At { value, method: "dop853" },
                &setup(&robot),
                &start,
                &settings(Method::Dop853, 0.1),
                &comparison,
            )?;
        }
    }
    cases.family("simulation of nothing", "what is wrong: 1 NaN, 2 ∞, 3 zero, 4 negative, 5 1e300");
    let robot = Robot::new("lambda", bundled("lambda")?)?;
    // a step that is longer than the whole is the whole
    let reference = reference(
        &setup(&robot),
        &from(&[0.1], &[0.0]),
        Settings { every: Some(0.1), ..settings(Method::Radau5, 0.1) },
    )?;
    let wrong = Comparison {
        error: &|run| Ok(if run.time == 0.1 { apart(run, &reference) } else { f64::INFINITY }),
        reference: "Radau at 1e-13",
    };
    for (value, bad) in
        [(1.0, f64::NAN), (2.0, f64::INFINITY), (3.0, 0.0), (4.0, -1.0), (5.0, 1e300)]
    {
        let plain = Settings { every: Some(0.1), ..settings(Method::RungeKutta, 0.1) };
        let mut one = |method: &str, start: Start, settings: &Settings| {
            cases.simulation(
                "lambda",
                At { value, method },
                &setup(&robot),
                &start,
                settings,
                &wrong,
            )
        };
        one("step", from(&[0.1], &[0.0]), &Settings { step: Some(bad), ..plain })?;
        one("duration", from(&[0.1], &[0.0]), &Settings { duration: bad, ..plain })?;
        if bad != 0.0 && bad != -1.0 {
            one("y", from(&[bad], &[0.0]), &plain)?;
            one("ẏ", from(&[0.1], &[bad]), &plain)?;
        }
    }
    Ok(())
}
