//! Answers many states at once: rows in, rows out, on a given number of threads.

use std::num::NonZero;
use std::sync::{Mutex, PoisonError};
use std::thread;

use sarrus_dynamics::Batch;
#[cfg(feature = "kernels")]
use sarrus_generate::NativeKernel;
use sarrus_proto::batch::BatchShape;
use sarrus_proto::{Answer, QueryOptions, Status, Warnings};

use crate::plan::Plans;
use crate::remote::Remote;
use crate::{Error, PlanId, Robot};

/// Rows per tile, which a thread takes at once.
const TILE: usize = 256;

impl Robot {
    /// Answers one state for each element of `answers`: `input` and `output` hold their rows one
    /// after the other, each packed in the plan's layout, and every row, status and warning has the
    /// bits of [`Robot::ask`]. In process up to `threads` threads work, including the calling one;
    /// each keeps its scratch for the next batch of the plan. A server takes up to
    /// [`MAX_BATCH_ROWS`](sarrus_proto::batch::MAX_BATCH_ROWS) rows at once, computes some of them
    /// together, and answers other clients in between;
    /// [`ConnectOptions::timeout`](crate::ConnectOptions::timeout) is its longest time without an
    /// answered row. Plans with a checksum are asked row by row. The rows of a refused batch have
    /// the reason as their status. If the sizes do not fit, every row is [`Status::WrongSize`] and
    /// NaN. [`Robot::times`] is `None` after a batch, and deadlines apply to single requests only.
    /// Allocates nothing after the first batch.
    ///
    /// # Errors
    /// As [`Robot::ask`]; rows that have no answer yet are NaN then, with the status
    /// [`Status::UnknownRequest`].
    ///
    /// ```
    /// use std::num::NonZero;
    ///
    /// use sarrus_client::{Answer, Options, Request, Robot, Source, Status, Warnings};
    ///
    /// let mut robot = Robot::load(&Source::Bundled("lambda".into()), &Options::default())?;
    /// let plan = robot.query(Request::InverseDynamics).given(["y"]).want(["tau_u"]).prepare()?;
    /// let angles: Vec<f64> = (0..100).map(|k| 0.005 * f64::from(k)).collect();
    /// let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
    /// let (mut forces, mut answers) = (vec![0.0; 100], vec![unknown; 100]);
    /// robot.batch(plan, NonZero::<usize>::MIN, &angles, &mut forces, &mut answers)?;
    /// assert!(answers.iter().all(|answer| answer.status == Status::Ok));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn batch(
        &mut self,
        plan: PlanId,
        threads: NonZero<usize>,
        input: &[f64],
        output: &mut [f64],
        answers: &mut [Answer],
    ) -> Result<(), Error> {
        output.fill(f64::NAN);
        answers.fill(Answer { status: Status::UnknownRequest, warnings: Warnings::NONE });
        self.forget_times();
        let (_, prepared) = self.plans.find(plan)?;
        let n_in = prepared.given().len();
        let n_out = prepared.want().len();
        let checks = prepared.query().options.contains(QueryOptions::CHECKSUM);
        let rows = answers.len();
        if Some(input.len()) != rows.checked_mul(n_in)
            || Some(output.len()) != rows.checked_mul(n_out)
        {
            answers.fill(Answer { status: Status::WrongSize, warnings: Warnings::NONE });
            return Ok(());
        }
        let mut rows = Rows { widths: [n_in, n_out], input, output, answers };
        let threads = threads.get().min(rows.answers.len().div_ceil(TILE)).max(1);
        match self.batches(plan, threads)? {
            Batches::Here(here) => answer_all(here, rows),
            // the numbers of a batch have no checksum
            Batches::There { .. } if checks => {
                let asked = self.ask_all(plan, rows);
                self.forget_times();
                asked?;
            }
            Batches::There { remote, plans, place } => {
                while let Some(rows) = rows.take(BatchShape::most_rows(n_in, n_out)) {
                    let Rows { input, output, answers, .. } = rows;
                    // there is one: this many rows fit
                    if let Some(shape) = BatchShape::new(answers.len() as u64, n_in, n_out) {
                        remote.batch(plans, place, &shape, input, output, answers)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Asks row by row.
    fn ask_all(&mut self, plan: PlanId, mut rows: Rows<'_>) -> Result<(), Error> {
        while let Some(row) = rows.take(1) {
            for answer in row.answers {
                *answer = self.ask(plan, row.input, row.output)?;
            }
        }
        Ok(())
    }
}

/// The engine that answers batches of a plan.
pub(crate) enum Batches<'a> {
    Here(Here<'a>),
    /// A server.
    There {
        remote: &'a mut Remote,
        plans: &'a Plans,
        place: usize,
    },
}

/// Batches of a plan in this process.
pub(crate) struct Here<'a> {
    /// One for each thread.
    pub(crate) batches: &'a mut [Batch],
    #[cfg(feature = "kernels")]
    pub(crate) kernel: Option<&'a NativeKernel>,
}

/// Rows that have no answer yet.
struct Rows<'a> {
    /// Numbers of a row in and out.
    widths: [usize; 2],
    input: &'a [f64],
    output: &'a mut [f64],
    answers: &'a mut [Answer],
}

impl<'a> Rows<'a> {
    /// Takes up to this many rows off the front; `None` if none remains.
    fn take(&mut self, most: usize) -> Option<Rows<'a>> {
        let rows = self.answers.len().min(most);
        if rows == 0 {
            return None;
        }
        let [n_in, n_out] = self.widths;
        let input = self.input.split_off(..rows * n_in)?;
        let output = self.output.split_off_mut(..rows * n_out)?;
        let answers = self.answers.split_off_mut(..rows)?;
        Some(Rows { widths: self.widths, input, output, answers })
    }
}

/// Answers all rows, tile by tile, on one thread per engine.
fn answer_all(here: Here<'_>, rows: Rows<'_>) {
    let Some((own, others)) = here.batches.split_first_mut() else { return };
    let left = Mutex::new(rows);
    let work = |batch: &mut Batch| {
        loop {
            let tile = left.lock().unwrap_or_else(PoisonError::into_inner).take(TILE);
            let Some(tile) = tile else { break };
            #[cfg(feature = "kernels")]
            if let Some(kernel) = here.kernel {
                let (plan, scratch) = batch.parts();
                kernel.answer_rows(plan, scratch, tile.input, tile.output, tile.answers);
                continue;
            }
            batch.run(tile.input, tile.output, tile.answers);
        }
    };
    // a scope of threads takes a block of memory
    if others.is_empty() {
        return work(own);
    }
    thread::scope(|scope| {
        for batch in others {
            // a thread that cannot be started leaves its tiles to the others
            let thread = thread::Builder::new().name("sarrus-batch".to_owned());
            // as where kernels were compared: functions of many numbers have large frames
            let thread = thread.stack_size(16 << 20);
            let _ = thread.spawn_scoped(scope, || work(batch));
        }
        work(own);
    });
}
