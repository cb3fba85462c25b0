//! NaN, infinities and numbers beyond all squares as input.

use sarrus_dynamics::{Field, Request};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled};

use Field::*;

/// NaN, infinities and numbers beyond all squares in every field of every request.
pub(crate) fn run(cases: &mut Cases, _: &Effort) -> Outcome {
    cases.family("not a number", "what stands in the field: 1 NaN, 2 +∞, 3 −∞, 4 1e305");
    for name in ["lambda", "stewart_floating", "rh5v2_full"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let sizes = robot.compiled.model.sizes();
        let state = State::of(&robot, 0.1)?;
        let pose = Question::kinematics(&state).run(&robot.compiled.model)?;
        let field = |field: Field| (field, pose.get(field).to_vec());
        let link = robot.description.links.len() as u16 - 1;
        let given = |of: &[(Field, &[f64])]| {
            of.iter().map(|(field, x)| (*field, x.to_vec())).collect::<Vec<_>>()
        };
        let n_u = vec![1.0; sizes.n_u];
        let n_v = vec![1.0; sizes.n_v];
        let motion = given(&[(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)]);
        let asks = [
            Question::new(
                Request::Kinematics,
                [motion.clone(), vec![(QGuess, field(Q).1)]].concat(),
                &[Q, Qdd, U],
            ),
            Question::new(
                Request::Kinematics,
                vec![field(Q), field(Qd), field(Qdd)],
                &[Q, Yd, Ydd],
            ),
            Question::new(
                Request::Kinematics,
                vec![field(U), field(Ud), field(Udd), (QGuess, pose.get(Q).to_vec())],
                &[Q, Yd, Ydd],
            ),
            Question::new(Request::InverseDynamics, motion, &[TauY, TauU])
                .pushed(&[link], vec![1.0; 6]),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauY, &state.tau_y)]),
                &[Ydd, Qdd],
            ),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauU, &n_u)]),
                &[Ydd, Qdd],
            ),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauQ, &n_v)]),
                &[Ydd, Qdd],
            ),
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
                    // a huge number may be answered where the answer is right
                    let reference = if bad.is_finite() { Reference::Same } else { Reference::None };
                    cases.ask(&robot, at, &asked, &broken, &reference)?;
                }
            }
        }
    }
    Ok(())
}
