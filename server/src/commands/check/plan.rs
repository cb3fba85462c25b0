//! `sarrus check --plan`: the steps of a line's plan, the parts of the robot it needs, its cost.

use std::hint::black_box;
use std::time::{Duration, Instant};

use sarrus_client::{Status, describe};
use sarrus_dynamics::Planned;
use sarrus_models::Loaded;
use serde::Serialize;

use super::Check;
use crate::commands::ask::read_plan;
use crate::commands::output::{Failure, Outcome, Results, labelled};

/// Duration of the measurement, and of each of its batches.
const TIMED: Duration = Duration::from_millis(100);
const BATCH: Duration = Duration::from_micros(50);

/// The steps and the cost of a plan.
#[derive(Serialize)]
struct PlanReport {
    /// The status of the answer to the line.
    status: &'static str,
    steps: Vec<&'static str>,
    bodies: usize,
    bodies_of_robot: usize,
    clusters: usize,
    clusters_of_robot: usize,
    closed_loops: usize,
    closed_loops_of_robot: usize,
    operations: u64,
    /// Median of batches, in nanoseconds a call.
    ns: f64,
    bytes_in: usize,
    bytes_out: usize,
}

impl Check {
    /// The plan of a line.
    pub(super) fn plan_report(&self, line: &str) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let report =
            of_line(&loaded, line).map_err(|reason| Failure::start(format!("--plan: {reason}")))?;
        Ok(Results { text: self.format.render(&report, in_words), code: 0 })
    }
}

fn of_line(loaded: &Loaded, line: &str) -> Result<PlanReport, String> {
    let model = &loaded.compiled.model;
    let (query, input) = read_plan(&describe(loaded), line)?;
    let mut planned = Planned::new(model, &query).map_err(|error| error.to_string())?;
    let outline = planned.plan.outline(model);
    planned.input = input;
    let answer = planned.run(model);
    if answer.status == Status::BadRequest {
        return Err("the numbers are no state: a quaternion is not of unit length".to_owned());
    }
    Ok(PlanReport {
        status: answer.status.name(),
        steps: outline.steps,
        bodies: outline.bodies,
        bodies_of_robot: outline.bodies_of_robot,
        clusters: outline.clusters,
        clusters_of_robot: outline.clusters_of_robot,
        closed_loops: outline.closed,
        closed_loops_of_robot: outline.closed_of_robot,
        operations: sarrus_counting::operations(&planned.plan, model, &planned.input),
        ns: median_ns(&mut || _ = black_box(&mut planned).run(model)),
        bytes_in: outline.bytes_in,
        bytes_out: outline.bytes_out,
    })
}

/// Nanoseconds of a call, the median of batches.
fn median_ns(call: &mut impl FnMut()) -> f64 {
    let start = Instant::now();
    let mut calls = 0_u32;
    while calls == 0 || start.elapsed() < BATCH {
        call();
        calls += 1;
    }
    let start = Instant::now();
    let mut batches = Vec::new();
    while start.elapsed() < TIMED {
        let batch = Instant::now();
        (0..calls).for_each(|_| call());
        batches.push(batch.elapsed().as_nanos() as f64 / f64::from(calls));
    }
    batches.sort_unstable_by(f64::total_cmp);
    let median = batches.get(batches.len() / 2).copied().unwrap_or(f64::NAN);
    (median * 10.0).round() / 10.0
}

fn in_words(report: &PlanReport) -> String {
    let mut text = String::new();
    for (k, step) in report.steps.iter().enumerate() {
        text += &labelled(if k == 0 { "steps" } else { "" }, step);
    }
    let rows = [
        ("bodies", report.bodies, report.bodies_of_robot),
        ("clusters", report.clusters, report.clusters_of_robot),
        ("closed loops", report.closed_loops, report.closed_loops_of_robot),
    ];
    for (label, computed, all) in rows {
        text += &labelled(label, format!("{computed} of {all}"));
    }
    text += &labelled("operations", report.operations);
    text += &labelled("time", format!("{} ns", report.ns));
    text += &labelled("bytes", format!("{} in, {} out", report.bytes_in, report.bytes_out));
    text + &labelled("status", report.status)
}
