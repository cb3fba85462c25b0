//! One question in any scalar, and the distance of two answers.

use std::collections::HashMap;

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Answer, Field, FieldSet, Method, Model, Plan, PlanScalar, Planned, Query, QueryOptions,
    Request, Status, Warnings,
};

use super::robot::Robot;
use crate::Outcome;
use crate::reference::by_size;

use Field::*;

/// A question to a robot.
#[derive(Clone, Debug)]
pub(crate) struct Question {
    pub(crate) request: Request,
    /// The method of forward dynamics; none for the model's choice.
    pub(crate) method: Option<Method>,
    pub(crate) given: Vec<(Field, Vec<f64>)>,
    pub(crate) want: Vec<Field>,
    /// Links that wrenches act on.
    pub(crate) wrenches: Vec<u16>,
    /// Links whose frames are wanted.
    pub(crate) frames: Vec<u16>,
}

/// Pose, motion and forces of a robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct State {
    pub(crate) y: Vec<f64>,
    pub(crate) yd: Vec<f64>,
    pub(crate) ydd: Vec<f64>,
    pub(crate) tau_y: Vec<f64>,
    pub(crate) guess: Option<Vec<f64>>,
}

/// The k-th number of a fixed scatter in ±1, none of them near zero.
fn scatter(k: usize) -> f64 {
    let x = ((k + 1) as f64 * 0.754_877_666_246_692_7).fract();
    if x < 0.5 { -1.0 + 1.4 * x } else { 0.3 + 1.4 * (x - 0.5) }
}

impl State {
    /// A state within `reach` radians, or that many tenths of the robot's length where a joint
    /// slides; forces of the size of its inverse dynamics.
    pub(crate) fn of(robot: &Robot, reach: f64) -> Outcome<State> {
        let model = &robot.compiled.model;
        let units = |field| robot.units(field);
        let names = model.independent_q_names();
        let of_v = units(Yd);
        let unit_of: HashMap<&String, f64> = model.tree_q_names().iter().zip(units(Q)).collect();
        let y = names.iter().enumerate().map(|(k, name)| match name.rsplit_once('/') {
            Some((_, "qw")) => 0.8,
            Some((_, "qx" | "qz")) => 0.36,
            Some((_, "qy")) => (1.0_f64 - 0.8 * 0.8 - 2.0 * 0.36 * 0.36).sqrt(),
            _ => {
                let unit = unit_of.get(name).copied().unwrap_or(1.0);
                scatter(k) * reach / unit * if unit == 1.0 { 1.0 } else { 0.1 }
            }
        });
        let rates = |shift: usize, size: f64| {
            of_v.iter()
                .enumerate()
                .map(|(k, unit)| scatter(k + shift) * size / unit)
                .collect::<Vec<f64>>()
        };
        let mut state =
            State { y: y.collect(), yd: rates(7, 1.0), ydd: rates(13, 3.0), ..State::default() };
        state.forces(robot)?;
        Ok(state)
    }

    /// Forces that give approximately its ÿ.
    pub(crate) fn forces(&mut self, robot: &Robot) -> Outcome {
        let motion = Question::inverse(self, &[TauY]).run(&robot.compiled.model)?;
        let one = |(k, tau): (usize, &f64)| {
            if tau.is_finite() { tau * (1.0 + 0.5 * scatter(k + 3)) } else { 1.0 }
        };
        self.tau_y = motion.get(TauY).iter().enumerate().map(one).collect();
        Ok(())
    }

    fn positions(&self) -> Vec<(Field, Vec<f64>)> {
        let guess = self.guess.iter().map(|guess| (QGuess, guess.clone()));
        std::iter::once((Y, self.y.clone())).chain(guess).collect()
    }

    fn given(&self, field: Field, numbers: &[f64]) -> Vec<(Field, Vec<f64>)> {
        let mut given = self.positions();
        given.extend([(Yd, self.yd.clone()), (field, numbers.to_vec())]);
        given
    }
}

