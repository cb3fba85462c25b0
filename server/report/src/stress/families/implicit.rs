//! The implicit form: projection of states off their loops, and accelerations under Baumgarte's
//! stabilisation.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, ImplicitForm, Status, Warnings};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::assess::assess;
use crate::stress::harness::case::{At, Case, Cases};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::mechanisms::bricard;
use crate::stress::sweep;

fn robots() -> Outcome<Vec<Robot>> {
    let list: [(&str, Description); 5] = [
        ("lambda", bundled("lambda")?),
        ("wrist", bundled("wrist")?),
        ("torso", bundled("torso")?),
        ("Bricard", bricard(false)),
        ("four bars", bundled("four_bars_2")?),
    ];
    list.into_iter().map(|(name, of)| Robot::new(name, of)).collect()
}

/// A closed state in all tree coordinates, the pose then moved off the loops by this much.
fn off_loops(robot: &Robot, value: f64) -> Outcome<(Vec<f64>, Vec<f64>)> {
    let closed = Question::kinematics(&State::of(robot, 0.1)?).run(&robot.compiled.model)?;
    let units = robot.units(Field::Q).unwrap_or_default();
    let off = |k: usize| {
        value * (2.4 * (k as f64 + 1.0)).sin() / units[k] * if units[k] == 1.0 { 1.0 } else { 0.1 }
    };
    let q = closed.get(Field::Q).iter().enumerate().map(|(k, q)| q + off(k)).collect();
    Ok((q, closed.get(Field::Qd).to_vec()))
}

/// Poses off their loops are moved onto them; how far they were is reported, and how far they then are
/// is measured in double-double.
pub(crate) fn projection(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("projection", "q off its loops, rad or tenths of the length");
    for robot in robots()? {
        for value in sweep(effort, -15, 0, 5) {
            let (mut q, mut qd) = off_loops(&robot, value)?;
            let given = q.clone();
            let status = ImplicitForm::new(&robot.compiled.model).project(
                &robot.compiled.model,
                &mut q,
                &mut qd,
            );
            let moved =
                q.iter().zip(&given).fold(0.0, |moved: f64, (a, b)| moved.max((a - b).abs()));
            let error = if status == Status::Ok { Some(open(&robot, &q)?) } else { None };
            let empty = q.iter().chain(&qd).all(|x| x.is_nan());
            let case = Case {
                status: status.name().to_owned(),
                error,
                reference: "loops in double-double",
                reported: if status == Status::Ok {
                    format!("moved by {moved:.1e}")
                } else {
                    String::new()
                },
                assessment: assess(status, Warnings::NONE, error.unwrap_or(f64::INFINITY), empty),
                ..cases.blank(&robot.name, At { value, method: robot.closures() }, "projection")
            };
            cases.all.push(case);
        }
    }
    Ok(())
}

/// How far a pose is from the closed one with its independents, by size.
fn open(robot: &Robot, q: &[f64]) -> Outcome<f64> {
    let names = robot.compiled.model.tree_q_names();
    let places = robot
        .compiled
        .model
        .independent_q_names()
        .iter()
        .filter_map(|name| names.iter().position(|x| x == name));
    let state =
        State { y: places.map(|at| q[at]).collect(), guess: Some(q.to_vec()), ..State::default() };
    let closed = Question::pose(&state).run(&robot.compiled.exact)?;
    if closed.status() != Status::Ok {
        return Ok(f64::INFINITY);
    }
    Ok(apart(q, closed.get(Field::Q), &robot.units(Field::Q).unwrap_or_default()))
}

fn apart(x: &[f64], reference: &[Dd], units: &[f64]) -> f64 {
    let (mut worst, mut size): (f64, f64) = (0.0, f64::MIN_POSITIVE);
    for ((x, reference), unit) in x.iter().zip(reference).zip(units) {
        let off = unit * (Dd::from(*x) - *reference).abs().hi();
        worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
        size = size.max(unit * reference.abs().hi());
    }
    worst / size
}

/// Stabilisation from none to stiff on loops that are open by a millionth.
pub(crate) fn baumgarte(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("Baumgarte", "α = β, 1/s, at loops open by 1e-6");
    let mut values = vec![0.0];
    values.extend(sweep(effort, 0, 9, 3));
    for robot in robots()? {
        for &value in &values {
            let (q, qd) = off_loops(&robot, 1e-6)?;
            let (model, exact) = (&robot.compiled.model, &robot.compiled.exact);
            let tau = vec![0.0; qd.len()];
            let mut qdd = vec![0.0; qd.len()];
            let status = ImplicitForm::new(model).accelerations(
                model,
                &q,
                &qd,
                &tau,
                &[],
                (value, value),
                &mut qdd,
            );
            let wide = |x: &[f64]| x.iter().map(|x| Dd::from(*x)).collect::<Vec<Dd>>();
            let mut reference = vec![Dd::ZERO; qd.len()];
            let gains = (Dd::from(value), Dd::from(value));
            let same = ImplicitForm::new(exact).accelerations(
                exact,
                &wide(&q),
                &wide(&qd),
                &wide(&tau),
                &[],
                gains,
                &mut reference,
            );
            let error = match (status, same) {
                (Status::Ok, Status::Ok) => {
                    Some(apart(&qdd, &reference, &robot.units(Field::Qdd).unwrap_or_default()))
                }
                (Status::Ok, _) => Some(f64::INFINITY),
                _ => None,
            };
            let case = Case {
                status: status.name().to_owned(),
                error,
                assessment: assess(
                    status,
                    Warnings::NONE,
                    error.unwrap_or(f64::INFINITY),
                    qdd.iter().all(|x| x.is_nan()),
                ),
                ..cases.blank(&robot.name, At { value, method: "kkt" }, "q̈")
            };
            cases.all.push(case);
        }
    }
    Ok(())
}
