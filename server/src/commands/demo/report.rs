//! The results of the demo.

use std::path::PathBuf;

use hdrhistogram::Histogram;
use sarrus_client::ModelInfo;
use sarrus_proto::{ClosureKind, Sizes};
use serde::Serialize;

use super::trajectory::{DURATION, REACH, SAMPLES};
use crate::commands::output::table;

/// Relative error from which the demo fails.
pub(super) const LIMIT: f64 = 1e-12;

/// The printed results.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) robot: String,
    pub(super) sizes: Sizes,
    /// Submechanisms by kind of closure.
    analytic: usize,
    numerical: usize,
    pub(super) samples: usize,
    pub(super) numbers_in: usize,
    pub(super) numbers_out: usize,
    pub(super) ways: Vec<Way>,
    /// The largest error over all measurements.
    worst_error: f64,
    /// Every answer came with status `ok` and its error is below the limit.
    pub(super) good: bool,
    /// The robot as a page.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<PathBuf>,
}

/// Round-trip times of one way to ask.
#[derive(Serialize)]
pub(super) struct Way {
    pub(super) way: &'static str,
    requests: u64,
    failed: u64,
    p50_us: f64,
    p90_us: f64,
    p99_us: f64,
    #[serde(rename = "p99.9_us")]
    p999_us: f64,
    max_us: f64,
    worst_error: f64,
}

impl Way {
    pub(super) fn new(
        way: &'static str,
        times_ns: &Histogram<u64>,
        failed: u64,
        worst_error: f64,
    ) -> Way {
        let us = |quantile| times_ns.value_at_quantile(quantile) as f64 / 1e3;
        Way {
            way,
            requests: times_ns.len(),
            failed,
            p50_us: us(0.5),
            p90_us: us(0.9),
            p99_us: us(0.99),
            p999_us: us(0.999),
            max_us: times_ns.max() as f64 / 1e3,
            worst_error,
        }
    }
}

impl Report {
    pub(super) fn new(
        model: &ModelInfo,
        (numbers_in, numbers_out): (usize, usize),
        reference_is_whole: bool,
        ways: Vec<Way>,
        page: Option<PathBuf>,
    ) -> Report {
        let of_kind = |kind| model.closures.iter().filter(|closure| closure.kind == kind).count();
        let worst_error = ways.iter().fold(0.0, |worst: f64, way| worst.max(way.worst_error));
        Report {
            robot: model.robot.clone(),
            sizes: model.sizes,
            analytic: of_kind(ClosureKind::Analytic),
            numerical: of_kind(ClosureKind::Numerical),
            samples: SAMPLES,
            numbers_in,
            numbers_out,
            good: reference_is_whole
                && worst_error < LIMIT
                && ways.iter().all(|way| way.failed == 0 && way.requests > 0),
            worst_error,
            ways,
            page,
        }
    }

    pub(super) fn in_words(&self, about: &str) -> String {
        let Sizes { n_v, n_vy, n_u, n_c, .. } = self.sizes;
        let mut text = format!(
            "{}: {about}\n  {n_v} joints in the spanning tree, {n_vy} of them independent; {n_u} \
             actuators; {n_c} loop-closure equations\n  \
             loops of {} submechanisms in closed form, of {} by Newton's method\n\n\
             A server process holds the robot. A controller in this process moves all {n_vy} \
             joints through the middle {:.0} % of their\n\
             range along cycloids ({DURATION} s at 1 kHz, over and over) and asks for the {n_u} \
             actuator forces of each sample:\n\
             inverse dynamics, {} numbers in, {} out. Every answer is compared with double-double \
             arithmetic (32 digits).\n\n",
            self.robot,
            self.analytic,
            self.numerical,
            100.0 * REACH,
            self.numbers_in,
            self.numbers_out
        );
        let row = |way: &Way| {
            let mut row = vec![way.way.to_owned(), way.requests.to_string()];
            row.extend(
                [way.p50_us, way.p90_us, way.p99_us, way.p999_us, way.max_us]
                    .map(|us| format!("{us:.2}")),
            );
            row.push(format!("{:.1e}", way.worst_error));
            row
        };
        let rows: Vec<Vec<String>> = self.ways.iter().map(row).collect();
        let heads = "time per request, µs | requests | median | 90 % | 99 % | 99.9 % | largest | \
                     worst error";
        text += &table(heads, &rows);
        let requests: u64 = self.ways.iter().map(|way| way.requests).sum();
        let failed: u64 = self.ways.iter().map(|way| way.failed).sum();
        text += &match failed {
            0 => format!("\nAll {requests} answers are ok. "),
            n => format!("\n{n} of {requests} answers FAILED. "),
        };
        let relation = if self.worst_error < LIMIT { "within" } else { "OUTSIDE" };
        text += &format!(
            "Worst error {:.1e} of the largest force of its sample, {relation} the limit of \
             {LIMIT:.0e}.\n",
            self.worst_error
        );
        if let Some(page) = &self.page {
            text += &format!("See the robot, with sliders that move it: {}\n", page.display());
        }
        text
    }
}
