//! The timed calls: a plan, the implicit form after a closing, or differences of a plan.

use std::hint::black_box;

use sarrus_dynamics::{Field, FieldSet, ImplicitForm, Model, Plan, Query, Request, Slot, Status};

use crate::Outcome;
use crate::measure::timing::Timed;
use crate::reference::layout;
use crate::robots::{Planned, Question, Robot, Start};

/// α = β of Baumgarte's stabilisation in 1/s: a drift falls by a digit in 39 ms.
pub(super) const STABILISATION: f64 = 100.0;

/// A call that answers a question on each state.
pub(super) trait Runner: Timed {
    /// The numbers of the last answer, in the order of the question's fields.
    fn answer(&self) -> Vec<f64>;
}

impl Runner for Planned {
    fn answer(&self) -> Vec<f64> {
        self.output.clone()
    }
}

/// The query, with a guess for a warm start.
pub(super) fn with_start(mut query: Query, start: Start) -> Query {
    if start == Start::Warm {
        query.given = query.given.with(Field::QGuess);
    }
    query
}

/// Closing first, then q̈ of the whole tree under its loops.
pub(super) struct Implicit {
    closing: Planned,
    form: ImplicitForm<f64>,
    /// Forces on the tree, for each state.
    tau: Vec<Vec<f64>>,
    qdd: Vec<f64>,
    /// Indices of ÿ in q̈.
    independent: Vec<usize>,
}

impl Implicit {
    /// A runner on the states of a robot, whose loops are closed from this start.
    pub(super) fn new(
        model: &Model,
        robot: &Robot,
        place: usize,
        start: Start,
    ) -> Outcome<Implicit> {
        let query = Query::new(
            Request::Kinematics,
            FieldSet::of(&[Field::Y, Field::Yd]),
            FieldSet::of(&[Field::Q, Field::Qd]),
        );
        let plan = Plan::new(model, &with_start(query, start))?;
        let names = model.tree_names();
        let at = |name: &String| {
            let place = names.iter().position(|other| other == name);
            place.ok_or_else(|| format!("no velocity {name}"))
        };
        let active = model.active_names().iter().map(at).collect::<Result<Vec<usize>, String>>()?;
        let tau = robot.states.iter().map(|state| {
            let mut tau = vec![0.0; model.sizes().n_v];
            active.iter().zip(&state.tau_u).for_each(|(v, x)| tau[*v] = *x);
            tau
        });
        Ok(Implicit {
            tau: tau.collect(),
            qdd: vec![0.0; model.sizes().n_v],
            independent: model.independent_names().iter().map(at).collect::<Result<_, String>>()?,
            form: ImplicitForm::new(model),
            closing: Planned::new(model, plan, &robot.states, place),
        })
    }
}

impl Timed for Implicit {
    fn name(&self) -> String {
        format!("{}: implicit form", self.closing.model.name())
    }

    fn states(&self) -> usize {
        self.tau.len()
    }

    fn call(&mut self, state: usize) -> Status {
        let status = self.closing.call(state);
        if status != Status::Ok {
            return status;
        }
        let model = &self.closing.model;
        let [q, qd] = [Field::Q, Field::Qd].map(|field| self.closing.get(field));
        let gains = (STABILISATION, STABILISATION);
        let tau = &self.tau[state];
        let status = self.form.accelerations(model, q, qd, tau, &[], gains, &mut self.qdd);
        black_box(&self.qdd);
        status
    }
}

impl Runner for Implicit {
    fn answer(&self) -> Vec<f64> {
        self.independent.iter().map(|v| self.qdd[*v]).collect()
    }
}

/// Central differences of inverse or forward dynamics.
pub(super) struct Differences {
    plain: Planned,
    step: f64,
    /// For each derivative the first number of its variable, and its slot in the answer.
    parts: Vec<(usize, Slot)>,
    answer: Vec<f64>,
}

impl Differences {
    /// A runner of the derivatives that a question has, on the states of a robot without
    /// quaternions in y.
    pub(super) fn new(
        model: &Model,
        robot: &Robot,
        place: usize,
        (question, start): (Question, Start),
        step: f64,
    ) -> Outcome<Differences> {
        use Field::*;
        let plain = match question {
            Question::InverseDerivatives => Question::InverseDynamics,
            _ => Question::ForwardDynamics,
        };
        let plan = Plan::new(model, &with_start(plain.query(), start))?;
        let want = layout(robot, question);
        let variable = |slot: &Slot| match slot.field {
            DtauUDy | DyddDy => Some(Y),
            DtauUDyd | DyddDyd => Some(Yd),
            DyddDtauU => Some(TauU),
            _ => None,
        };
        let parts = want.slots().iter().filter_map(|slot| {
            let of = plan.given().slot(variable(slot)?)?;
            Some((of.offset, *slot))
        });
        Ok(Differences {
            parts: parts.collect(),
            step,
            answer: vec![0.0; want.len()],
            plain: Planned::new(model, plan, &robot.states, place),
        })
    }
}

impl Timed for Differences {
    fn name(&self) -> String {
        format!("{}: differences", self.plain.model.name())
    }

    fn states(&self) -> usize {
        self.plain.states()
    }

    fn call(&mut self, state: usize) -> Status {
        let Differences { plain, step, parts, answer } = self;
        let mut status = plain.call(state);
        let n = plain.output.len();
        answer[..n].copy_from_slice(&plain.output);
        for (first, slot) in parts {
            for column in 0..slot.columns {
                let at = *first + column;
                let x = plain.inputs[state][at];
                for side in [1.0, -1.0] {
                    plain.inputs[state][at] = x + side * *step;
                    let of = plain.call(state);
                    status = if of == Status::Ok { status } else { of };
                    for (row, value) in plain.output.iter().enumerate() {
                        let to = &mut answer[slot.offset + row * slot.columns + column];
                        let before = if side > 0.0 { 0.0 } else { *to };
                        *to = before + side * value / (2.0 * *step);
                    }
                }
                plain.inputs[state][at] = x;
            }
        }
        status
    }
}

impl Runner for Differences {
    fn answer(&self) -> Vec<f64> {
        self.answer.clone()
    }
}
