//! The recording of one thread: the graph, and all conditions under which it equals the kernel.

use std::cell::RefCell;
use std::collections::HashMap;

use crate::graph::{Check, Comparison, Operation, Term};

/// Why a run cannot be recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Obstacle {
    /// More operations than allowed.
    TooLarge,
    /// A number left the kernels in a way that is not known, or a choice has no known comparison.
    NotStraight,
}

/// A comparison that the kernel made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Decision {
    pub(crate) comparison: Comparison,
    pub(crate) outcome: bool,
    /// The kernel chose by it and did nothing else with it.
    pub(crate) is_choice: bool,
}

/// A double of a recorded run: its value there, and the term that computes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Traced {
    pub(crate) value: f64,
    pub(crate) term: Term,
    /// Its zero may have the other sign.
    pub(crate) loose: bool,
}

/// A number that is warned of outside of its limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limited {
    pub(crate) x: Term,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
}

/// All that a run leaves.
#[derive(Default)]
pub(crate) struct Record {
    /// In their order, each once.
    pub(crate) operations: Vec<Operation>,
    places: HashMap<Operation, u32>,
    pub(crate) decisions: Vec<Decision>,
    /// The decision that choices from here on are made by.
    pub(crate) last: Option<usize>,
    pub(crate) checks: Vec<Check>,
    /// Numbers that must be finite, because a product of them with zero was left out.
    pub(crate) dropped: Vec<u32>,
    pub(crate) limited: Vec<Limited>,
    pub(crate) gains: Vec<Traced>,
    pub(crate) growths: Vec<Traced>,
    pub(crate) obstacle: Option<Obstacle>,
    /// Largest number of operations.
    most: usize,
}

std::thread_local! {
    static RECORD: RefCell<Record> = RefCell::new(Record::default());
}

/// Runs something on this thread's record.
pub(crate) fn with<R>(run: impl FnOnce(&mut Record) -> R) -> R {
    RECORD.with_borrow_mut(run)
}

/// Notes that this thread's run cannot be recorded; the first reason stays.
pub(crate) fn stop(obstacle: Obstacle) {
    with(|record| record.stop(obstacle));
}

/// Notes a condition under which the record is the kernel.
pub(crate) fn check(check: Check) {
    with(|record| record.checks.push(check));
}

/// Starts a new record of up to this many operations.
pub(crate) fn start(most: usize) {
    with(|record| *record = Record { most, ..Record::default() });
}

/// The record so far; the next one has to be started.
pub(crate) fn take() -> Record {
    with(std::mem::take)
}

impl Record {
    fn stop(&mut self, obstacle: Obstacle) {
        self.obstacle = self.obstacle.or(Some(obstacle));
    }

    /// The node of an operation, an old one where there is one.
    pub(crate) fn node(&mut self, operation: Operation) -> u32 {
        let next = self.operations.len();
        if next >= self.most {
            self.stop(Obstacle::TooLarge);
            return 0;
        }
        *self.places.entry(operation).or_insert_with(|| {
            self.operations.push(operation);
            next as u32
        })
    }

    /// A comparison of the kernel; a `choice` may follow it where `may_choose`.
    pub(crate) fn decide(&mut self, comparison: Comparison, outcome: bool, may_choose: bool) {
        self.last = may_choose.then_some(self.decisions.len());
        self.decisions.push(Decision { comparison, outcome, is_choice: false });
    }

    /// The comparison by which the kernel chooses: the last one. Kernels use a mask before they
    /// make the next one.
    pub(crate) fn choice(&mut self, outcome: bool) -> Option<(Term, Term)> {
        let last = self.last.and_then(|last| self.decisions.get_mut(last));
        let last = last.filter(|last| last.outcome == outcome);
        let Some(Decision { comparison: Comparison::Less(a, b), is_choice, .. }) = last else {
            self.stop(Obstacle::NotStraight);
            return None;
        };
        *is_choice = true;
        Some((*a, *b))
    }
}
