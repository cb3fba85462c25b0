//! NaN, infinities and numbers with overflowing squares as input.

use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::{At, Cases, Question, Reference, Robot, State, bundled};

use Field::*;

/// NaN, infinities and numbers with overflowing squares in every field of every request.
pub(crate) fn all(cases: &mut Cases, _: &Effort) -> Outcome {
    for name in ["lambda", "stewart_floating", "rh5v2_full"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let sizes = robot.compiled.model.sizes();
        let state = State::of(&robot, 0.1)?;
        let pose = Question::kinematics(&state).run(&robot.compiled.model)?;
        let field = |field: Field| (field, pose.get(field).to_vec());
        let link = robot.description.links.len() as u16 - 1;
        let [y, yd, ydd] = [(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)]
            .map(|(field, numbers)| (field, numbers.clone()));
        let given_y = vec![y.clone(), yd.clone(), ydd.clone()];
        let with_guess = vec![y.clone(), yd.clone(), ydd, (QGuess, pose.get(Q).to_vec())];
        let given_q = vec![field(Q), field(Qd), field(Qdd)];
        let given_u = vec![field(U), field(Ud), field(Udd), (QGuess, pose.get(Q).to_vec())];
        let forces = |field: Field, numbers: Vec<f64>| {
            let given = vec![y.clone(), yd.clone(), (field, numbers)];
            Question::new(Request::ForwardDynamics, given, &[Ydd, Qdd])
        };
        let asks = [
            Question::new(Request::Kinematics, with_guess, &[Q, Qdd, U]),
            Question::new(Request::Kinematics, given_q, &[Q, Yd, Ydd]),
            Question::new(Request::Kinematics, given_u, &[Q, Yd, Ydd]),
            Question::new(Request::InverseDynamics, given_y, &[TauY, TauU])
                .pushed(&[link], vec![1.0; 6]),
            forces(TauY, state.tau_y.clone()),
            forces(TauU, vec![1.0; sizes.n_u]),
            forces(TauQ, vec![1.0; sizes.n_v]),
        ];
        for ask in &asks {
            for (k, (field, numbers)) in ask.given.iter().enumerate() {
                for (method, bad, value) in [
                    ("NaN", f64::NAN, 1.0),
                    ("+∞", f64::INFINITY, 2.0),
                    ("−∞", f64::NEG_INFINITY, 3.0),
                    ("1e305", 1e305, 4.0),
                ] {
                    let mut broken = ask.clone();
                    broken.given[k].1[numbers.len() / 2] = bad;
                    let at = At { value, method };
                    let asked = format!("{}, {}", ask.name(), field.name());
                    // a huge number may have an answer if it is right
                    let reference = if bad.is_finite() { Reference::Same } else { Reference::None };
                    cases.ask(&robot, at, &asked, &broken, &reference)?;
                }
            }
        }
    }
    Ok(())
}
