//! A check as a number that has to lie in an interval, which is how it is computed.

use std::collections::HashMap;

use crate::Kernel;
use crate::graph::{Check, Comparison, Term};
use crate::recorder::Limited;

/// The least positive double: a number greater than zero is not below it.
const LEAST: f64 = 5e-324;

/// The operand of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Measure {
    /// a.
    Plain(Term),
    /// |a|.
    Absolute(Term),
    /// a − b.
    Difference(Term, Term),
    /// |a − b|.
    Distance(Term, Term),
    /// The larger one of |a| and b.
    Larger(Term, Term),
}

/// lower ≤ measure ≤ upper; no number lies in no interval.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    pub(crate) measure: Measure,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

impl Measure {
    /// Its operands.
    pub(crate) fn terms(self) -> [Option<Term>; 2] {
        use Measure::*;
        match self {
            Plain(a) | Absolute(a) => [Some(a), None],
            Difference(a, b) | Distance(a, b) | Larger(a, b) => [Some(a), Some(b)],
        }
    }

    pub(crate) fn of(self, of: impl Fn(Term) -> f64) -> f64 {
        match self {
            Measure::Plain(a) => of(a),
            Measure::Absolute(a) => of(a).abs(),
            Measure::Difference(a, b) => of(a) - of(b),
            Measure::Distance(a, b) => (of(a) - of(b)).abs(),
            Measure::Larger(a, b) => {
                let a = of(a).abs();
                let b = of(b);
                if a > b { a } else { b }
            }
        }
    }
}

impl Measure {
    /// As an expression of a language, with its names of two functions.
    pub(crate) fn text(self, n: impl Fn(Term) -> String, [absolute, larger]: [&str; 2]) -> String {
        match self {
            Measure::Plain(a) => n(a),
            Measure::Absolute(a) => format!("{absolute}({})", n(a)),
            Measure::Difference(a, b) => format!("({} - {})", n(a), n(b)),
            Measure::Distance(a, b) => format!("{absolute}({} - {})", n(a), n(b)),
            Measure::Larger(a, b) => format!("{larger}({absolute}({}), {})", n(a), n(b)),
        }
    }
}

impl Row {
    /// The sign before a number belongs to its bounds.
    fn new(measure: Measure, lower: f64, upper: f64) -> Row {
        match measure {
            Measure::Plain(a) if a.is_negated() => {
                Row { measure: Measure::Plain(a.negated()), lower: -upper, upper: -lower }
            }
            Measure::Absolute(a) => Row { measure: Measure::Absolute(a.unsigned()), lower, upper },
            _ => Row { measure, lower, upper },
        }
    }

    /// The row of a check. Where a comparison came out false, NaN also counts as out of the
    /// interval and is left to the kernel.
    pub(crate) fn of(check: &Check) -> Row {
        const INFINITY: f64 = f64::INFINITY;
        let row = Row::new;
        match *check {
            Check::Branch(Comparison::Less(a, b), true) => match (a.value(), b.value()) {
                (_, Some(b)) => row(Measure::Plain(a), -INFINITY, b.next_down()),
                (Some(a), _) => row(Measure::Plain(b), a.next_up(), INFINITY),
                _ => row(Measure::Difference(b, a), LEAST, INFINITY),
            },
            Check::Branch(Comparison::Less(a, b), false) => match (a.value(), b.value()) {
                (_, Some(b)) => row(Measure::Plain(a), b, INFINITY),
                (Some(a), _) => row(Measure::Plain(b), -INFINITY, a),
                _ => row(Measure::Difference(a, b), 0.0, INFINITY),
            },
            Check::Branch(Comparison::Equal(a, b), true) => match b.value().or(a.value()) {
                Some(c) => row(Measure::Plain(if b.value().is_some() { a } else { b }), c, c),
                None => row(Measure::Difference(a, b), 0.0, 0.0),
            },
            Check::Branch(Comparison::Equal(a, b), false) => {
                row(Measure::Distance(a, b), LEAST, INFINITY)
            }
            Check::Finite(a) => row(Measure::Plain(a), f64::MIN, f64::MAX),
            Check::Bounded(a, bits) => {
                let bound = f64::from_bits(bits);
                row(Measure::Plain(a), -bound, bound)
            }
            Check::NotZero(a) => row(Measure::Absolute(a), LEAST, INFINITY),
            Check::CertainAngle(y, x) => row(Measure::Larger(y, x), LEAST, INFINITY),
        }
    }

    pub(crate) fn holds(&self, of: impl Fn(Term) -> f64) -> bool {
        let x = self.measure.of(of);
        self.lower <= x && x <= self.upper
    }

    /// Rows of one measure, merged into one.
    fn merged(list: Vec<Row>) -> Vec<Row> {
        let mut places = HashMap::new();
        let mut rows: Vec<Row> = Vec::new();
        for row in list {
            let at = *places.entry(row.measure).or_insert(rows.len());
            match rows.get_mut(at) {
                Some(old) => {
                    old.lower = old.lower.max(row.lower);
                    old.upper = old.upper.min(row.upper);
                }
                None => rows.push(row),
            }
        }
        rows
    }

    /// All limits.
    pub(crate) fn limits(kernel: &Kernel) -> Vec<Row> {
        let row =
            |limited: &Limited| Row::new(Measure::Plain(limited.x), limited.lower, limited.upper);
        Row::merged(kernel.limited.iter().map(row).collect())
    }

    /// All checks.
    pub(crate) fn all(checks: &[Check]) -> Vec<Row> {
        Row::merged(checks.iter().map(Row::of).collect())
    }
}
