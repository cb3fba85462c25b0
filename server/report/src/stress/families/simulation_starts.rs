//! Simulations that start off their loops, or from numbers that are not finite.

use sarrus_dynamics::Field;
use sarrus_simulation::{Method, Settings, Start};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::runs::{Comparison, apart, setup};
use crate::stress::harness::simulations::{from, reference_run, settings};
use crate::stress::harness::sweep;

/// Starts off their loops are put on them, and how far is reported; numbers that are none are
/// refused.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("simulation off its loops", "rad or tenths of the length");
    for name in ["lambda", "wrist", "four_bars_2"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let state = State::of(&robot, 0.1)?;
        let closed = Question::kinematics(&state).run(&robot.compiled.model)?;
        let q = closed.get(Field::Q);
        let qd = closed.get(Field::Qd);
        let units = robot.units(Field::Q).unwrap_or_default();
        let names = robot.compiled.model.tree_q_names();
        let independent = |k: usize| robot.compiled.model.independent_q_names().contains(&names[k]);
        let reference = reference_run(
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
    let reference = reference_run(
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
