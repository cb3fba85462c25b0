//! Projection of states off their loops.

use sarrus_dynamics::{Field, ImplicitForm, Status, Warnings};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::assess::assess;
use crate::stress::harness::case::{At, Case, Cases};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::Robot;
use crate::stress::harness::sweep;
use crate::stress::mechanisms::open_loops::{apart, off_loops, robots};

/// Poses off their loops are moved onto them; how far they were is reported, and how far they then
/// are is measured in double-double.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
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
