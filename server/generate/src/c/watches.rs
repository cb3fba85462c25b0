//! The statements of `NAME_rows` that mark rows in which a number is out of its bounds.
//!
//! Numbers with the same bound are checked together, an operation or two for each: numbers that
//! must not be large by the sum of their squares, which leaves a row to the plan somewhat early,
//! and limits by the extremes.

use crate::Kernel;
use crate::c::{literal, number_of_rows};
use crate::graph::Term;
use crate::row::{Measure, Row};

/// The statements.
#[derive(Default)]
pub(super) struct Watches {
    pub(super) head: Vec<String>,
    /// The checks that follow the numbers of some terms.
    pub(super) lines: Vec<([Option<Term>; 2], String)>,
    pub(super) tail: Vec<String>,
}

impl Watches {
    pub(super) fn new(kernel: &Kernel) -> Watches {
        let mut watches = Watches::default();
        let is_size = |row: &Row| row.lower == -row.upper && row.upper >= 1.0;
        let (sizes, others): (Vec<Row>, Vec<Row>) =
            Row::all(&kernel.checks).into_iter().partition(is_size);
        for row in &others {
            watches.lines.push((row.measure.terms(), left(&inside(row))));
        }
        let sizes = groups(sizes, |row| row.upper);
        watches.declare("squares", sizes.len());
        for (k, (bound, rows)) in sizes.iter().enumerate() {
            let sum = format!("squares[{k}]");
            watches.gather(&sum, 0.0, "add_square", rows);
            // below the square by more than a sum of many can be off
            let most = (0.999 * bound * bound).min(f64::MAX);
            watches.tail.push(left(&format!("{sum} <= {}", same(most))));
        }
        let limits = Row::limits(kernel);
        watches.limits(&limits, |row| row.upper, ["most", "larger", ">"]);
        watches.limits(&limits, |row| row.lower, ["least", "smaller", "<"]);
        watches
    }

    /// One side of the limits, which do not notice NaN.
    fn limits(
        &mut self,
        limits: &[Row],
        side: fn(&Row) -> f64,
        [array, function, sign]: [&str; 3],
    ) {
        let limited = limits.iter().copied().filter(|row| side(row).is_finite());
        let (many, alone): (Vec<_>, Vec<_>) =
            groups(limited.collect(), side).into_iter().partition(|(_, rows)| rows.len() > 1);
        let beyond = |x: &str, bound: f64| {
            format!("beyond[0] |= (sarrus_lanes)({x} {sign} {});", same(bound))
        };
        for (bound, rows) in alone {
            for row in rows {
                self.lines.push((row.measure.terms(), beyond(&measured(row.measure), bound)));
            }
        }
        self.declare(array, many.len());
        for (k, (bound, rows)) in many.iter().enumerate() {
            let extreme = format!("{array}[{k}]");
            self.gather(&extreme, *bound, function, rows);
            self.tail.push(beyond(&extreme, *bound));
        }
    }

    fn declare(&mut self, array: &str, size: usize) {
        if size > 0 {
            self.head.push(format!("sarrus_rows {array}[{size}];"));
        }
    }

    /// Takes the measures of some rows into one place.
    fn gather(&mut self, place: &str, start: f64, function: &str, rows: &[Row]) {
        self.head.push(format!("{place} = {};", same(start)));
        for row in rows {
            let line = format!("{place} = sarrus_{function}({}, {place});", measured(row.measure));
            self.lines.push((row.measure.terms(), line));
        }
    }
}

/// Rows by their bound, in the order in which they come.
fn groups(rows: Vec<Row>, bound: impl Fn(&Row) -> f64) -> Vec<(f64, Vec<Row>)> {
    let mut groups: Vec<(f64, Vec<Row>)> = Vec::new();
    for row in rows {
        let of = bound(&row);
        match groups.iter_mut().find(|(bound, _)| *bound == of) {
            Some((_, rows)) => rows.push(row),
            None => groups.push((of, vec![row])),
        }
    }
    groups
}

fn left(condition: &str) -> String {
    format!("left[0] |= ~(sarrus_lanes)({condition});")
}

/// That a number lies in its bounds, and is one.
fn inside(row: &Row) -> String {
    let x = measured(row.measure);
    let sides = [(row.lower, ">="), (row.upper, "<=")]
        .into_iter()
        .filter(|(bound, _)| bound.is_finite())
        .map(|(bound, sign)| format!("({x} {sign} {})", same(bound)));
    sides.reduce(|a, b| format!("{a} & {b}")).unwrap_or_else(|| format!("{x} == {x}"))
}

fn measured(measure: Measure) -> String {
    measure.text(number_of_rows, ["sarrus_absolute", "sarrus_larger"])
}

fn same(x: f64) -> String {
    format!("sarrus_same({})", literal(x))
}
