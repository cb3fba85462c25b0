//! Nanoseconds per call, in alternating batches.

use std::time::{Duration, Instant};

use sarrus_dynamics::Status;

use crate::Outcome;

/// States in the batches of a case.
const STATES: usize = 64;
/// A batch takes at most this long unless four states take longer: on a shared machine long ones
/// are interrupted.
const LONGEST: Duration = Duration::from_micros(200);
/// A batch takes at least this long: the overhead of the clock is then below one percent.
const BATCH: Duration = Duration::from_micros(15);
/// Untimed calls before each batch take this long: the other cases used the caches and the branch
/// predictor.
const WARM_UP: Duration = Duration::from_micros(80);

/// Nanoseconds of all batches or round trips of a case, in ascending order.
#[derive(Clone, Debug, Default)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Sorts them.
    pub fn new(mut ns: Vec<f64>) -> Samples {
        ns.sort_unstable_by(f64::total_cmp);
        Samples(ns)
    }

    /// The least value that this share of the samples does not exceed; 0 for the least, NaN without
    /// samples.
    pub fn at(&self, quantile: f64) -> f64 {
        let last = self.0.len().saturating_sub(1);
        self.0
            .get(((quantile * self.0.len() as f64) as usize).min(last))
            .copied()
            .unwrap_or(f64::NAN)
    }

    /// The median.
    pub fn median(&self) -> f64 {
        self.at(0.5)
    }

    /// Number of samples.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Every sample, as pairs of a value in tenths of a nanosecond and its count.
    pub fn counted(&self) -> Vec<(u64, usize)> {
        let tenths: Vec<u64> = self.0.iter().map(|ns| (10.0 * ns).round() as u64).collect();
        tenths.chunk_by(|a, b| a == b).map(|equal| (equal[0], equal.len())).collect()
    }
}

/// The states of a case's batch.
#[derive(Clone, Copy)]
struct Batch {
    /// The first state; the next batch continues after the last one.
    first: usize,
    states: usize,
    /// Untimed calls before the batch.
    warm_up: usize,
    /// Number of passes over its states.
    passes: usize,
}

/// A timed case: a call on each of some states.
pub trait Timed {
    /// Its name in failures.
    fn name(&self) -> String;
    /// Number of states.
    fn states(&self) -> usize;
    /// One call, with input and result hidden from the optimiser.
    fn call(&mut self, state: usize) -> Status;
}

/// Runs a batch of every case in turn, repeatedly for this long; returns the nanoseconds per call
/// of each batch. `shown` gets the fraction done.
///
/// # Errors
///
/// A case that has no answer.
pub fn interleaved<C: Timed>(
    cases: &mut [C],
    rounds: Duration,
    shown: impl Fn(f64),
) -> Outcome<Vec<Samples>> {
    let mut batches = Vec::new();
    for case in cases.iter_mut() {
        let few = Batch { first: 0, states: case.states().min(4), warm_up: 1, passes: 1 };
        let call = few.run(case)?.max(1.0);
        let states = (LONGEST.as_nanos() as f64 / call) as usize;
        let states = states.clamp(4, STATES).min(case.states());
        let passes = (BATCH.as_nanos() as f64 / (call * states as f64)).ceil() as usize;
        batches.push(Batch {
            first: 0,
            states,
            warm_up: (WARM_UP.as_nanos() as f64 / call).ceil() as usize,
            passes,
        });
    }
    let mut ns = vec![Vec::new(); cases.len()];
    let start = Instant::now();
    while !cases.is_empty() && start.elapsed() < rounds {
        shown(start.elapsed().as_secs_f64() / rounds.as_secs_f64());
        for ((case, batch), ns) in cases.iter_mut().zip(&mut batches).zip(&mut ns) {
            ns.push(batch.run(case)?);
            batch.first = (batch.first + batch.states) % STATES.min(case.states());
        }
    }
    Ok(ns.into_iter().map(Samples::new).collect())
}

impl Batch {
    /// Nanoseconds per call.
    fn run<C: Timed>(&self, case: &mut C) -> Outcome<f64> {
        let all = STATES.min(case.states());
        let mut failed = false;
        for k in 0..self.warm_up {
            failed |= case.call((self.first + k) % all) != Status::Ok;
        }
        let mut state = self.first;
        let start = Instant::now();
        for _ in 0..self.passes * self.states {
            failed |= case.call(state) != Status::Ok;
            state = if state + 1 == all { 0 } else { state + 1 };
        }
        let elapsed = start.elapsed().as_nanos() as f64;
        if failed {
            Err(format!("{} fails", case.name()).into())
        } else {
            Ok(elapsed / (self.passes * self.states) as f64)
        }
    }
}
