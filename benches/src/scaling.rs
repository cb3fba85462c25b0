//! Cost against size (`--scaling`): bodies, loops, joints of a loop, rows of a block, states of a
//! batch.
//!
//! The robots of a family differ in one size only, and their batches take turns. Each question has
//! an exponent: the slope of log time over log size, by least squares over the larger half of the
//! sizes. Instructions, counted under callgrind, do not depend on other load on the machine.

mod families;
mod instructions;

use std::path::PathBuf;
use std::time::Duration;

use crate::cores::Cores;
use sarrus_report::Outcome;
use sarrus_report::measure::machine::machine;
use sarrus_report::measure::timing::{self, Samples};
use sarrus_report::robots::{Question, Robot, Subject};
use serde_json::{Value, json};

use self::families::{FAMILIES, Family};
use crate::batches::Many;
use crate::cases::{Case, passes};
use crate::errors;
use crate::printed::Printed;
use crate::table::{Format, Table, error, ns};

/// States of a batch.
const ROWS: [usize; 6] = [1, 4, 16, 64, 256, 1024];
/// The robots of the batches.
const OF_BATCHES: [&str; 3] = ["lambda", "torso", "rh5v2_upper_body"];

/// How much is measured, and the destination of the results.
#[derive(Clone, Debug)]
pub struct ScalingOptions {
    /// Fewer repetitions.
    pub quick: bool,
    /// Also instructions, under callgrind: minutes.
    pub instructions: bool,
    /// How the tables are printed.
    pub format: Format,
    /// The file for every batch of every case.
    pub out: PathBuf,
}

/// Cost of one question at one size.
struct Point {
    size: usize,
    question: Question,
    /// Median time of a call in nanoseconds.
    ns: f64,
    /// Largest error by size; none for batches.
    error: Option<f64>,
    /// Mean count of Newton steps.
    newton: Option<f64>,
    instructions: Option<f64>,
}

impl Point {
    fn new(size: usize, question: Question) -> Point {
        Point { size, question, ns: f64::NAN, error: None, newton: None, instructions: None }
    }
}

/// Measures, prints and keeps.
///
/// # Errors
///
/// A robot that does not load or answer, a file that cannot be written.
pub fn run(options: &ScalingOptions) -> Outcome {
    let rounds = Duration::from_secs(if options.quick { 3 } else { 12 });
    let cores = Cores::choose()?;
    cores.pin_client();
    let mut printed = Printed {
        package: "sarrus-benches",
        machine: String::new(),
        tables: Vec::new(),
        values: json!({}),
        samples: Vec::new(),
    };
    for family in &FAMILIES {
        let points = family.measure(rounds, options.instructions, &mut printed.samples)?;
        let title = format!("{}: {}", family.name, family.of);
        printed.tables.push(table(title, &points, false));
        printed.values[family.name] = values(&points);
    }
    for name in OF_BATCHES {
        let points = batches(name, rounds / 2, &mut printed.samples)?;
        let title = format!("batch rows, {name}: ns per row; exponents of the whole call");
        printed.tables.push(table(title, &points, true));
        printed.values[format!("rows/{name}")] = values(&points);
    }
    printed.machine = machine()?;
    printed.finish(options.format, &options.out)
}

/// Runs the case of a name such as `scaling/loops/30/FD` that many times; none of other names.
pub(crate) fn count(name: &str, repeats: usize) -> Option<Outcome> {
    let mut parts = name.strip_prefix("scaling/")?.split('/');
    let family = parts.next()?;
    let family = FAMILIES.iter().find(|of| of.name == family)?;
    let size = parts.next()?.parse().ok()?;
    let question = parts.next()?;
    let question = Question::CHOSEN.into_iter().find(|of| of.name() == question)?;
    let counted = || {
        let robot = family.load(size, instructions::STATES)?;
        passes(&mut Case::new(&robot, 0, family.start, question)?, repeats)
    };
    Some(counted())
}

impl Family {
    fn measure(
        &self,
        rounds: Duration,
        counted: bool,
        kept: &mut Vec<Samples>,
    ) -> Outcome<Vec<Point>> {
        let states = |size: usize| if size < 100 { 16 } else { 4 };
        let robots: Vec<Robot> =
            self.sizes.iter().map(|n| self.load(*n, states(*n))).collect::<Outcome<_>>()?;
        let mut points = Vec::new();
        let mut cases = Vec::new();
        let mut exact = Vec::new();
        for (robot, size) in robots.iter().zip(self.sizes) {
            for question in Question::CHOSEN {
                let mut case = Case::new(robot, 0, self.start, question)?;
                let errors = errors::measure(&mut case, &mut exact)?;
                cases.push(case);
                let mut point = Point::new(*size, question);
                point.error = Some(errors.worst);
                point.newton = errors.newton.map(|(mean, _)| mean);
                points.push(point);
            }
        }
        let samples = timing::interleaved(&mut cases, rounds, |_| ())?;
        for (point, samples) in points.iter_mut().zip(&samples) {
            point.ns = samples.median();
        }
        kept.extend(samples);
        if counted {
            let name =
                |of: &Point| format!("scaling/{}/{}/{}", self.name, of.size, of.question.name());
            let names: Vec<String> = points.iter().map(name).collect();
            for (point, count) in points.iter_mut().zip(instructions::of(&names)?) {
                point.instructions = count;
            }
        }
        Ok(points)
    }
}

