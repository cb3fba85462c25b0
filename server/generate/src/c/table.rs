//! Checks and limits as tables: numbers in an array, their bounds in two others, and one loop.

use std::collections::HashMap;

use super::literal;
use crate::Kernel;
use crate::graph::{Operation, Term};
use crate::pair::Pairs;
use crate::row::{Measure, Row};

/// Numbers in a vector.
const LANES: usize = 4;

/// Numbers stored in an array.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value {
    One(Measure),
    /// Both numbers of a pair, or their absolute values.
    Pair(u32, bool),
    Filling,
}

/// Lower and upper bounds of inputs or of computed numbers.
#[derive(Debug, Default)]
struct Bounds(Vec<[f64; 2]>);

/// The checks (`seen`) and limits (`limited`) of computed numbers, and of inputs.
pub(super) struct Table {
    stores: Vec<(&'static str, usize, Value)>,
    seen: Bounds,
    limited: Bounds,
    input_checks: Bounds,
    input_limits: Bounds,
}

impl Table {
    pub(super) fn new(kernel: &Kernel, pairs: &Pairs) -> Table {
        let input = |row: &Row| match row.measure {
            Measure::Plain(Term::Node { at, negated: false }) => {
                match kernel.operations.get(at as usize) {
                    Some(Operation::Input(k)) => Some(*k as usize),
                    _ => None,
                }
            }
            _ => None,
        };
        let mut stores = Vec::new();
        let mut split = |rows: Vec<Row>, array: &'static str| {
            let (of_inputs, others): (Vec<Row>, Vec<Row>) =
                rows.into_iter().partition(|row| input(row).is_some());
            let mut inputs = Bounds::default();
            for row in of_inputs {
                let k = input(&row).unwrap_or_default();
                inputs.grow(inputs.0.len().max(k + 1));
                let [lower, upper] = &mut inputs.0[k];
                *lower = lower.max(row.lower);
                *upper = upper.min(row.upper);
            }
            (inputs, arranged(others, pairs, array, &mut stores))
        };
        let (input_checks, seen) = split(Row::all(&kernel.checks), "seen");
        let (input_limits, limited) = split(Row::limits(kernel), "limited");
        Table { stores, seen, limited, input_checks, input_limits }
    }

    /// Which number goes where.
    pub(super) fn stores(&self) -> impl Iterator<Item = (&'static str, usize, Value)> {
        self.stores.iter().copied()
    }

    /// The arrays.
    pub(super) fn arrays(&self) -> Vec<String> {
        let all = [("seen", &self.seen), ("limited", &self.limited)];
        let used = all.into_iter().filter(|(_, bounds)| !bounds.0.is_empty());
        used.map(|(name, bounds)| format!("double {name}[{}];", bounds.0.len())).collect()
    }

    /// Statements on inputs.
    pub(super) fn of_inputs(&self) -> Vec<String> {
        let mut lines = self.input_checks.statements("bad", "given", "in");
        lines.extend(self.input_limits.statements("over", "allowed", "in"));
        lines
    }

    /// Statements on computed numbers.
    pub(super) fn of_results(&self) -> Vec<String> {
        let mut lines = self.seen.statements("bad", "seen", "seen");
        lines.extend(self.limited.statements("over", "limited", "limited"));
        lines
    }
}

/// Rows in the order of an array: both numbers of a pair side by side, in whole vectors.
fn arranged(
    rows: Vec<Row>,
    pairs: &Pairs,
    array: &'static str,
    stores: &mut Vec<(&'static str, usize, Value)>,
) -> Bounds {
    let places: HashMap<Measure, Row> = rows.iter().map(|row| (row.measure, *row)).collect();
    let two = |measure: Measure| {
        let (at, is_absolute) = match measure {
            Measure::Plain(Term::Node { at, negated: false }) => (at, false),
            Measure::Absolute(Term::Node { at, negated: false }) => (at, true),
            _ => return None,
        };
        let (x, y) = pairs.ordered(at)?;
        let of = |at| {
            let term = Term::node(at);
            places.get(&if is_absolute { Measure::Absolute(term) } else { Measure::Plain(term) })
        };
        Some((x, is_absolute, at == x, *of(x)?, *of(y)?))
    };
    let mut bounds = Bounds::default();
    for row in &rows {
        let (value, rows) = match two(row.measure) {
            Some((x, is_absolute, true, first, second)) => {
                (Value::Pair(x, is_absolute), vec![first, second])
            }
            Some(_) => continue,
            None => (Value::One(row.measure), vec![*row]),
        };
        stores.push((array, bounds.0.len(), value));
        bounds.0.extend(rows.iter().map(|row| [row.lower, row.upper]));
    }
    let full = bounds.0.len().div_ceil(LANES) * LANES;
    stores.extend((bounds.0.len()..full).map(|k| (array, k, Value::Filling)));
    bounds.grow(full);
    bounds
}

impl Bounds {
    /// Up to `len` numbers without bounds.
    fn grow(&mut self, len: usize) {
        self.0.resize(len, [f64::NEG_INFINITY, f64::INFINITY]);
    }

    /// Where a number of `array` is out of its bounds, a mask of all bits in `mask`.
    fn statements(&self, mask: &str, table: &str, array: &str) -> Vec<String> {
        // limits do not notice NaN, checks do
        let outside = |x: &str, lower: &str, upper: &str| match mask {
            "over" => format!("({x} < {lower}) | ({x} > {upper})"),
            _ => format!("!(({x} >= {lower}) & ({x} <= {upper}))"),
        };
        let count = self.0.len() / LANES * LANES;
        let mut lines = Vec::new();
        if count > 0 {
            for (side, name) in ["lower", "upper"].into_iter().enumerate() {
                lines.push(format!("static const double {table}_{name}[{count}] = {{"));
                for row in self.0[..count].chunks(LANES) {
                    let row: Vec<String> = row.iter().map(|bounds| literal(bounds[side])).collect();
                    lines.push(format!("    {},", row.join(", ")));
                }
                lines.push("};".to_owned());
            }
            lines.push(format!("for (int k = 0; k < {count}; k++)"));
            let [x, lower, upper] = [array, &format!("{table}_lower"), &format!("{table}_upper")]
                .map(|name| format!("{name}[k]"));
            lines.push(format!("    {mask} |= sarrus_mask({});", outside(&x, &lower, &upper)));
        }
        for (k, bounds) in self.0.iter().enumerate().skip(count) {
            let [lower, upper] = bounds.map(literal);
            let outside = outside(&format!("{array}[{k}]"), &lower, &upper);
            lines.push(format!("{mask} |= sarrus_mask({outside});"));
        }
        lines
    }
}
