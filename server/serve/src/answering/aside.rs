//! States that need more than a turn of the answering thread are computed on threads beside it, one
//! at a time, while it answers other clients: one thread for states up to the bound of a request,
//! one for searches of any length.
//!
//! A request that waits for such a thread stays pending, and each sweep looks for its answer.
//! Clients wait in a queue; one that stops looking loses its place or answer after [`PATIENCE`]
//! sweeps.
//!
//! The queue shares the thread's time: a state is due when the times of its client's earlier states
//! have passed (start-time fair queueing, Goyal, Vin and Cheng 1996). So a client that rarely has
//! such a state waits for the one that is computed, not for one of each other client.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};
use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT, PlanNumber};
use sarrus_proto::{Answer, Status, Warnings};

use crate::answering::wait::{LONG_NAP, NAP, QUIET};
use crate::error::ServeError;

/// Sweeps for which a thread is kept for one client.
const PATIENCE: u32 = 4096;

/// A state of a pending request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Key {
    /// The client.
    pub(crate) place: usize,
    pub(crate) plan: PlanNumber,
    pub(crate) sequence: u64,
    /// The row of a batch; `None` for a single request.
    pub(crate) row: Option<usize>,
}

/// A state on its way to a thread and back, with room for any.
struct Job {
    /// Dropped by the thread, so that the answering thread frees none.
    plan: Option<Arc<Plan>>,
    input: Vec<f64>,
    output: Vec<f64>,
    n_in: usize,
    n_out: usize,
    answer: Answer,
    /// The time of the computation.
    took: Duration,
}

/// The answering thread's end.
pub(crate) struct Aside {
    to: Producer<Box<Job>>,
    from: Consumer<Box<Job>>,
    /// The job, while no state is computed.
    job: Option<Box<Job>>,
    /// The state that is computed, or whose answer is in the job.
    current: Option<Key>,
    /// States that wait for the thread, with the times when they are due, the first one next.
    queue: Vec<(Key, Duration)>,
    /// Of the last state that the thread was given: its client, and when it was due.
    last: (usize, Duration),
    /// When the next state of each client is due at the earliest.
    due: Vec<Duration>,
    /// Sweeps since the client that is awaited has last looked.
    sweeps: u32,
}

/// The outcome of a look at a thread.
pub(crate) enum Look<'a> {
    /// Nothing of this state.
    Nothing,
    /// It waits for the thread, or is computed.
    Waits,
    /// Its answer, with the numbers.
    Answered(Answer, &'a [f64]),
}

impl Aside {
    /// Starts a thread, which ends with this end; `place` is called on it first. There are at most
    /// so many clients.
    ///
    /// # Errors
    /// [`ServeError::Thread`].
    pub(crate) fn start(
        model: &Arc<Model<f64>>,
        name: &str,
        clients: usize,
        place: impl FnOnce() + Send + 'static,
    ) -> Result<Aside, ServeError> {
        let (to, jobs) = RingBuffer::new(1);
        let (done, from) = RingBuffer::new(1);
        let model = model.clone();
        let body = move || {
            place();
            let workspace = Workspace::new(&model);
            compute_jobs(&model, workspace, jobs, done);
        };
        let builder = thread::Builder::new().name(name.to_owned());
        builder.spawn(body).map_err(ServeError::Thread)?;
        let job = Box::new(Job {
            plan: None,
            input: vec![0.0; MAX_NUMBERS_IN],
            output: vec![0.0; MAX_NUMBERS_OUT],
            n_in: 0,
            n_out: 0,
            answer: Answer { status: Status::UnknownRequest, warnings: Warnings::NONE },
            took: Duration::ZERO,
        });
        // a client has a request and a batch at once
        let queue = Vec::with_capacity(2 * clients);
        let last = (0, Duration::ZERO);
        let due = vec![Duration::ZERO; clients];
        Ok(Aside { to, from, job: Some(job), current: None, queue, last, due, sweeps: 0 })
    }

