//! Chains of 10 to 10,000 bodies and loops: time per body, and the error of forward dynamics as
//! inverse dynamics sees it.

use sarrus_dynamics::{Field, Method, Status};

use crate::Outcome;
use crate::measure::Effort;
use crate::robots::chain::chain_of_lambdas;
use crate::stress::harness::{At, Case, Cases, Question, Reference, Robot, State, backward_error};
use crate::stress::mechanisms::rods;

/// Velocities up to which methods with square matrices run.
const LARGEST_SQUARE: usize = 100;

pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let lengths: &[usize] =
        if effort.quick { &[10, 100, 1000] } else { &[10, 30, 100, 300, 1000, 3000, 10_000] };
    for &n in lengths {
        for (name, lambdas) in [("rods in a row", false), ("lambdas in a row", true)] {
            // of three bodies each
            if lambdas && n > 3000 {
                continue;
            }
            let of = if lambdas { chain_of_lambdas(n)? } else { rods(n)? };
            let at = At { value: n as f64, method: "-" };
            let Some(robot) = cases.load(name, at, of) else { continue };
            // a long chain that curls up on itself is not a robot
            let mut state = State::of(&robot, 0.2 / (n as f64).sqrt())?;
            state.yd.iter_mut().for_each(|x| *x *= 0.2 / (n as f64).sqrt());
            state.forces(&robot)?;
            one(cases, &robot, n, &state)?;
        }
    }
    Ok(())
}

fn one(cases: &mut Cases, robot: &Robot, n: usize, state: &State) -> Outcome {
    let value = n as f64;
    let ask = Question::inverse(state, &[Field::TauY]);
    let nanoseconds = ask.run(&robot.compiled.model)?.nanoseconds(&robot.compiled.model, 5);
    cases
        .ask(robot, At { value, method: "recursion" }, "ID", &ask, &Reference::Same)?
        .nanoseconds = Some(nanoseconds);
    for method in Method::ALL {
        if method != Method::Recursion && n > LARGEST_SQUARE {
            continue;
        }
        let ask = Question::forward(state, Some(method));
        let mut answer = ask.run(&robot.compiled.model)?;
        let backward = if answer.status() == Status::Ok {
            Some(backward_error(robot, &ask, &answer)?)
        } else {
            None
        };
        // assessed by the backward error: the condition of M_y grows like n⁴, so that no method can
        // do better forwards
        let at = At { value, method: method.name() };
        cases.all.push(Case {
            reference: "ID∘FD in double-double",
            backward,
            nanoseconds: Some(answer.nanoseconds(&robot.compiled.model, 5)),
            ..cases.answered(robot, at, "FD", &answer, backward)
        });
    }
    Ok(())
}
