//! The tables of the times in process, and their numbers.

use sarrus_dynamics::Method;
use sarrus_report::measure::timing::Samples;
use sarrus_report::robots::{Question, Robot, Start};
use serde_json::{Value, json};

use crate::cases::Case;
use crate::errors::Errors;
use crate::table::{Table, error, ns};

/// Every table; none without cases.
pub(super) fn all(
    robots: &[Robot],
    cases: &[Case<'_>],
    errors: &[Errors],
    samples: &[Samples],
) -> Vec<Table> {
    if cases.is_empty() {
        return Vec::new();
    }
    vec![
        overview(cases, errors, samples),
        methods(cases, errors, samples),
        in_process(robots, cases, errors, samples),
    ]
}

/// One line for each way to close a robot's loops: the median times, the worst error, the Newton
/// steps.
fn overview(cases: &[Case<'_>], errors: &[Errors], samples: &[Samples]) -> Table {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for ((case, errors), samples) in cases.iter().zip(errors).zip(samples) {
        let key =
            [case.robot.name.to_owned(), case.variant.closures.to_owned(), start(case).to_owned()];
        if rows.last().is_none_or(|row| row[..3] != key) {
            rows.push(key.into_iter().chain((0..4).map(|_| String::new())).collect());
        }
        let column = match case.question {
            Question::State => 3,
            Question::InverseDynamics => 4,
            Question::ForwardDynamics => 5,
            _ => continue,
        };
        if let Some(row) = rows.last_mut() {
            row[column] = format!("{} ({})", ns(samples.median()), error(errors.worst));
            row[6] = newton(errors);
        }
    }
    Table {
        title: "In process: median ns per call (largest error by size)".to_owned(),
        columns: vec!["robot", "closures", "start", "state", "ID", "FD", "Newton"],
        n_text: 3,
        rows,
        notes: Vec::new(),
    }
}

/// Forward dynamics by each method, one line for each way to close a robot's loops.
fn methods(cases: &[Case<'_>], errors: &[Errors], samples: &[Samples]) -> Table {
    let all: Vec<(&Case<'_>, &Errors, &Samples)> =
        cases.iter().zip(errors).zip(samples).map(|((a, b), c)| (a, b, c)).collect();
    let mut rows = Vec::new();
    for group in all.chunk_by(|a, b| std::ptr::eq(a.0.variant, b.0.variant)) {
        let of = |method: Method| {
            group.iter().find(|(case, ..)| case.question == Question::Forced(method))
        };
        let Some((case, ..)) = of(Method::Recursion) else { continue };
        let chosen = case.variant.compiled.model.forward_method();
        let mut row: Vec<String> =
            [case.robot.name, case.variant.closures, start(case)].map(str::to_owned).into();
        for method in Method::ALL {
            row.push(of(method).map_or("-".to_owned(), |(_, errors, samples)| {
                let mark = if method == chosen { "* " } else { "" };
                format!(
                    "{mark}{} ({}, {})",
                    ns(samples.median()),
                    error(errors.worst),
                    errors.backward.map_or("-".to_owned(), error)
                )
            }));
        }
        // batches that others disturb only take longer
        let quarter = |method| of(method).map(|(.., samples)| samples.at(0.25));
        let other =
            if chosen == Method::Recursion { Method::Projection } else { Method::Recursion };
        let ratio = quarter(chosen)
            .zip(quarter(other))
            .map_or("-".to_owned(), |(chosen, other)| format!("{:.2}", chosen / other));
        row.push(ratio);
        rows.push(row);
    }
    Table {
        title: "Forward dynamics by each method: median ns per call (largest error by size, \
            largest backward error)"
            .to_owned(),
        columns: vec![
            "robot",
            "closures",
            "start",
            "recursion",
            "projection",
            "kkt",
            "chosen/other",
        ],
        n_text: 3,
        rows,
        notes: vec![
            "*: what the model chooses; chosen/other: its lower quartile against that of the other \
            fast method, above 1 a wrong choice."
                .to_owned(),
        ],
    }
}

fn in_process(
    robots: &[Robot],
    cases: &[Case<'_>],
    errors: &[Errors],
    samples: &[Samples],
) -> Table {
    let row = |((case, errors), samples): ((&Case<'_>, &Errors), &Samples)| {
        let backward = errors.backward.map_or("-".to_owned(), error);
        let mut row: Vec<String> =
            [case.robot.name, case.variant.closures, start(case), case.question.name()]
                .map(str::to_owned)
                .into();
        row.extend([samples.median(), samples.at(0.0), samples.at(0.99)].map(ns));
        row.extend([error(errors.worst), error(errors.median), backward, newton(errors)]);
        row
    };
    let batches = samples.iter().map(|samples| samples.count()).min().unwrap_or(0);
    let states = cases.first().map_or(0, |case| case.inputs.len());
    let mut notes = vec![
        format!(
            "ns per call over {batches} batches that took turns; error against double-double of \
            the same model on {states} random states"
        ),
        "by size, |a − b| / max(‖b‖, s) with s = 1 for q and u, ‖q̇‖² for q̈ and ü; backward: ‖M_y \
        ÿ + C_y − τ_y‖ relative to its terms;"
            .to_owned(),
        "Newton: steps of all blocks of a call, mean (largest); warm: the guess is the closed pose \
        1 ms earlier; cold: no guess;"
            .to_owned(),
        "hybrid-torso: torso numerical, elbows closed form; hybrid-elbows the other way round; \
        hybrid: as the robot is bundled.".to_owned(),
        "state: q q̇ q̈ u u̇ ü from y ẏ ÿ; ID: τ_u from y ẏ ÿ; FD: ÿ from y ẏ τ_u.".to_owned(),
    ];
    for robot in robots.iter().filter(|robot| robot.left_out > 0) {
        notes.push(format!(
            "{}: {} random states left out, some way to close the loops has no answer there.",
            robot.name, robot.left_out
        ));
    }
    for robot in robots.iter().filter(|robot| robot.reach < 1.0) {
        notes.push(format!("{}: positions from {} of the usual reach.", robot.name, robot.reach));
    }
    Table {
        title: "In process, in full".to_owned(),
        columns: vec![
            "robot",
            "closures",
            "start",
            "asked",
            "median",
            "min",
            "p99",
            "error",
            "median error",
            "backward",
            "Newton",
        ],
        n_text: 4,
        rows: cases.iter().zip(errors).zip(samples).map(row).collect(),
        notes,
    }
}

fn start(case: &Case<'_>) -> &'static str {
    match case.start {
        Start::None => "-",
        Start::Warm => "warm",
        Start::Cold => "cold",
    }
}

fn newton(errors: &Errors) -> String {
    errors.newton.map_or("-".to_owned(), |(mean, most)| format!("{mean:.1} ({most:.0})"))
}

/// The numbers of a case.
pub(super) fn value(case: &Case<'_>, errors: &Errors, samples: &Samples) -> Value {
    let mut value = json!({
        "case": case.name(),
        "median_ns": samples.median(),
        "min_ns": samples.at(0.0),
        "p99_ns": samples.at(0.99),
        "batches": samples.count(),
        "states": case.inputs.len(),
        "error": errors.worst,
        "median_error": errors.median,
    });
    if case.question.is_forward() {
        value["backward_error"] = json!(errors.backward);
        value["method"] = json!(case.plan.method().name());
    }
    if let Some((mean, most)) = errors.newton {
        value["newton_steps"] = json!({ "mean": mean, "most": most });
    }
    value
}
