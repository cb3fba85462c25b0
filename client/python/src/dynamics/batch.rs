//! Rows of states: cut into tiles that threads take one after the other.
//!
//! Each row has the bits of a single state, so they depend on no thread and not on the rows beside
//! it. The calling thread works too, and between its tiles lets Python look for signals and calls
//! back.

use std::cell::Cell;
use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use sarrus_client::{Answer, Status, Warnings};

use crate::locked;

/// Rows of a tile, and rows for which another thread is started: both chosen, not measured.
pub(super) const TILE: usize = 256;
const ROWS_OF_A_THREAD: usize = 2048;
/// Between two looks for signals.
const LOOK: Duration = Duration::from_millis(50);

/// Batches under way, which write arrays without Python's lock.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);
/// Whether a fork has cut batches off, whose claims on arrays are never released.
static CUT_OFF: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Batches of this thread: more than one if a callback starts others.
    static OWN: Cell<usize> = const { Cell::new(0) };
}

/// One of them.
struct UnderWay;

impl UnderWay {
    fn begin() -> UnderWay {
        UNDER_WAY.fetch_add(1, Relaxed);
        OWN.set(OWN.get() + 1);
        UnderWay
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Relaxed);
        OWN.set(OWN.get().saturating_sub(1));
    }
}

/// Python calls it in the child of a fork: batches of threads that are not there are no longer
/// under way.
#[pyfunction]
pub(crate) fn forked() {
    if UNDER_WAY.swap(OWN.get(), Relaxed) != OWN.get() {
        CUT_OFF.store(true, Relaxed);
    }
}

/// Whether a claim on an array can only be that of a batch which a fork has cut off.
pub(super) fn is_cut_off() -> bool {
    CUT_OFF.load(Relaxed) && !is_under_way()
}

/// Whether a batch may be writing arrays now; asked with Python's lock, it stays false as long as
/// that is held.
pub(super) fn is_under_way() -> bool {
    UNDER_WAY.load(Relaxed) != 0
}

/// Rows that go in, field by field, each with the width of a row.
pub(super) type Given<'a> = [(&'a [f64], usize)];
/// The output rows of each field, with their width.
pub(super) type Want<'a> = [(&'a mut [f64], usize)];

/// A function that answers up to [`TILE`] states.
pub(super) type Engine<'e> =
    dyn FnMut(&Given<'_>, &mut Want<'_>, &mut [Answer]) -> PyResult<()> + Send + 'e;

/// The rows that are left, field by field, each with the width of a row.
pub(super) struct Rows<'a> {
    pub(super) rows: usize,
    pub(super) given: Vec<(&'a [f64], usize)>,
    pub(super) want: Vec<(&'a mut [f64], usize)>,
    pub(super) statuses: &'a mut [u32],
    pub(super) warnings: &'a mut [u32],
}

impl<'a> Rows<'a> {
    /// Takes a tile off the front; `None` where no row is left.
    fn tile(&mut self) -> Option<Rows<'a>> {
        let rows = self.rows.min(TILE);
        if rows == 0 {
            return None;
        }
        self.rows -= rows;
        let mut given = Vec::with_capacity(self.given.len());
        for (numbers, width) in &mut self.given {
            given.push((numbers.split_off(..rows * *width)?, *width));
        }
        let mut want = Vec::with_capacity(self.want.len());
        for (numbers, width) in &mut self.want {
            want.push((numbers.split_off_mut(..rows * *width)?, *width));
        }
        let statuses = self.statuses.split_off_mut(..rows)?;
        let warnings = self.warnings.split_off_mut(..rows)?;
        Some(Rows { rows, given, want, statuses, warnings })
    }

    /// Answers every row of a tile, of which statuses and warnings are 0 before.
    fn answer(mut self, engine: &mut Engine<'_>) -> PyResult<()> {
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut answers = [unknown; TILE];
        let answers = &mut answers[..self.rows];
        engine(&self.given, &mut self.want, answers)?;
        // pages of zeros to which nothing is written are never made
        for (row, answer) in answers.iter().enumerate() {
            if answer.status != Status::Ok {
                self.statuses[row] = answer.status as u32;
            }
            if answer.warnings != Warnings::NONE {
                self.warnings[row] = answer.warnings.0;
            }
        }
        Ok(())
    }
}

/// How many threads answer so many rows: as many as were asked for, else as are worth it.
pub(super) fn threads(asked: Option<NonZero<usize>>, rows: usize) -> usize {
    let most = match asked {
        Some(threads) => threads.get().min(rows.div_ceil(TILE)),
        None => processors().min(rows.div_ceil(ROWS_OF_A_THREAD)),
    };
    most.max(1)
}

/// How many threads run at a time.
pub(super) fn processors() -> usize {
    static PROCESSORS: OnceLock<usize> = OnceLock::new();
    *PROCESSORS.get_or_init(|| thread::available_parallelism().map_or(1, NonZero::<usize>::get))
}

/// State that the threads of a batch share.
struct Batch<'a> {
    left: Mutex<Rows<'a>>,
    done: AtomicUsize,
    stop: AtomicBool,
}

impl Batch<'_> {
    /// Answers tiles until none is left or a thread stops; `look` comes after each.
    fn work(
        &self,
        engine: &mut Engine<'_>,
        look: &mut dyn FnMut() -> PyResult<()>,
    ) -> PyResult<()> {
        while !self.stop.load(Relaxed) {
            let tile = locked(&self.left).tile();
            let Some(tile) = tile else { break };
            let rows = tile.rows;
            let outcome = tile.answer(engine);
            self.done.fetch_add(rows, Relaxed);
            if let Err(error) = outcome.and_then(|()| look()) {
                self.stop.store(true, Relaxed);
                return Err(error);
            }
        }
        Ok(())
    }
}

/// Answers all rows on as many threads as there are engines, the calling one among them; Python's
/// other threads run meanwhile.
///
/// A signal's exception, or that of `progress`, ends it between two tiles; rows without an answer
/// by then stay unchanged.
pub(super) fn run(
    py: Python<'_>,
    rows: Rows<'_>,
    mut engines: Vec<Box<Engine<'_>>>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<()> {
    let Some(mut own) = engines.pop() else { return Ok(()) };
    let total = rows.rows;
    let batch =
        Batch { left: Mutex::new(rows), done: AtomicUsize::new(0), stop: AtomicBool::new(false) };
    let look = |py: Python<'_>| -> PyResult<()> {
        py.check_signals()?;
        if let Some(progress) = progress {
            progress.call1(py, (batch.done.load(Relaxed), total))?;
        }
        Ok(())
    };
    let under_way = UnderWay::begin();
    let outcome = py.detach(|| {
        thread::scope(|scope| {
            let mut others = Vec::new();
            let batch = &batch;
            for engine in &mut engines {
                // a thread that cannot be started leaves its tiles to the others
                let thread = thread::Builder::new().name("sarrus-batch".to_owned());
                others.extend(
                    thread.spawn_scoped(scope, move || batch.work(&mut **engine, &mut || Ok(()))),
                );
            }
            let mut last = Instant::now();
            let outcome = batch.work(&mut *own, &mut || {
                if last.elapsed() < LOOK {
                    return Ok(());
                }
                let outcome = Python::attach(look);
                last = Instant::now();
                outcome
            });
            others.into_iter().fold(outcome, |outcome, other| match other.join() {
                Ok(of_other) => outcome.and(of_other),
                Err(panic) => std::panic::resume_unwind(panic),
            })
        })
    });
    drop(under_way);
    outcome.and_then(|()| look(py))
}
