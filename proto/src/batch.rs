//! Batches through shared memory: each client has one area, through which it requests rows of one
//! plan; the server answers them in order.
//!
//! ```text
//! word     of the client                 word     of the server
//! 0        sequence, from 1              8        sequence that was answered
//! 1        version, plan                 9        status of the batch
//! 2        fingerprint                   10       rows answered so far, of all batches
//! 3        rows
//! 16       status and warnings of each row, then the numbers of all rows in, then out
//! ```
//!
//! A client has one batch in progress. Writing the next sequence before the last one is answered
//! cancels the last one, and the answer to the next is `overloaded`.
//!
//! Every word is atomic, and the server copies each word of a row once into private memory: a
//! concurrent write by the client affects only the client's own answer. Rows go before the sequence
//! that hands them over (`Release`), and the other side reads the sequence first (`Acquire`).

use std::io;
use std::os::fd::OwnedFd;
use std::sync::atomic::{
    AtomicU64,
    Ordering::{Acquire, Relaxed, Release},
    fence,
};

use rustix::fs::{SealFlags, fcntl_add_seals};

use crate::mapping::Mapping;
use crate::message::{halves, load_numbers, pair, store_numbers};
use crate::{Answer, Status, Warnings};

/// The most rows of one batch.
pub const MAX_BATCH_ROWS: usize = 1024;
/// Words of the area: one MiB.
pub const BATCH_WORDS: usize = 1 << 17;

const SEQUENCE: usize = 0;
const VERSION_PLAN: usize = 1;
const FINGERPRINT: usize = 2;
const ROWS: usize = 3;
// another line of the cache: the client polls here
const ANSWERED: usize = 8;
const STATUS: usize = 9;
const DONE: usize = 10;
const FIRST: usize = 16;

/// The head of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BatchHead {
    /// [`PROTOCOL_VERSION`](crate::PROTOCOL_VERSION) of the client.
    pub version: u32,
    /// Number of the plan, as the server gave it.
    pub plan: u32,
    /// Fingerprint of the model that the client was made for.
    pub fingerprint: u64,
    /// Counts the client's batches from 1; the answer repeats it.
    pub sequence: u64,
    /// Number of rows.
    pub rows: u64,
}

/// A batch that fits: its rows and the numbers of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchShape {
    rows: usize,
    n_in: usize,
    n_out: usize,
}

impl BatchShape {
    /// The most rows of a batch with this many numbers in and out.
    pub const fn most_rows(n_in: usize, n_out: usize) -> usize {
        let most = (BATCH_WORDS - FIRST) / 1_usize.saturating_add(n_in).saturating_add(n_out);
        if most < MAX_BATCH_ROWS { most } else { MAX_BATCH_ROWS }
    }

    /// `None` without rows, and if the rows do not fit.
    pub fn new(rows: u64, n_in: usize, n_out: usize) -> Option<BatchShape> {
        let rows = usize::try_from(rows).ok()?;
        let fits = (1..=BatchShape::most_rows(n_in, n_out)).contains(&rows);
        fits.then_some(BatchShape { rows, n_in, n_out })
    }

    /// Number of rows.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    fn input(&self, row: usize) -> usize {
        FIRST + self.rows + row * self.n_in
    }

    fn output(&self, row: usize) -> usize {
        self.input(self.rows) + row * self.n_out
    }
}

/// The server's side of an area.
pub struct ServedBatch(Mapping);

impl ServedBatch {
    /// A new area and the descriptor for its client; made and dropped off the answering thread.
    pub fn create() -> io::Result<(ServedBatch, OwnedFd)> {
        let (mapping, memory) = Mapping::create("sarrus-batch", BATCH_WORDS)?;
        // otherwise a client's seal could prevent the release of the memory
        fcntl_add_seals(&memory, SealFlags::SEAL)?;
        Ok((ServedBatch(mapping), memory))
    }

    /// The sequence of the last requested batch; 0 before the first.
    #[inline]
    pub fn sequence(&self) -> u64 {
        // SYNC POINT: batch (the other end is `send`)
        self.0.words()[SEQUENCE].load(Acquire)
    }

