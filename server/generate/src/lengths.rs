//! Lengths of a robot as inputs of its code.

use std::cell::{Cell, RefCell};

use sarrus_dynamics::Model;

use crate::graph::Operation;
use crate::recorder::Traced;
use crate::{GenerateError, Generated};

/// Part of its change by which a constant may leave the straight line.
const STRAIGHT: f64 = 1e-9;
/// The input of a constant that does not move along a line, which no code may use.
const BENT: usize = 1 << 24;

/// Lengths that code takes as inputs behind all others: each moves points of the robot along
/// straight lines, as a joint's origin along a bar.
#[derive(Clone, Debug, Default)]
pub struct Lengths {
    pub(crate) names: Vec<String>,
    /// Their values in the model that is traced `[m]`.
    pub(crate) values: Vec<f64>,
    /// Each constant that some length moves, by its place in the order of `Model::convert`.
    moved: Vec<(usize, Moved)>,
}

/// How lengths move a constant.
#[derive(Clone, Debug)]
enum Moved {
    /// Along straight lines: its change by each metre of each length.
    Straight(Vec<f64>),
    Bent,
}

impl Lengths {
    /// Of a model: names with values, and the models in which one of them is longer by `step`, and
    /// by twice that `[m]`. All have the structure of the first. Allocates.
    ///
    /// # Errors
    /// [`GenerateError::Lengths`]: a model has another structure.
    pub fn new<'a>(
        model: &Model<f64>,
        lengths: impl IntoIterator<Item = (&'a str, f64, [&'a Model<f64>; 2])>,
        step: f64,
    ) -> Generated<Lengths> {
        let base = constants(model);
        let mut of = Lengths::default();
        let mut slopes = vec![Vec::new(); base.len()];
        let mut bent = vec![false; base.len()];
        for (l, (name, value, longer)) in lengths.into_iter().enumerate() {
            let [once, twice] = longer.map(constants);
            if once.len() != base.len() || twice.len() != base.len() {
                return Err(GenerateError::Lengths);
            }
            for (k, x) in base.iter().enumerate() {
                let slope = (twice[k] - x) / (2.0 * step);
                if slope != 0.0 {
                    slopes[k].resize(l + 1, 0.0);
                    slopes[k][l] = slope;
                }
                bent[k] |= (once[k] - x - slope * step).abs() > STRAIGHT * step;
            }
            of.names.push(name.to_owned());
            of.values.push(value);
        }
        let moved = |(k, slopes): (usize, Vec<f64>)| match (bent[k], slopes.is_empty()) {
            (true, _) => Some((k, Moved::Bent)),
            (false, false) => Some((k, Moved::Straight(slopes))),
            (false, true) => None,
        };
        of.moved = slopes.into_iter().enumerate().filter_map(moved).collect();
        Ok(of)
    }

    /// The model with these lengths as inputs from number `first` on.
    pub(crate) fn traced(&self, model: &Model<f64>, first: usize) -> Model<Traced> {
        let place = Cell::new(0);
        let mut moved = self.moved.iter().peekable();
        let mut list = Vec::new();
        for (k, x) in constants(model).into_iter().enumerate() {
            let of = moved.next_if(|(at, _)| *at == k).map(|(_, of)| of);
            list.push(match of {
                None => Traced::constant(x),
                Some(Moved::Bent) => Traced::input(BENT, x),
                Some(Moved::Straight(slopes)) => self.at(x, slopes, first),
            });
        }
        model.convert(|_| list[place.replace(place.get() + 1)])
    }

    /// A constant at the lengths.
    fn at(&self, x: f64, slopes: &[f64], first: usize) -> Traced {
        let known = |sum: f64, (slope, value): (&f64, &f64)| sum - slope * value;
        let rest = slopes.iter().zip(&self.values).fold(x, known);
        let used = slopes.iter().enumerate().filter(|(_, slope)| **slope != 0.0);
        used.fold(Traced::constant(rest), |sum, (l, slope)| {
            Traced::input(first + l, self.values[l]) * Traced::constant(*slope) + sum
        })
    }

    /// Refuses code that uses a constant which does not move along a line.
    pub(crate) fn check(operations: &[Operation]) -> Generated {
        let is_bent = |of: &Operation| matches!(of, Operation::Input(k) if *k as usize >= BENT);
        if operations.iter().any(is_bent) { Err(GenerateError::Lengths) } else { Ok(()) }
    }
}

/// The constants of a model in the order of `Model::convert`.
fn constants(model: &Model<f64>) -> Vec<f64> {
    let list = RefCell::new(Vec::new());
    model.convert(|x: f64| {
        list.borrow_mut().push(x);
        x
    });
    list.into_inner()
}