fn batches(name: &'static str, rounds: Duration, kept: &mut Vec<Samples>) -> Outcome<Vec<Point>> {
    let robot = Robot::load_some(Subject::Bundled(name), 64, |closures| closures == "analytic")?;
    let mut points = Vec::new();
    let mut calls = Vec::new();
    for size in ROWS {
        for question in Question::CHOSEN {
            calls.push(Many::new(&robot, question, size)?);
            points.push(Point::new(size, question));
        }
    }
    let samples = timing::interleaved(&mut calls, rounds, |_| ())?;
    for (point, samples) in points.iter_mut().zip(&samples) {
        point.ns = samples.median();
    }
    kept.extend(samples);
    Ok(points)
}

/// A line for each size, and one for the exponents.
fn table(title: String, points: &[Point], per_row: bool) -> Table {
    let counted = points.iter().any(|point| point.instructions.is_some());
    let iterates = points.iter().any(|point| point.newton.is_some());
    let mut rows = Vec::new();
    for size in points.chunk_by(|a, b| a.size == b.size) {
        let mut row = vec![size[0].size.to_string()];
        row.extend(size.iter().map(|point| {
            let time = ns(point.ns / if per_row { point.size as f64 } else { 1.0 });
            point.error.map_or(time.clone(), |worst| format!("{time} ({})", error(worst)))
        }));
        if counted {
            let cell = |point: &Point| point.instructions.map_or("-".to_owned(), ns);
            row.extend(size.iter().map(cell));
        }
        let steps = size.iter().find_map(|point| point.newton);
        row.extend(steps.map(|steps| format!("{steps:.1}")));
        rows.push(row);
    }
    let words = |of: fn(&Point) -> Option<f64>| {
        exponents(points, of).map(|slope| slope.map_or("-".to_owned(), |x| format!("{x:.2}")))
    };
    let mut last = vec!["exponent".to_owned()];
    last.extend(words(|point| Some(point.ns)));
    let mut columns = vec!["size", "state", "ID", "FD"];
    if counted {
        last.extend(words(|point| point.instructions));
        columns.extend(["state, instructions", "ID, instructions", "FD, instructions"]);
    }
    if iterates {
        last.push("-".to_owned());
        columns.push("Newton steps");
    }
    rows.push(last);
    let note = "median ns of a call (largest error by size); exponent: slope of log cost over log \
        size, over the larger half of the sizes";
    Table { title, columns, n_text: 1, rows, notes: vec![note.to_owned()] }
}

/// The exponent of each question.
fn exponents(points: &[Point], cost: fn(&Point) -> Option<f64>) -> [Option<f64>; 3] {
    Question::CHOSEN.map(|question| {
        let mine = points.iter().filter(|point| point.question == question);
        let costs: Vec<(f64, f64)> =
            mine.filter_map(|point| Some((point.size as f64, cost(point)?))).collect();
        exponent(&costs)
    })
}

/// The slope of log cost over log size by least squares, over the larger half of the sizes.
pub(crate) fn exponent(costs: &[(f64, f64)]) -> Option<f64> {
    let half = costs.len().div_ceil(2).max(2);
    let logs = costs.get(costs.len().checked_sub(half)?..)?.iter().map(|(n, c)| (n.ln(), c.ln()));
    let mean = |of: fn((f64, f64)) -> f64| logs.clone().map(of).sum::<f64>() / half as f64;
    let middle = mean(|(n, _)| n);
    let level = mean(|(_, c)| c);
    let across: f64 = logs.clone().map(|(n, c)| (n - middle) * (c - level)).sum();
    let along: f64 = logs.clone().map(|(n, _)| (n - middle).powi(2)).sum();
    Some(across / along)
}

fn values(points: &[Point]) -> Value {
    let value = |point: &Point| {
        json!({
            "size": point.size,
            "question": point.question.name(),
            "median_ns": point.ns,
            "error": point.error,
            "newton_steps": point.newton,
            "instructions": point.instructions,
        })
    };
    json!({
        "points": points.iter().map(value).collect::<Vec<_>>(),
        "exponents": exponents(points, |point| Some(point.ns)),
        "exponents_of_instructions": exponents(points, |point| point.instructions),
    })
}

#[cfg(test)]
mod tests {
    use super::exponent;

    #[test]
    fn the_exponent_of_a_power_law_is_its_power_despite_other_costs_of_small_sizes() {
        for power in [0.0, 1.0, 1.5, 3.0] {
            let law = |n: f64| (n, 7.0 * n.powf(power));
            let mut costs = [3.0, 10.0, 30.0, 100.0, 300.0].map(law);
            // constant costs at small sizes
            costs[0].1 = 1e4;
            costs[1].1 = 1e5;
            let found = exponent(&costs);
            assert!(found.is_some_and(|found| (found - power).abs() < 1e-12), "{found:?}, {power}");
        }
    }

    #[test]
    fn one_size_has_no_exponent() {
        assert_eq!(exponent(&[]), None);
        assert_eq!(exponent(&[(10.0, 3.0)]), None);
    }
}