    /// The head of the batch of this sequence.
    pub fn head(&self, sequence: u64) -> BatchHead {
        let words = self.0.words();
        let [version, plan] = halves(words[VERSION_PLAN].load(Relaxed));
        let [fingerprint, rows] = [FINGERPRINT, ROWS].map(|word| words[word].load(Relaxed));
        BatchHead { version, plan, fingerprint, sequence, rows }
    }

    /// Reads rows from this one on, as many numbers as `numbers` holds. Never allocates.
    pub fn read(&self, shape: &BatchShape, first: usize, numbers: &mut [f64]) {
        read(self.0.words(), shape.input(first), numbers);
    }

    /// Writes answers and numbers of rows from this one on. Never allocates.
    pub fn write(&self, shape: &BatchShape, first: usize, answers: &[Answer], numbers: &[f64]) {
        let words = self.0.words();
        let outcomes = answers.iter().map(|answer| pair(answer.status as u32, answer.warnings.0));
        let room = words.get(FIRST + first..).unwrap_or_default();
        room.iter().zip(outcomes).for_each(|(word, outcome)| word.store(outcome, Relaxed));
        write(words, shape.output(first), numbers);
        let done = words[DONE].load(Relaxed);
        words[DONE].store(done.wrapping_add(answers.len() as u64), Relaxed);
    }

    /// Publishes the outcome of the batch with this sequence: `ok` with an answer to each row, any
    /// other status with none.
    pub fn publish(&self, sequence: u64, status: Status) {
        let words = self.0.words();
        words[STATUS].store(u64::from(status as u32), Relaxed);
        // SYNC POINT: answered batch (the other end is `answer`)
        words[ANSWERED].store(sequence, Release);
    }

    /// Frees the memory, even if clients keep its descriptor: it no longer holds answers.
    pub fn empty(&self) {
        self.0.words()[ANSWERED].store(0, Relaxed);
        // SYNC POINT: emptied (the other end is `has_kept`)
        fence(Release);
        self.0.empty();
    }
}

/// The client's side of an area.
pub struct ClaimedBatch(Mapping);

impl ClaimedBatch {
    /// The area that the server made for this client.
    ///
    /// # Errors
    /// `InvalidData` for a file that is no such area.
    pub fn open(memory: &OwnedFd) -> io::Result<ClaimedBatch> {
        Ok(ClaimedBatch(Mapping::open(memory, BATCH_WORDS, true)?))
    }

    /// Requests rows. Never allocates.
    pub fn send(&self, head: &BatchHead, shape: &BatchShape, input: &[f64]) {
        let words = self.0.words();
        words[VERSION_PLAN].store(pair(head.version, head.plan), Relaxed);
        words[FINGERPRINT].store(head.fingerprint, Relaxed);
        words[ROWS].store(head.rows, Relaxed);
        write(words, shape.input(0), input);
        // SYNC POINT: batch (the other end is `sequence`)
        words[SEQUENCE].store(head.sequence, Release);
    }

    /// The status number of the batch with this sequence, once it is answered.
    #[inline]
    pub fn answer(&self, sequence: u64) -> Option<u32> {
        let words = self.0.words();
        // SYNC POINT: answered batch (the other end is `publish`)
        let answered = words[ANSWERED].load(Acquire) == sequence;
        answered.then(|| words[STATUS].load(Relaxed) as u32)
    }

    /// True if the rows just read belong to this sequence's answer. A server that revokes the area
    /// empties it, and zeros would look like an answer.
    pub fn has_kept(&self, sequence: u64) -> bool {
        // SYNC POINT: emptied (the other end is `empty`)
        fence(Acquire);
        self.0.words()[ANSWERED].load(Relaxed) == sequence
    }

    /// Number of rows answered so far, over all batches.
    pub fn done(&self) -> u64 {
        self.0.words()[DONE].load(Relaxed)
    }

    /// Reads the answers of a batch and their numbers. A status unknown to this version has no
    /// numbers. Never allocates.
    pub fn read(&self, shape: &BatchShape, answers: &mut [Answer], output: &mut [f64]) {
        let words = self.0.words();
        read(words, shape.output(0), output);
        let outcomes = words.get(FIRST..).unwrap_or_default();
        for (row, (answer, word)) in answers.iter_mut().zip(outcomes).enumerate() {
            let [status, warnings] = halves(word.load(Relaxed));
            let status = Status::of_answer(status);
            *answer = Answer { status, warnings: Warnings(warnings) };
            if status == Status::UnknownStatus {
                let numbers = output.get_mut(row * shape.n_out..(row + 1) * shape.n_out);
                numbers.unwrap_or_default().fill(f64::NAN);
            }
        }
    }
}

