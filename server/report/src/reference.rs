//! References: the same model, the same inputs, the same code in double-double.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, FieldSet, Layout, Method, Plan, Planned, Status};

use crate::Outcome;
use crate::robots::{Question, Robot, Start, Subject, packed};

/// A question in double-double.
pub struct Reference {
    /// Place of the variant among those of its robot.
    place: usize,
    planned: Planned<Dd>,
    /// The answer on each state, once computed.
    outputs: Vec<Vec<Dd>>,
}

impl Reference {
    /// For a question to a variant of a robot.
    pub fn new(
        robot: &Robot,
        place: usize,
        question: Question,
        start: Start,
    ) -> Outcome<Reference> {
        let mut query = question.query();
        // the warm start leads to the pose that a cold one must find
        if start != Start::None {
            query.given = query.given.with(Field::QGuess);
        }
        if question.is_forward() {
            query.want =
                [Field::MY, Field::CY, Field::TauY].into_iter().fold(query.want, FieldSet::with);
        }
        let model = &robot.variants[place].compiled.exact;
        // M_y of a chain is only read, not factorised: that would take n³
        let plan = match robot.subject {
            Subject::Chain(_) => Plan::with_method(model, &query, Method::Recursion)?,
            _ => Plan::new(model, &query)?,
        };
        Ok(Reference { place, planned: Planned::of(model, plan), outputs: Vec::new() })
    }

    /// Computes missing answers on all states up to this one.
    pub fn compute(&mut self, robot: &Robot, state: usize) -> Outcome {
        let model = &robot.variants[self.place].compiled.exact;
        for state in self.outputs.len()..=state {
            let input = packed(&self.planned.plan, &robot.states[state], self.place);
            self.planned.input = input.into_iter().map(Dd::from).collect();
            let answer = self.planned.run(model);
            if answer.status != Status::Ok {
                let Robot { name, .. } = robot;
                let status = answer.status;
                return Err(format!("{name}, state {state}: {status} in double-double").into());
            }
            self.outputs.push(self.planned.output.clone());
        }
        Ok(())
    }

    /// The exact numbers of a field at a state.
    fn numbers(&self, state: usize, field: Field) -> &[Dd] {
        let slot = self.planned.plan.want().slot(field);
        slot.map_or(&[], |slot| &self.outputs[state][slot.range()])
    }

    /// The largest error by size of all fields of an answer at a state.
    pub fn error(&self, want: &Layout, state: usize, answer: &[f64]) -> f64 {
        let speed = largest(self.numbers(state, Field::Qd));
        let errors = want.slots().iter().map(|slot| {
            let least = match slot.field {
                Field::Q | Field::U => 1.0,
                Field::Qdd | Field::Udd => speed * speed,
                _ => 0.0,
            };
            let pairs = answer[slot.range()].iter().zip(self.numbers(state, slot.field));
            by_size(pairs.map(|(a, b)| ((Dd::from(*a) - *b).to_f64(), b.to_f64())), least)
        });
        errors.fold(0.0, worse)
    }

    /// The change of the forces that would make ÿ at a state exact, relative to the terms of the
    /// equation.
    pub fn backward_error(&self, state: usize, ydd: &[f64]) -> f64 {
        let [m_y, c_y, tau_y] =
            [Field::MY, Field::CY, Field::TauY].map(|field| self.numbers(state, field));
        let n = ydd.len();
        let mut residual: f64 = 0.0;
        let mut norm_m: f64 = 0.0;
        for i in 0..n {
            let row = &m_y[i * n..(i + 1) * n];
            let product = row.iter().zip(ydd).fold(Dd::from(0.0), |sum, (m, x)| sum + *m * *x);
            residual = residual.max((product + c_y[i] - tau_y[i]).to_f64().abs());
            norm_m = norm_m.max(row.iter().map(|m| m.to_f64().abs()).sum());
        }
        let size = ydd.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        residual / (norm_m * size + largest(c_y) + largest(tau_y))
    }
}

/// Exact answers, by question, variant and start.
pub(crate) struct References<'a> {
    robot: &'a Robot,
    kept: Vec<((Question, usize, bool), Reference)>,
}

impl<'a> References<'a> {
    pub(crate) fn new(robot: &'a Robot) -> References<'a> {
        References { robot, kept: Vec::new() }
    }

    /// The error of an answer at a state, with the numbers of `want`: on chains, for ÿ, that of the
    /// forces.
    pub(crate) fn error(
        &mut self,
        (question, place, start): (Question, usize, Start),
        want: &Layout,
        state: usize,
        answer: &[f64],
    ) -> Outcome<f64> {
        // a cold start must find the pose that a warm one leads to
        let key = (question, place, start != Start::None);
        let kept = self.kept.iter().position(|(of, _)| *of == key);
        if kept.is_none() {
            self.kept.push((key, Reference::new(self.robot, place, question, start)?));
        }
        let kept = kept.unwrap_or(self.kept.len() - 1);
        let reference = &mut self.kept[kept].1;
        reference.compute(self.robot, state)?;
        let chain = matches!(self.robot.subject, Subject::Chain(_));
        Ok(if chain && question == Question::ForwardDynamics {
            reference.backward_error(state, answer)
        } else {
            reference.error(want, state, answer)
        })
    }

    /// The error of a peer's answer; for states of q alone. NaN if a number is missing.
    pub(crate) fn of_peer(
        &mut self,
        (question, start): (Question, Start),
        state: usize,
        answer: &[f64],
    ) -> Outcome<f64> {
        let mut query = question.query();
        if question == Question::State {
            query.want = FieldSet::of(&[Field::Q]);
        }
        let want = Layout::of_want(&query, self.robot.variants[0].compiled.model.info());
        if answer.len() != want.len() {
            return Ok(f64::NAN);
        }
        self.error((question, 0, start), &want, state, answer)
    }
}

/// The numbers of a question to this robot.
pub(crate) fn layout(robot: &Robot, question: Question) -> Layout {
    Layout::of_want(&question.query(), robot.variants[0].compiled.model.info())
}

/// The largest of some errors by the size of the largest of their references, or by `least` where
/// that is larger; pairs of error and reference. A NaN error counts as infinite.
pub(crate) fn by_size(pairs: impl IntoIterator<Item = (f64, f64)>, least: f64) -> f64 {
    let mut worst: f64 = 0.0;
    let mut size = least.max(f64::MIN_POSITIVE);
    for (error, reference) in pairs {
        worst = if error.is_nan() { f64::INFINITY } else { worst.max(error.abs()) };
        size = size.max(reference.abs());
    }
    if worst == 0.0 { 0.0 } else { worst / size }
}

/// The larger of two errors; NaN if either is.
pub(crate) fn worse(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// ‖x‖∞.
fn largest(x: &[Dd]) -> f64 {
    x.iter().fold(0.0, |size, x| size.max(x.to_f64().abs()))
}
