//! Where a simulation starts.

use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, QueryOptions, Request};

use crate::coordinates::{Coordinates, largest};
use crate::error::{Outcome, SimulationError, answered};

/// Change of a coordinate up to which a given pose counts as closed.
const CLOSED: f64 = 1e-9;
/// Largest deviation of a quaternion from unit length.
const UNIT: f64 = 1e-6;

/// Where a simulation starts.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// From the independents.
    Independent {
        /// y (n_qy).
        y: Vec<f64>,
        /// ẏ (n_vy).
        yd: Vec<f64>,
        /// A closed pose near it (n_q); without it the branch of the zero pose.
        guess: Option<Vec<f64>>,
    },
    /// From the whole tree. A state whose loops are open is closed at its independents and their
    /// velocities.
    Tree {
        /// q (n_q).
        q: Vec<f64>,
        /// q̇ (n_v).
        qd: Vec<f64>,
    },
}

/// A start that has been checked.
pub(crate) struct Checked {
    pub(crate) y: Vec<f64>,
    pub(crate) yd: Vec<f64>,
    /// A closed pose.
    pub(crate) guess: Vec<f64>,
    pub(crate) correction: [f64; 2],
}

impl Start {
    /// Checks the numbers, and closes a given tree state.
    pub(crate) fn check(&self, model: &Model<f64>) -> Outcome<Checked> {
        let y_of = Coordinates::of(model.independent_q_names(), model.independent_names());
        let q_of = Coordinates::of(model.tree_q_names(), model.tree_names());
        let pose = |what: &str, numbers: &[f64], names: &[String], of: &Coordinates| {
            SimulationError::check_numbers(what, numbers, names)?;
            let by = of.off_unit(numbers);
            if by < UNIT { Ok(()) } else { Err(SimulationError::NotUnit(what.to_owned(), by)) }
        };
        match self {
            Start::Independent { y, yd, guess } => {
                pose("y", y, model.independent_q_names(), &y_of)?;
                SimulationError::check_numbers("yd", yd, model.independent_names())?;
                let guess = match guess {
                    Some(guess) => {
                        pose("the guess of q", guess, model.tree_q_names(), &q_of)?;
                        guess.clone()
                    }
                    None => closed_from_zero(model, y)?,
                };
                Ok(Checked { y: y.clone(), yd: yd.clone(), guess, correction: [0.0; 2] })
            }
            Start::Tree { q, qd } => {
                pose("q", q, model.tree_q_names(), &q_of)?;
                SimulationError::check_numbers("qd", qd, model.tree_names())?;
                closed(model, q, qd, &q_of)
            }
        }
    }
}

/// The closed pose at y, where closures start from their own zero.
fn closed_from_zero(model: &Model<f64>, y: &[f64]) -> Outcome<Vec<f64>> {
    let [given, want] = [Field::Y, Field::Q].map(|field| FieldSet::of(&[field]));
    let query = Query::new(Request::Kinematics, given, want);
    let mut planned = Planned::new(model, &query.with_options(QueryOptions::SEARCH))?;
    planned.give(Field::Y, y);
    answered(planned.run(model).status)
        .map_err(|status| SimulationError::Start { status, detail: 0.0 })?;
    Ok(planned.get(Field::Q).to_vec())
}

/// The closed state with the independents of a given one.
fn closed(model: &Model<f64>, q: &[f64], qd: &[f64], tree: &Coordinates) -> Outcome<Checked> {
    use Field::*;
    let query = Query::new(
        Request::Kinematics,
        FieldSet::of(&[Q, Qd]),
        FieldSet::of(&[Y, Yd, Q, Qd, Residual]),
    )
    .with_options(QueryOptions::SEARCH);
    let mut planned = Planned::new(model, &query)?;
    planned.give(Q, q);
    planned.give(Qd, qd);
    if let Err(status) = answered(planned.run(model).status) {
        let residual = planned.get(Residual).iter().copied().find(|x| x.is_finite());
        return Err(SimulationError::Start { status, detail: residual.unwrap_or(0.0) });
    }
    let mut change = vec![0.0; model.sizes().n_v];
    tree.difference(q, planned.get(Q), &mut change);
    let moved = largest(change);
    let correction = [moved, largest(planned.get(Qd).iter().zip(qd).map(|(a, b)| a - b))];
    // a good state is left alone
    let guess = if moved < CLOSED { q } else { planned.get(Q) };
    Ok(Checked {
        y: planned.get(Y).to_vec(),
        yd: planned.get(Yd).to_vec(),
        guess: guess.to_vec(),
        correction,
    })
}