fn read(words: &[AtomicU64], first: usize, numbers: &mut [f64]) {
    load_numbers(words.get(first..).unwrap_or_default(), numbers);
}

fn write(words: &[AtomicU64], first: usize, numbers: &[f64]) {
    store_numbers(words.get(first..).unwrap_or_default(), numbers);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_answers_come_through_as_they_are() {
        let (served, memory) = ServedBatch::create().unwrap();
        let claimed = ClaimedBatch::open(&memory).unwrap();
        assert_eq!((served.sequence(), claimed.answer(1)), (0, None));
        let shape = BatchShape::new(3, 2, 1).unwrap();
        let head = BatchHead { version: 7, plan: 9, fingerprint: 42, sequence: 1, rows: 3 };
        let input = [0.1, -0.0, f64::NAN, f64::INFINITY, 5e-324, 6.0];
        claimed.send(&head, &shape, &input);
        assert_eq!(served.head(served.sequence()), head);

        // two rows, then one
        let ok = Answer { status: Status::Ok, warnings: Warnings::LIMITS_EXCEEDED };
        let failed = Answer { status: Status::Unreachable, warnings: Warnings::NONE };
        let mut rows = [0.0; 4];
        served.read(&shape, 0, &mut rows);
        assert_eq!(rows.map(f64::to_bits), [0, 1, 2, 3].map(|k| input[k].to_bits()));
        served.write(&shape, 0, &[ok, failed], &[1.0, f64::NAN]);
        assert_eq!((claimed.answer(1), claimed.done()), (None, 2));
        served.read(&shape, 2, &mut rows[..2]);
        assert_eq!(rows[..2], input[4..]);
        served.write(&shape, 2, &[ok], &[3.0]);
        served.publish(1, Status::Ok);

        assert_eq!((claimed.answer(1), claimed.answer(2), claimed.done()), (Some(0), None, 3));
        let mut answers = [failed; 3];
        let mut output = [0.0; 3];
        claimed.read(&shape, &mut answers, &mut output);
        assert_eq!(answers, [ok, failed, ok]);
        assert!(output[1].is_nan() && [output[0], output[2]] == [1.0, 3.0]);
    }

    #[test]
    fn an_area_that_was_emptied_has_no_answer_and_keeps_its_words() {
        let (served, memory) = ServedBatch::create().unwrap();
        let claimed = ClaimedBatch::open(&memory).unwrap();
        assert!(fcntl_add_seals(&memory, SealFlags::FUTURE_WRITE).is_err());
        let shape = BatchShape::new(1, 1, 1).unwrap();
        let failed = Answer { status: Status::Unreachable, warnings: Warnings::NONE };
        let mut answers = [failed];
        let mut output = [0.0];
        served.publish(1, Status::Ok);
        claimed.read(&shape, &mut answers, &mut output);
        assert!(claimed.has_kept(1));
        served.empty();
        assert_eq!((claimed.has_kept(1), claimed.answer(1)), (false, None));
        drop(served);
        claimed.send(&BatchHead { sequence: 2, ..BatchHead::default() }, &shape, &[1.0]);
        assert_eq!(claimed.answer(2), None);
    }

    #[test]
    fn a_batch_has_rows_and_no_more_than_there_is_room_for() {
        assert_eq!(BatchShape::most_rows(3, 1), MAX_BATCH_ROWS);
        let most = BatchShape::most_rows(4096, 16384);
        assert_eq!(most, 6);
        for (rows, fits) in [(0, false), (1, true), (6, true), (7, false), (u64::MAX, false)] {
            assert_eq!(BatchShape::new(rows, 4096, 16384).is_some(), fits, "{rows}");
        }
        let last = BatchShape::new(6, 4096, 16384).unwrap();
        assert!(last.output(6) <= BATCH_WORDS);
        assert_eq!(BatchShape::most_rows(usize::MAX, 1), 0);
    }
}
