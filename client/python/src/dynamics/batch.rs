//! Rows of states: cut into tiles that threads take one after the other.
//!
//! Each row has the bits of a single state, so they depend on no thread and not on the rows beside
//! it. The calling thread works too, and between its tiles lets Python look for signals and calls
//! back.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use sarrus_client::{Answer, Status, Warnings};

/// Rows of a tile, and rows for which another thread is started: both chosen, not measured.
pub(super) const TILE: usize = 256;
const ROWS_OF_A_THREAD: usize = 2048;
/// Between two looks for signals.
const LOOK: Duration = Duration::from_millis(50);

/// Rows that an engine in this process gets at once, so that its states can go abreast: a choice. A
/// server gets whole tiles.
pub(super) const PACKED: usize = 16;

/// Batches under way, which write arrays without Python's lock.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

/// One of them.
struct UnderWay;

impl UnderWay {
    fn begin() -> UnderWay {
        UNDER_WAY.fetch_add(1, Relaxed);
        UnderWay
    }
}

impl Drop for UnderWay {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Relaxed);
    }
}

/// Whether a batch may be writing arrays now; asked with Python's lock, it stays false as long as
/// that is held.
pub(super) fn is_under_way() -> bool {
    UNDER_WAY.load(Relaxed) != 0
}

/// What answers some states: their packed numbers in and out, row after row, and their answers.
pub(super) type Engine<'e> =
    dyn FnMut(&[f64], &mut [f64], &mut [Answer]) -> PyResult<()> + Send + 'e;

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
            let (tile, rest) = numbers.split_at(rows * *width);
            *numbers = rest;
            given.push((tile, *width));
        }
        let mut want = Vec::with_capacity(self.want.len());
        for (numbers, width) in &mut self.want {
            want.push((split_off(numbers, rows * *width), *width));
        }
        let statuses = split_off(&mut self.statuses, rows);
        let warnings = split_off(&mut self.warnings, rows);
        Some(Rows { rows, given, want, statuses, warnings })
    }

    /// Answers every row.
    fn answer(self, packed: &mut Packed, engine: &mut Engine<'_>) -> PyResult<()> {
        let Rows { rows, given, mut want, statuses, warnings } = self;
        let Packed { widths: [n_in, n_out], input, output, answers } = packed;
        let at_once = answers.len();
        for first in (0..rows).step_by(at_once) {
            let here = at_once.min(rows - first);
            let mut at = 0;
            for (numbers, width) in &given {
                for row in 0..here {
                    let field = &numbers[(first + row) * width..][..*width];
                    input[row * *n_in + at..][..*width].copy_from_slice(field);
                }
                at += width;
            }
            let answers = &mut answers[..here];
            engine(&input[..here * *n_in], &mut output[..here * *n_out], answers)?;
            for (row, answer) in answers.iter().enumerate() {
                statuses[first + row] = answer.status as u32;
                warnings[first + row] = answer.warnings.0;
            }
            let mut at = 0;
            for (numbers, width) in &mut want {
                for row in 0..here {
                    let field = &output[row * *n_out + at..][..*width];
                    numbers[(first + row) * *width..][..*width].copy_from_slice(field);
                }
                at += *width;
            }
        }
        Ok(())
    }
}

/// The first `n` entries, which are taken off.
fn split_off<'a, T>(slice: &mut &'a mut [T], n: usize) -> &'a mut [T] {
    let (first, rest) = std::mem::take(slice).split_at_mut(n);
    *slice = rest;
    first
}

/// Numbers of some states as a plan has them, with the widths of a row.
struct Packed {
    widths: [usize; 2],
    input: Vec<f64>,
    output: Vec<f64>,
    answers: Vec<Answer>,
}

impl Packed {
    fn new(rows: &Rows<'_>, at_once: usize) -> Packed {
        let n_in = rows.given.iter().map(|(_, width)| width).sum::<usize>();
        let n_out = rows.want.iter().map(|(_, width)| width).sum::<usize>();
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        Packed {
            widths: [n_in, n_out],
            input: vec![0.0; at_once * n_in],
            output: vec![0.0; at_once * n_out],
            answers: vec![unknown; at_once],
        }
    }
}

/// How many threads answer so many rows: as many as were asked for, else as are worth it.
pub(super) fn threads(asked: Option<NonZero<usize>>, rows: usize) -> usize {
    static PROCESSORS: OnceLock<usize> = OnceLock::new();
    let most = match asked {
        Some(threads) => threads.get().min(rows.div_ceil(TILE)),
        None => {
            let processors = || thread::available_parallelism().map_or(1, NonZero::<usize>::get);
            (*PROCESSORS.get_or_init(processors)).min(rows.div_ceil(ROWS_OF_A_THREAD))
        }
    };
    most.max(1)
}

/// What the threads of a batch share.
struct Batch<'a> {
    left: Mutex<Rows<'a>>,
    done: AtomicUsize,
    stop: AtomicBool,
}

impl Batch<'_> {
    /// Answers tiles until none is left or somebody stops; `look` comes after each.
    fn work(
        &self,
        engine: &mut Engine<'_>,
        packed: &mut Packed,
        look: &mut dyn FnMut() -> PyResult<()>,
    ) -> PyResult<()> {
        while !self.stop.load(Relaxed) {
            let tile = self.left.lock().unwrap_or_else(PoisonError::into_inner).tile();
            let Some(tile) = tile else { break };
            let rows = tile.rows;
            let outcome = tile.answer(packed, engine);
            self.done.fetch_add(rows, Relaxed);
            if let Err(error) = outcome.and_then(|()| look()) {
                self.stop.store(true, Relaxed);
                return Err(error);
            }
        }
        Ok(())
    }
}

/// Answers all rows on as many threads as there are engines, the calling one among them; each gets
/// up to `at_once` rows at once, and Python's other threads run meanwhile.
///
/// A signal's exception, or that of `progress`, ends it between two tiles; what is not answered by
/// then stays as it is.
pub(super) fn run(
    py: Python<'_>,
    rows: Rows<'_>,
    mut engines: Vec<Box<Engine<'_>>>,
    at_once: usize,
    progress: Option<&Py<PyAny>>,
) -> PyResult<()> {
    let Some(mut own) = engines.pop() else { return Ok(()) };
    let total = rows.rows;
    let mut packed: Vec<Packed> = engines.iter().map(|_| Packed::new(&rows, at_once)).collect();
    let mut own_packed = Packed::new(&rows, at_once);
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
            let (mut others, batch) = (Vec::new(), &batch);
            for (engine, packed) in engines.iter_mut().zip(&mut packed) {
                // a thread that cannot be started leaves its tiles to the others
                let thread = thread::Builder::new().name("sarrus-batch".to_owned());
                others.extend(thread.spawn_scoped(scope, move || {
                    batch.work(&mut **engine, packed, &mut || Ok(()))
                }));
            }
            let mut last = Instant::now();
            let outcome = batch.work(&mut *own, &mut own_packed, &mut || {
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
