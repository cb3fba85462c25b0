//! The harness of stress cases: a robot, a question, a reference, an assessment.
//!
//! Each file depends on those before it: `robot`, `question`, `assess`, `case`, `judged`, `runs`.

use crate::measure::Effort;

mod assess;
mod case;
mod judged;
mod question;
mod robot;
mod runs;

pub(super) use self::assess::{HELD, warned};
pub(super) use self::case::{At, Case, Cases, Reference};
pub(super) use self::question::{Question, State, backward_error, error, off_loops, offsets};
pub(super) use self::robot::{
    Robot, Slide, Turn, X, Y, Z, bundled, cut, finish, heavier, joint, mechanism, numerical, scaled,
};
pub(super) use self::runs::{Trial, apart, from, reference_run, settings};

/// Powers of ten from 10^from to 10^to: all of them, or this many in a quick report.
pub(super) fn powers(effort: &Effort, from: i32, to: i32, steps: i32) -> Vec<f64> {
    let steps = if effort.quick { steps } else { to - from };
    (0..=steps).map(|k| 10f64.powi(from + (to - from) * k / steps)).collect()
}

/// Values followed by others.
pub(super) fn with(values: &[f64], others: &[f64]) -> Vec<f64> {
    [values, others].concat()
}

/// Seeds from 0 on, fewer in a quick report, and then the given ones beyond these.
pub(super) fn seeds(effort: &Effort, [few, more]: [u64; 2], also: &[u64]) -> Vec<u64> {
    let first = if effort.quick { few } else { more };
    (0..first).chain(also.iter().copied().filter(|seed| *seed >= first)).collect()
}
