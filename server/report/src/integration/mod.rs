//! Section `integration`: error of motions against computing time, and energy over many steps.
//!
//! A problem is one entry in `problems.rs`.

mod drift;
mod four_bars;
mod problems;

use std::time::Instant;

use sarrus_simulation::{Method, Run, Settings};

pub use self::four_bars::{four_bars, pendulum};
use self::problems::Problem;
use crate::Outcome;
use crate::measure::Effort;
use crate::measure::progress::Progress;
use crate::page::{Axis, Figure, Point, Section, Series, Table, columns, exponent};
use crate::reference::{by_size, worse};

/// Tolerance of the two runs whose agreement measures the quality of the reference.
const TIGHT: [(Method, f64); 2] = [(Method::Dop853, 1e-13), (Method::Radau5, 1e-12)];
/// Largest difference of the two up to which a problem has a reference.
const AGREE: f64 = 1e-6;
/// Seconds that one run may take in a quick report; a series ends when the next run would take
/// longer.
const LONGEST_RUN: [f64; 2] = [6.0, 0.15];

/// Fills the section.
pub(crate) fn run(effort: &Effort, progress: &Progress) -> Outcome<Section> {
    let mut section = Section::new("integration", "Time integration");
    let problems = problems::all(effort.quick)?;
    let mut rows = Vec::new();
    for (k, problem) in problems.iter().enumerate() {
        progress.show(problem.title, k as f64 / (problems.len() + 1) as f64);
        let (figure, row) = work_and_precision(problem, effort)?;
        section.figures.push(figure);
        rows.push(row);
    }
    progress.show("energy", problems.len() as f64 / (problems.len() + 1) as f64);
    let (figure, sentence) = drift::energy(effort)?;
    section.summary.push(best(&rows, effort.quick));
    section.summary.push(sentence);
    section.figures.push(figure);
    section.tables.push(Table {
        id: "integration-references".into(),
        title: "What the motions are compared with".into(),
        caption:
            "The reference is DOP853 at a tolerance of 1e-13; Radau's method at 1e-12 and what is \
            known from elsewhere stand beside it. Errors are of y and ẏ at the end, by size."
                .into(),
        columns: columns(
            "problem | Radau5 against DOP853 | known from | DOP853 against it | least error \
            reached | by",
        ),
        rows: rows.into_iter().map(|row| row.cells).collect(),
    });
    Ok(section)
}

/// A line of the table.
struct Row {
    cells: Vec<String>,
    title: &'static str,
    least: f64,
}

/// The largest of the least errors.
fn best(rows: &[Row], quick: bool) -> String {
    let worst = rows.iter().max_by(|a, b| a.least.total_cmp(&b.least));
    worst.map_or_else(String::new, |row| {
        let without = if quick {
            " (without the row of 40 four-bars, which a quick report leaves out)"
        } else {
            ""
        };
        format!(
            "Time integration: every problem reaches its reference to {}; hardest: {}{without}",
            exponent(row.least),
            row.title
        )
    })
}

/// Error against time over tolerances and steps, and the error of the reference.
fn work_and_precision(problem: &Problem, effort: &Effort) -> Outcome<(Figure, Row)> {
    let [(first, tolerance), (second, other)] = TIGHT;
    let exact = problem.run(&problem.adaptive(first, tolerance))?;
    let check = problem.run(&problem.adaptive(second, other))?;
    let end = |run: &Run| -> Outcome<[Vec<f64>; 2]> {
        let last = run.last().filter(|_| run.end.is_finished());
        Ok(last
            .map(|last| [last.y.clone(), last.yd.clone()])
            .ok_or_else(|| format!("{}: {} at {}", problem.id, run.end.name(), run.time))?)
    };
    let found = end(&exact)?;
    let agreement = off(&end(&check)?, &found);
    if agreement > AGREE {
        return Err(format!("{}: two methods differ by {agreement:.1e}", problem.id).into());
    }

    // a value published to more digits is the reference
    let (reference, of, known_to) = match &problem.known {
        Some(known) if known.to < agreement => (known.end.clone(), known.from, known.to),
        _ => (found.clone(), "DOP853 at a tolerance of 1e-13", agreement),
    };
    let longest = LONGEST_RUN[usize::from(effort.quick)];
    let mut series = Vec::new();
    for method in Method::ALL {
        let mut points = Vec::new();
        for (label, settings) in settings_of(problem, method) {
            let start = Instant::now();
            let run = problem.run(&settings)?;
            let seconds = start.elapsed().as_secs_f64();
            let error = end(&run).map_or(f64::NAN, |end| off(&end, &reference));
            let label =
                if run.end.is_finished() { label } else { format!("{label}, {}", run.end.name()) };
            points.push(Point { x: seconds, y: error, label });
            if seconds > longest {
                break;
            }
        }
        series.push(Series { name: method.name().into(), line: true, competes: true, points });
    }
    let ends =
        series.iter().flat_map(|of| of.points.iter().map(|point| (point.y, of.name.as_str())));
    let (least, by) = ends
        .filter(|(y, _)| y.is_finite())
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .unwrap_or((f64::INFINITY, "-"));
    let (from, difference) = match &problem.known {
        Some(known) => (known.from, exponent(off(&found, &known.end))),
        None => ("-", "-".to_owned()),
    };
    let cells = vec![
        problem.title.into(),
        exponent(agreement),
        from.into(),
        difference,
        exponent(least),
        by.into(),
    ];
    let figure = Figure {
        id: format!("integration-{}", problem.id),
        title: problem.title.into(),
        caption: format!(
            "Error of y and ẏ at the end, by size, against the time of one whole simulation. The \
            reference is {of}, known to {}. A series ends where its next point would take more \
            than {longest} s.",
            exponent(known_to)
        ),
        x: Axis::log("time of one simulation, s"),
        y: Axis::log("error at the end"),
        series,
    };
    Ok((figure, Row { cells, title: problem.title, least }))
}

/// Steps or tolerances of a method, from coarse to fine, with their labels.
fn settings_of(problem: &Problem, method: Method) -> Vec<(String, Settings)> {
    if method.is_fixed() {
        let steps = (0..8).map(|k| problem.step * 0.5_f64.powi(k));
        let fixed = |step| Settings { step: Some(step), ..problem.settings(method) };
        steps.map(|step| (format!("step {step:.1e} s"), fixed(step))).collect()
    } else {
        let tolerances = (3..=12).map(|k| 10f64.powi(-k));
        let adaptive = |tol| (format!("tolerance {tol:.0e}"), problem.adaptive(method, tol));
        tolerances.map(adaptive).collect()
    }
}

/// The larger of both differences by size.
fn off(found: &[Vec<f64>; 2], reference: &[Vec<f64>; 2]) -> f64 {
    let difference = |k: usize| {
        let pairs = found[k].iter().zip(&reference[k]);
        by_size(pairs.map(|(a, b)| (a - b, *b)), 1e-9)
    };
    worse(difference(0), difference(1))
}
