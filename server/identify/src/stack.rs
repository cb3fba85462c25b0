//! Rows of forces by parameters at one state after the other.

use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, QueryOptions, Request, Status};

use crate::Outcome;
use crate::dense::dot;
use crate::log::Sample;

/// Answers states with their rows.
pub(crate) struct Stack<'a> {
    model: &'a Model<f64>,
    planned: Planned,
    parameters: Vec<f64>,
    /// Rows are those of the actuators: each mechanism has as many as freedoms. Otherwise those of
    /// the independents.
    by_actuators: bool,
}

impl<'a> Stack<'a> {
    pub(crate) fn new(model: &'a Model<f64>) -> Outcome<Stack<'a>> {
        let mut independents = model.independent_clusters();
        let mut actuators = model.actuator_clusters();
        independents.sort_unstable();
        actuators.sort_unstable();
        let by_actuators = independents == actuators;
        let given = [Field::Y, Field::Yd, Field::Ydd];
        let rows = [
            if by_actuators { Field::RegressorU } else { Field::RegressorY },
            if by_actuators { Field::TauU } else { Field::TauY },
        ];
        let want = [&rows[..], &[Field::GU]].concat();
        let query = Query::new(Request::InverseDynamics, FieldSet::of(&given), FieldSet::of(&want))
            .with_options(QueryOptions::FRICTION);
        let planned = Planned::new(model, &query)?;
        Ok(Stack { parameters: model.parameters(), planned, model, by_actuators })
    }

    /// Rows at each state.
    pub(crate) fn n_rows(&self) -> usize {
        let sizes = self.model.sizes();
        if self.by_actuators { sizes.n_u } else { sizes.n_vy }
    }

    /// Computes a state.
    pub(crate) fn at(&mut self, sample: &Sample) -> Status {
        self.planned.give(Field::Y, &sample.y);
        self.planned.give(Field::Yd, &sample.yd);
        self.planned.give(Field::Ydd, &sample.ydd);
        self.planned.run(self.model).status
    }

    /// The rows of the state.
    pub(crate) fn rows(&self) -> impl Iterator<Item = &[f64]> {
        let field = if self.by_actuators { Field::RegressorU } else { Field::RegressorY };
        self.planned.get(field).chunks_exact(self.parameters.len().max(1))
    }

    /// The part of the measured forces that parameters explain: without springs.
    pub(crate) fn explained(&self, tau_u: &[f64]) -> Vec<f64> {
        let n_vy = self.model.sizes().n_vy;
        let measured = if self.by_actuators {
            tau_u.to_vec()
        } else {
            let G_u = self.planned.get(Field::GU);
            (0..n_vy)
                .map(|k| (tau_u.iter().enumerate()).map(|(u, x)| G_u[u * n_vy + k] * x).sum())
                .collect()
        };
        let field = if self.by_actuators { Field::TauU } else { Field::TauY };
        let of_model = self.planned.get(field);
        let others =
            of_model.iter().zip(self.rows()).map(|(tau, row)| tau - dot(row, &self.parameters));
        measured.iter().zip(others).map(|(tau, others)| tau - others).collect()
    }
}