/// Displacement of each tree coordinate that opens loops: up to `size` radians, or tenths of the
/// robot's length. `first` numbers the first coordinate.
pub(crate) fn offsets(robot: &Robot, size: f64, first: usize) -> Vec<f64> {
    let units = robot.units(Q);
    let off = |(k, unit): (usize, &f64)| {
        let share = if *unit == 1.0 { 1.0 } else { 0.1 };
        size * (2.4 * (k + first) as f64).sin() / unit * share
    };
    units.iter().enumerate().map(off).collect()
}

/// A closed state in all tree coordinates, with the pose moved off the loops by this much.
pub(crate) fn off_loops(robot: &Robot, value: f64) -> Outcome<(Vec<f64>, Vec<f64>)> {
    let closed = Question::kinematics(&State::of(robot, 0.1)?).run(&robot.compiled.model)?;
    let pairs = closed.get(Q).iter().zip(offsets(robot, value, 1));
    Ok((pairs.map(|(q, off)| q + off).collect(), closed.get(Qd).to_vec()))
}

impl Question {
    pub(crate) fn new(request: Request, given: Vec<(Field, Vec<f64>)>, want: &[Field]) -> Question {
        let wrenches = vec![];
        let frames = vec![];
        Question { request, method: None, given, want: want.to_vec(), wrenches, frames }
    }

    /// q, q̇, q̈, u, u̇, ü.
    pub(crate) fn kinematics(of: &State) -> Question {
        Question::new(Request::Kinematics, of.given(Ydd, &of.ydd), &[Q, Qd, Qdd, U, Ud, Udd])
    }

    /// The pose alone.
    pub(crate) fn pose(of: &State) -> Question {
        Question::new(Request::Kinematics, of.positions(), &[Q])
    }

    pub(crate) fn inverse(of: &State, want: &[Field]) -> Question {
        Question::new(Request::InverseDynamics, of.given(Ydd, &of.ydd), want)
    }

    /// ÿ from τ_y.
    pub(crate) fn forward(of: &State, method: Option<Method>) -> Question {
        Question {
            method,
            ..Question::new(Request::ForwardDynamics, of.given(TauY, &of.tau_y), &[Ydd])
        }
    }

    /// The question with wrenches on these links.
    pub(crate) fn pushed(mut self, links: &[u16], wrenches: Vec<f64>) -> Question {
        self.wrenches = links.to_vec();
        self.given.push((Wrenches, wrenches));
        self
    }

    /// The request, in a word.
    pub(crate) fn name(&self) -> &'static str {
        match self.request {
            Request::Kinematics => "kinematics",
            Request::InverseDynamics => "ID",
            Request::ForwardDynamics => "FD",
            _ => "map",
        }
    }

    /// The answer of a model.
    pub(crate) fn run<T: PlanScalar>(&self, model: &Model<T>) -> Outcome<Answered<T>> {
        self.run_with(model, &|_, x| T::from_f64(x))
    }

    /// The answer of a model, with each given number converted by `number` from its index and
    /// value.
    pub(crate) fn run_with<T: PlanScalar>(
        &self,
        model: &Model<T>,
        number: &dyn Fn(usize, f64) -> T,
    ) -> Outcome<Answered<T>> {
        let given = self.given.iter().fold(FieldSet::EMPTY, |set, (field, _)| set.with(*field));
        let query = Query::new(self.request, given, FieldSet::of(&self.want));
        // statuses and helps of a failure as the longest search finds them
        let query = query.with_frames(&self.frames).with_options(QueryOptions::SEARCH);
        let query =
            if self.wrenches.is_empty() { query } else { query.with_wrenches(&self.wrenches) };
        let plan = match self.method {
            Some(method) => Plan::with_method(model, &query, method)?,
            None => Plan::new(model, &query)?,
        };
        let mut planned = Planned::of(model, plan);
        for (field, numbers) in &self.given {
            let slot = planned.plan.given().slot(*field).ok_or("a field that is not packed")?;
            let place = &mut planned.input[slot.range()];
            if place.len() != numbers.len() {
                let counts = [numbers.len(), place.len()];
                return Err(
                    format!("{}: given and expected numbers {counts:?}", field.name()).into()
                );
            }
            let numbers = numbers.iter().enumerate();
            place.iter_mut().zip(numbers).for_each(|(to, (k, x))| *to = number(k, *x));
        }
        Ok(Answered { answer: planned.run(model), planned })
    }
}