    /// Looks for a state: its answer, or its place in the queue, from which the thread takes it.
    #[inline]
    pub(crate) fn look(&mut self, key: Key, plan: &Arc<Plan>, input: &[f64]) -> Look<'_> {
        if self.current.is_none() && self.queue.is_empty() {
            return Look::Nothing;
        }
        self.look_closely(key, plan, input)
    }

    #[cold]
    fn look_closely(&mut self, key: Key, plan: &Arc<Plan>, input: &[f64]) -> Look<'_> {
        if let Ok(job) = self.from.pop() {
            let (place, start) = self.last;
            if let Some(due) = self.due.get_mut(place) {
                *due = start.saturating_add(job.took);
            }
            self.job = Some(job);
            self.sweeps = 0;
        }
        // a client that asks for something else has given its older state up
        let is_older = |other: &Key| other.is_of(key) && *other != key;
        self.queue.retain(|(other, _)| !is_older(other));
        if self.job.is_some() && self.current.as_ref().is_some_and(is_older) {
            self.current = None;
        }
        if self.awaited() == Some(key) {
            self.sweeps = 0;
        }
        if self.current == Some(key) {
            let Some(job) = &self.job else { return Look::Waits };
            self.current = None;
            // the next client of this place may count from the same number
            let own = job.input[..job.n_in].iter().map(|x| x.to_bits());
            return match own.eq(input.iter().map(|x| x.to_bits())) {
                true => Look::Answered(job.answer, &job.output[..job.n_out]),
                false => Look::Nothing,
            };
        }
        let Some(place) = self.queue.iter().position(|(other, _)| *other == key) else {
            return Look::Nothing;
        };
        if self.current.is_none() && place == 0 {
            let (_, due) = self.queue.remove(0);
            self.start_job((key, due), plan, input);
        }
        Look::Waits
    }

    /// The state whose client has to come: for its answer, or as the next one.
    fn awaited(&self) -> Option<Key> {
        let is_home = self.job.is_some();
        self.current.or(self.queue.first().map(|(key, _)| *key)).filter(|_| is_home)
    }

    /// Drops the answer, or the first in the queue, that nobody has come for; true if a client has
    /// to come.
    #[inline]
    pub(crate) fn end_sweep(&mut self) -> bool {
        if self.awaited().is_none() {
            return false;
        }
        self.sweeps += 1;
        if self.sweeps > PATIENCE {
            self.sweeps = 0;
            if self.current.take().is_none() {
                self.queue.remove(0);
            }
        }
        true
    }

    /// Hands a state to the thread, or puts it into the queue.
    #[cold]
    pub(crate) fn submit(&mut self, key: Key, plan: &Arc<Plan>, input: &[f64]) {
        let own = self.due.get(key.place).copied().unwrap_or_default();
        let due = own.max(self.last.1);
        if self.current.is_none() && self.queue.is_empty() {
            self.start_job((key, due), plan, input);
        } else if self.queue.len() < self.queue.capacity() {
            let place = self.queue.partition_point(|(_, other)| *other <= due);
            self.queue.insert(place, (key, due));
        }
        // beyond that there are more states than clients: it is computed again in its next turn
    }

    /// Hands a state to the thread, which computes none.
    fn start_job(&mut self, (key, due): (Key, Duration), plan: &Arc<Plan>, input: &[f64]) {
        let Some(mut job) = self.job.take() else { return };
        self.last = (key.place, due);
        job.plan = Some(plan.clone());
        (job.n_in, job.n_out) = (input.len(), plan.want().len());
        job.input[..input.len()].copy_from_slice(input);
        self.current = Some(key);
        // there is room for the only job
        drop(self.to.push(job));
    }
}

impl Key {
    /// True if both are of the same client, each a request or each a row of its batch.
    fn is_of(&self, other: Key) -> bool {
        self.place == other.place && self.row.is_some() == other.row.is_some()
    }
}

/// Computes one state after the other until the other end is dropped.
fn compute_jobs(
    model: &Model<f64>,
    mut workspace: Workspace<f64>,
    mut jobs: Consumer<Box<Job>>,
    mut done: Producer<Box<Job>>,
) {
    let mut last = Instant::now();
    while !done.is_abandoned() {
        let Ok(mut job) = jobs.pop() else {
            thread::sleep(if last.elapsed() < QUIET { NAP } else { LONG_NAP });
            continue;
        };
        let start = Instant::now();
        if let Some(plan) = job.plan.take() {
            let Job { input, output, n_in, n_out, .. } = &mut *job;
            let (input, output) = (&input[..*n_in], &mut output[..*n_out]);
            let run = AssertUnwindSafe(|| plan.run(model, &mut workspace, input, output));
            job.answer = catch_unwind(run).unwrap_or_else(|_| {
                output.fill(f64::NAN);
                workspace = Workspace::new(model);
                Answer { status: Status::NotConverged, warnings: Warnings::NONE }
            });
        }
        last = Instant::now();
        job.took = last - start;
        if done.push(job).is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sarrus_models::{Options, Source, load};
    use sarrus_proto::{Field, Query, Request};

    /// A client that asks again at once does not pass one that comes later with its first state.
    #[test]
    fn the_times_of_earlier_states_decide_who_is_next() {
        let source = Source::Bundled("delta".into());
        let model = Arc::new(load(&source, &Options::default()).unwrap().compiled.model);
        let query = Query::new(Request::Kinematics, Field::Y.into(), Field::Q.into());
        let plan = Arc::new(Plan::new(&model, &query).unwrap());
        let mut aside = Aside::start(&model, "aside", 5, || {}).unwrap();
        let input = [-1.0, 0.5, -0.8];
        let key = |place: usize, sequence| Key { place, plan: PlanNumber(0), sequence, row: None };
        let mut waiting = vec![key(1, 1), key(2, 1), key(3, 1)];
        for key in &waiting {
            aside.submit(*key, &plan, &input);
        }
        let mut order = Vec::new();
        while !waiting.is_empty() {
            for state in waiting.clone() {
                if let Look::Waits = aside.look(state, &plan, &input) {
                    continue;
                }
                waiting.retain(|other| *other != state);
                order.push(state.place);
                if order.len() == 1 {
                    waiting.extend([key(1, 2), key(4, 1)]);
                    aside.submit(key(1, 2), &plan, &input);
                    aside.submit(key(4, 1), &plan, &input);
                }
            }
        }
        assert_eq!(order, [1, 2, 3, 4, 1]);
    }
}
