//! A prepared plan with its robot, asked with numpy's arrays.

use std::num::NonZero;
use std::sync::{Arc, Mutex};

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use sarrus_client::{Answer, Model, PlanId, Query, QueryBuilder, Request, Robot};
use sarrus_dynamics::{Batch, Layout, PackedRows, Plan, Slot};

use super::arrays::{
    self, Given, Target, common_rows, copied, refuse_shared, refuse_shared_outputs, wanted, zeros,
};
use super::batch::{self, Engine, Rows};
use super::errors::QueryError;
use super::shared::Shared;
use super::signals::is_main;
use crate::locked;

/// How a batch is to be answered.
pub(super) struct BatchOptions {
    pub(super) threads: Option<NonZero<usize>>,
    pub(super) progress: Option<Py<PyAny>>,
}

/// A plan of a robot.
pub(super) struct Asked {
    shared: Arc<Shared>,
    id: PlanId,
    /// The layout of the input.
    pub(super) given: Layout,
    /// The layout of the output.
    pub(super) want: Layout,
    /// The query, from which this process prepares an engine for each thread, and the engines not
    /// in use.
    query: Query,
    batches: Mutex<Vec<Batch>>,
}

impl Drop for Asked {
    fn drop(&mut self) {
        self.shared.release(self.id);
    }
}

/// The result of a call.
pub(super) enum Answered<'py> {
    /// One state: the packed numbers.
    State { numbers: Vec<f64>, answer: Answer },
    /// Rows of states.
    Rows {
        fields: Vec<Bound<'py, PyAny>>,
        statuses: Bound<'py, PyArray1<u32>>,
        warnings: Bound<'py, PyArray1<u32>>,
        failed: Marked,
        warned: Marked,
    },
}

/// Rows with a number other than zero among statuses or warnings.
#[derive(Clone, Copy, Default)]
pub(super) struct Marked {
    pub(super) count: usize,
    /// The first of them, and its number.
    pub(super) first: Option<(usize, u32)>,
}

impl Marked {
    fn among(numbers: &[u32]) -> Marked {
        let mut marked = Marked::default();
        for (row, number) in numbers.iter().enumerate().filter(|(_, number)| **number != 0) {
            marked.count += 1;
            marked.first.get_or_insert((row, *number));
        }
        marked
    }
}