/// An answer, by field.
pub(crate) struct Answered<T: PlanScalar> {
    answer: Answer,
    planned: Planned<T>,
}

impl<T: PlanScalar> Answered<T> {
    pub(crate) fn status(&self) -> Status {
        self.answer.status
    }

    pub(crate) fn warnings(&self) -> Warnings {
        self.answer.warnings
    }

    /// The numbers of a field; none if it is not wanted.
    pub(crate) fn get(&self, field: Field) -> &[T] {
        self.planned.get(field)
    }

    /// True if every number that its status forbids is NaN.
    pub(crate) fn is_empty(&self) -> bool {
        let nan = |field| self.get(field).iter().all(|x| x.to_f64().is_nan());
        let slots = self.planned.plan.want().slots();
        slots.iter().all(|slot| slot.field.survives_failure() || nan(slot.field))
    }

    /// The shortest time of a call in nanoseconds, over a few.
    pub(crate) fn nanoseconds(&mut self, model: &Model<T>, repeats: u32) -> f64 {
        let mut shortest = f64::INFINITY;
        for _ in 0..repeats {
            let start = std::time::Instant::now();
            let _ = std::hint::black_box(&mut self.planned).run(model);
            shortest = shortest.min(start.elapsed().as_nanos() as f64);
        }
        shortest
    }
}

/// max |x − exact| / max(|exact|, least) of a field, lengths in those of the robot; infinite for
/// NaN.
pub(crate) fn error<T: Real>(
    robot: &Robot,
    field: Field,
    numbers: &[T],
    exact: &[Dd],
    least: f64,
) -> f64 {
    let units = robot.units_of(field, exact.len());
    let pairs = numbers.iter().zip(exact).zip(units).map(|((x, exact), unit)| {
        (unit * (double_double(*x) - *exact).to_f64(), unit * exact.to_f64())
    });
    by_size(pairs, least)
}

/// A number of any scalar with all digits of double-double.
fn double_double<T: Real>(x: T) -> Dd {
    let hi = x.to_f64();
    Dd::from(hi) + Dd::from((x - T::from_f64(hi)).to_f64())
}

/// ‖M_y ÿ + C_y − τ_y‖ / (‖M_y‖‖ÿ‖ + ‖C_y‖ + ‖τ_y‖) of an answer to forward dynamics, by inverse
/// dynamics in double-double. ‖M_y‖ is taken as the largest row sum, which is never larger than the
/// norm, so that the error is never reported too small.
pub(crate) fn backward_error(
    robot: &Robot,
    ask: &Question,
    answer: &Answered<f64>,
) -> Outcome<f64> {
    let exact = &robot.compiled.exact;
    let inverse = |ydd: Vec<f64>| {
        let given = ask.given.iter().filter(|(field, _)| *field != TauY).cloned();
        let given = given.chain([(Ydd, ydd)]).collect();
        let inverse = Question::new(Request::InverseDynamics, given, &[TauY]);
        Question { wrenches: ask.wrenches.clone(), ..inverse }.run(exact)
    };
    let ydd = answer.get(Ydd);
    let n = ydd.len();
    let back = inverse(ydd.to_vec())?;
    let bias = inverse(vec![0.0; n])?;
    let ones = inverse(vec![1.0; n])?;
    let [back, bias, ones] = [&back, &bias, &ones].map(|of| of.get(TauY));
    let tau = ask.given.iter().find(|(field, _)| *field == TauY).map_or(&[][..], |(_, tau)| tau);
    let units = robot.units(TauY);
    let largest = |x: &dyn Fn(usize) -> f64| {
        (0..n)
            .map(x)
            .fold(0.0, |size: f64, x| if x.is_nan() { f64::INFINITY } else { size.max(x.abs()) })
    };
    let residual = largest(&|i| units[i] * (back[i] - Dd::from(tau[i])).to_f64());
    let size = largest(&|i| units[i] * (ones[i] - bias[i]).to_f64()) * largest(&|i| ydd[i])
        + largest(&|i| units[i] * bias[i].to_f64())
        + largest(&|i| units[i] * tau[i]);
    Ok(if residual == 0.0 { 0.0 } else { residual / size })
}