impl Asked {
    /// Prepares the query that `build` completes.
    pub(super) fn new(
        py: Python<'_>,
        shared: &Arc<Shared>,
        request: Request,
        build: impl for<'q> FnOnce(QueryBuilder<'q>) -> QueryBuilder<'q> + Send,
    ) -> PyResult<Asked> {
        let prepare = |robot: &mut Robot| {
            let id = build(robot.query(request)).prepare()?;
            Ok((id, robot.plan(id).cloned()))
        };
        let (id, prepared) = shared.prepare(py, prepare)?;
        let refused = |words: String| QueryError::new_err(words);
        let prepared = prepared.ok_or_else(|| refused("the plan was released".to_owned()))?;
        Ok(Asked {
            shared: Arc::clone(shared),
            id,
            given: prepared.given().clone(),
            want: prepared.want().clone(),
            query: *prepared.query(),
            batches: Mutex::new(Vec::new()),
        })
    }

    /// Asks with one array for each given field, in packing order; `out` has one for each wanted
    /// field, or `None`.
    pub(super) fn ask<'py>(
        &self,
        py: Python<'py>,
        given: &[Bound<'py, PyAny>],
        out: &[Option<Bound<'py, PyAny>>],
        options: &BatchOptions,
    ) -> PyResult<Answered<'py>> {
        let mut input = Vec::with_capacity(self.given.len());
        let mut slots = self.given.slots().iter().zip(given);
        if !batch::is_under_way() && slots.all(|(slot, object)| copied(object, slot, &mut input)) {
            return self.ask_state(py, &input, out);
        }
        let slots = self.given.slots().iter();
        let given: Vec<Given<'py>> = slots
            .zip(given)
            .map(|(slot, object)| Given::new(object, slot))
            .collect::<PyResult<_>>()?;
        match common_rows(&given)? {
            None => {
                input.clear();
                for field in &given {
                    input.extend_from_slice(field.numbers()?);
                }
                // an array may be input and output
                drop(given);
                self.ask_state(py, &input, out)
            }
            Some(rows) => self.ask_rows(py, &given, rows, out, options),
        }
    }

    fn ask_state<'py>(
        &self,
        py: Python<'py>,
        input: &[f64],
        out: &[Option<Bound<'py, PyAny>>],
    ) -> PyResult<Answered<'py>> {
        refuse_shared_outputs(out)?;
        let mut numbers = vec![f64::NAN; self.want.len()];
        let answer = self.shared.with(py, |robot| robot.ask(self.id, input, &mut numbers));
        if answer.is_err() {
            // no number of an earlier call is left
            self.fields(py, &vec![f64::NAN; numbers.len()], out)?;
        }
        Ok(Answered::State { numbers, answer: answer? })
    }

    fn ask_rows<'py>(
        &self,
        py: Python<'py>,
        given: &[Given<'py>],
        rows: usize,
        out: &[Option<Bound<'py, PyAny>>],
        options: &BatchOptions,
    ) -> PyResult<Answered<'py>> {
        // the arrays that are written
        let slots = self.want.slots();
        let fields = slots
            .iter()
            .enumerate()
            .map(|(k, slot)| wanted(py, slot, Some(rows), out.get(k).and_then(Option::as_ref)))
            .collect::<PyResult<Vec<_>>>()?;
        let targets = fields
            .iter()
            .zip(slots)
            .map(|(field, slot)| Target::new(field, slot.field.name()))
            .collect::<PyResult<Vec<_>>>()?;
        let mut written = targets.iter().map(Target::claim).collect::<PyResult<Vec<_>>>()?;
        let statuses: Bound<'py, PyArray1<u32>> = zeros::<u32>(py, &[rows])?.cast_into()?;
        let warnings: Bound<'py, PyArray1<u32>> = zeros::<u32>(py, &[rows])?.cast_into()?;
        let mut all_statuses = statuses.try_readwrite()?;
        let mut all_warnings = warnings.try_readwrite()?;
        let width = |slot: &Slot| slot.range().len();
        let mut want = Vec::with_capacity(slots.len());
        for (array, slot) in written.iter_mut().zip(slots) {
            want.push((array.as_slice_mut()?, width(slot)));
        }
        let mut read = Vec::with_capacity(given.len());
        for (field, slot) in given.iter().zip(self.given.slots()) {
            read.push((field.numbers()?, width(slot)));
        }
        refuse_shared(&read, &want)?;
        let numbers = Rows {
            rows,
            given: read,
            want,
            statuses: all_statuses.as_slice_mut()?,
            warnings: all_warnings.as_slice_mut()?,
        };

        let outcome = self.answer_rows(py, numbers, options);
        drop(written);
        targets.iter().try_for_each(Target::finish)?;
        outcome?;
        let failed = Marked::among(all_statuses.as_slice()?);
        let warned = Marked::among(all_warnings.as_slice()?);
        drop((all_statuses, all_warnings));
        let fields = fields.into_iter().map(Bound::into_any).collect();
        Ok(Answered::Rows { fields, statuses, warnings, failed, warned })
    }

    /// Answers rows with one engine for each thread, or through the one lane of a connected robot.
    fn answer_rows(
        &self,
        py: Python<'_>,
        numbers: Rows<'_>,
        options: &BatchOptions,
    ) -> PyResult<()> {
        let progress = options.progress.as_ref();
        let Some(model) = &self.shared.model else {
            return self.answer_rows_by_server(py, numbers, progress);
        };
        let n = batch::threads(options.threads, numbers.rows);
        let mut batches = self.batches(model, n)?;
        let mut engines = Vec::with_capacity(n);
        for batch in &mut batches {
            let engine: Box<Engine<'_>> = Box::new(|given, want, answers| {
                batch.run_fields(given, want, answers);
                Ok(())
            });
            engines.push(engine);
        }
        let outcome = batch::run(py, numbers, engines, progress);
        self.keep(batches);
        outcome
    }

    fn answer_rows_by_server(
        &self,
        py: Python<'_>,
        numbers: Rows<'_>,
        progress: Option<&Py<PyAny>>,
    ) -> PyResult<()> {
        // refuses a robot of the parent's
        self.shared.with(py, |_| Ok(()))?;
        let is_main = is_main(py)?;
        let mut packed = PackedRows::new(batch::TILE, self.given.len(), self.want.len());
        let engine: Box<Engine<'_>> = Box::new(|given, want, answers| {
            let rows = 0..answers.len();
            let (input, output) = packed.pack(given, rows.clone());
            self.shared.batch_detached(is_main, self.id, input, output, answers)?;
            packed.unpack(want, rows);
            Ok(())
        });
        batch::run(py, numbers, vec![engine], progress)
    }

    /// Keeps engines for the next batch, at most one for each processor.
    fn keep(&self, mut batches: Vec<Batch>) {
        let mut kept = locked(&self.batches);
        let excess =
            batches.split_off(batch::processors().saturating_sub(kept.len()).min(batches.len()));
        kept.append(&mut batches);
        drop(kept);
        drop(excess);
    }

    /// Engines for this number of threads: the kept ones and clones of them.
    fn batches(&self, model: &Arc<Model<f64>>, threads: usize) -> PyResult<Vec<Batch>> {
        let mut kept = locked(&self.batches);
        let free = kept.len().min(threads);
        let mut batches: Vec<Batch> = kept.drain(..free).collect();
        drop(kept);
        if batches.is_empty() {
            let plan = Plan::new(model, &self.query)
                .map_err(|error| QueryError::new_err(error.to_string()))?;
            batches.push(Batch::new(model, &plan));
        }
        while batches.len() < threads {
            batches.extend(batches.first().cloned());
        }
        Ok(batches)
    }

    /// The fields of one state as arrays and numbers.
    pub(super) fn fields<'py>(
        &self,
        py: Python<'py>,
        numbers: &[f64],
        out: &[Option<Bound<'py, PyAny>>],
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        (0..self.want.slots().len()).map(|k| self.field(py, k, numbers, out)).collect()
    }

    /// One field of one state.
    pub(super) fn field<'py>(
        &self,
        py: Python<'py>,
        k: usize,
        numbers: &[f64],
        out: &[Option<Bound<'py, PyAny>>],
    ) -> PyResult<Bound<'py, PyAny>> {
        let slot = &self.want.slots()[k];
        arrays::of_state(py, slot, &numbers[slot.range()], out.get(k).and_then(Option::as_ref))
    }
}
