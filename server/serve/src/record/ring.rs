//! Passes records from the answering thread to the recorder: a bounded ring of words with one
//! writer and one reader, in memory that outlives the process. The records that a killed server had
//! not yet written are read from there ([`left`]).
//!
//! The answering thread copies head, numbers and answer; it allocates nothing, takes no lock, makes
//! no system call and reads no clock. A record that does not fit is dropped and counted.

use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use quanta::Clock;
use sarrus_proto::message::RequestHead;
use sarrus_proto::{Answer, KeptWords, LeftWords, Query, Status, Warnings};

use super::format::{
    BODY_HEAD, Client, MAX_BODY, MAX_BODY_HEAD, QUERY_HEAD, WORD, join, word, write_query,
};

/// Most pending words `[8 byte]`: 16 MiB, one second at 16 MB/s.
pub(super) const CAPACITY: usize = 1 << 21;
/// Offset of the time in a body.
const TIME: usize = 0;

// words of the memory
/// Time 0 of the recording `[tick]`.
const START: usize = 1;
/// 1 once the answering thread has ended.
const ENDED: usize = 2;
/// Words that were put into the ring since the start.
const PUT: usize = 3;
/// Words of the record that is staged; 0 without one.
const STAGED: usize = 4;
/// Where that record will be in the ring, as words since the start.
const PLACE: usize = 5;
/// The [`Settled`] that counts: 0 or 1.
const LAST: usize = 6;
/// Both of them, on a line of the cache that the answering thread does not write.
const SETTLED: usize = 8;
/// The staged record, then the ring.
const RECORD: usize = 16;
const RING: usize = RECORD + MAX_BODY;

/// The state of the file: the words taken from the ring, and the end of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Settled {
    /// Words of the ring since the start.
    pub(super) taken: u64,
    /// Number of the current segment; 0 before the first.
    pub(super) segment: u64,
    /// Offset of the next frame in it `[byte]`.
    pub(super) at: u64,
    /// Sequence of the next frame.
    pub(super) sequence: u64,
}

/// The answering thread's end. The record is assembled while the answer is computed, and enters the
/// ring after the answer is published: the ring's memory is cold, and no client waits for it.
pub(crate) struct Recorder {
    memory: Arc<KeptWords>,
    /// Words put into the ring, and those taken from it when that was last read.
    put: u64,
    taken: u64,
    n_staged: usize,
    lost: u64,
    found: u64,
    client: Client,
}

/// The recorder's end.
pub(super) struct Records {
    memory: Arc<KeptWords>,
    taken: u64,
}

/// Both ends of a ring for the recording `run`, which begins at `start` `[tick]`.
///
/// # Errors
/// /dev/shm has no room for it.
pub(super) fn ring(
    run: u64,
    start: u64,
    end: Settled,
    capacity: usize,
) -> io::Result<(Recorder, Records)> {
    let memory = Arc::new(KeptWords::create(&name(run), RING + capacity)?);
    memory.words()[START].store(start, Relaxed);
    let records = Records { memory: memory.clone(), taken: 0 };
    records.settle(end);
    let recorder = Recorder {
        memory,
        put: 0,
        taken: 0,
        n_staged: 0,
        lost: 0,
        found: 0,
        client: Client::Service,
    };
    Ok((recorder, records))
}

/// Name of the memory of a recording.
fn name(run: u64) -> String {
    format!("{NAME}{run:016x}")
}

/// The names of all rings begin so.
const NAME: &str = "record_";

impl Recorder {
    /// Notes the client of the next request and its time `[tick]`.
    #[inline]
    pub(crate) fn take(&mut self, ticks: u64, client: Client) {
        (self.found, self.client) = (ticks, client);
    }

    /// Copies a request and its answer.
    #[inline]
    pub(crate) fn record(
        &mut self,
        head: &RequestHead,
        query: &Query,
        input: &[f64],
        output: &[f64],
        answer: Answer,
    ) {
        let mut words = [0; MAX_BODY_HEAD];
        let (fixed, plan) = words.split_at_mut(BODY_HEAD - QUERY_HEAD);
        fixed.copy_from_slice(&self.fixed(head, input.len(), output.len(), answer));
        let n_head = fixed.len() + write_query(query, plan);
        self.stage(words.get(..n_head).unwrap_or_default(), input, output);
    }

    /// Notes a request that was refused before any plan ran.
    #[cold]
    pub(crate) fn record_refusal(&mut self, head: &RequestHead, status: Status) {
        let mut words = [0; BODY_HEAD];
        let (fixed, _) = words.split_at_mut(BODY_HEAD - QUERY_HEAD);
        fixed.copy_from_slice(&self.fixed(head, 0, 0, Answer { status, warnings: Warnings::NONE }));
        self.stage(&words, &[], &[]);
    }

    /// Passes the record, if there is one, to the other thread; call it after the answer is
    /// published.
    #[inline]
    pub(crate) fn commit(&mut self) {
        let n = std::mem::take(&mut self.n_staged);
        if n == 0 {
            return;
        }
        let fits = n < self.free();
        let words = self.memory.words();
        if fits {
            let record = words.get(RECORD..RECORD + n).unwrap_or_default();
            let [first, second] = part(words, self.put, 1 + n);
            let mut to = first.iter().chain(second);
            to.next().into_iter().for_each(|length| length.store(n as u64, Relaxed));
            record.iter().zip(to).for_each(|(from, to)| to.store(from.load(Relaxed), Relaxed));
            self.put += 1 + n as u64;
            // SYNC POINT: ring of records (the other end is `next`)
            words[PUT].store(self.put, Release);
        } else {
            self.lost += 1;
        }
        words[STAGED].store(0, Release);
    }

    /// Commits a row of a batch; half of the ring is for single requests.
    #[inline]
    pub(crate) fn commit_row(&mut self) {
        if 2 * self.free() < capacity(self.memory.words()) {
            self.n_staged = 0;
            self.memory.words()[STAGED].store(0, Release);
            self.lost += 1;
        } else {
            self.commit();
        }
    }

    /// Free words of the ring; asks the other thread where half of them are taken.
    fn free(&mut self) -> usize {
        let words = self.memory.words();
        if 2 * (self.put - self.taken) > capacity(words) as u64 {
            self.taken = settled(|at| words[at].load(Acquire)).taken;
        }
        capacity(words).saturating_sub((self.put - self.taken) as usize)
    }

    /// The words of a body up to the query.
    fn fixed(
        &self,
        head: &RequestHead,
        n_in: usize,
        n_out: usize,
        answer: Answer,
    ) -> [u64; BODY_HEAD - QUERY_HEAD] {
        [
            self.found,
            self.lost,
            join(head.plan, self.client.code()),
            head.sequence,
            join(answer.status as u32, answer.warnings.0),
            join(n_in as u32, n_out as u32),
        ]
    }

    fn stage(&mut self, words: &[u64], input: &[f64], output: &[f64]) {
        let n = words.len() + input.len() + output.len();
        let Some(record) = self.memory.words().get(RECORD..RING).and_then(|all| all.get(..n))
        else {
            // plans have no more numbers
            self.lost += 1;
            return;
        };
        let numbers = input.iter().chain(output).map(|number| number.to_bits());
        let all = words.iter().copied().chain(numbers);
        record.iter().zip(all).for_each(|(to, word)| to.store(word, Relaxed));
        self.memory.words()[PLACE].store(self.put, Relaxed);
        self.memory.words()[STAGED].store(n as u64, Release);
        self.n_staged = n;
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.memory.words()[ENDED].store(1, Release);
    }
}

impl Records {
    /// The next body, if it is complete.
    pub(super) fn next(&mut self, body: &mut Vec<u64>) -> bool {
        let words = self.memory.words();
        // SYNC POINT: ring of records (the other end is `commit`)
        if words[PUT].load(Acquire) == self.taken {
            return false;
        }
        let length = part(words, self.taken, 1)[0].first().map_or(0, |word| word.load(Relaxed));
        let [first, second] = part(words, self.taken + 1, (length as usize).min(MAX_BODY));
        body.clear();
        body.extend(first.iter().chain(second).map(|word| word.load(Relaxed)));
        self.taken += 1 + body.len() as u64;
        true
    }

    /// Notes that the file has every record that was taken, and ends here.
    pub(super) fn settle(&self, end: Settled) {
        let words = self.memory.words();
        let other = 1 - words[LAST].load(Relaxed).min(1);
        let all = [self.taken, end.segment, end.at, end.sequence];
        let to = words.get(SETTLED + 4 * other as usize..).unwrap_or_default();
        to.iter().zip(all).for_each(|(to, word)| to.store(word, Release));
        words[LAST].store(other, Release);
    }

    /// True when the answering thread has dropped its end.
    pub(super) fn is_abandoned(&self) -> bool {
        self.memory.words()[ENDED].load(Acquire) != 0
    }
}

/// Converts the time of a body from ticks to `[ns]` since the start of the recording.
pub(super) fn since(start: u64, clock: &Clock, body: &mut [u64]) {
    if let Some(time) = body.get_mut(TIME) {
        *time = clock.delta_as_nanos(start, *time);
    }
}

/// Words of the ring.
fn capacity(words: &[AtomicU64]) -> usize {
    words.len() - RING
}

/// `n` words of the ring from the `from`-th since the start, in two pieces.
fn part(words: &[AtomicU64], from: u64, n: usize) -> [&[AtomicU64]; 2] {
    let ring = words.get(RING..).unwrap_or_default();
    let at = (from % ring.len().max(1) as u64) as usize;
    let first = ring.get(at..).unwrap_or_default();
    let first = first.get(..n).unwrap_or(first);
    [first, ring.get(..n - first.len()).unwrap_or_default()]
}

/// The last state that was settled, of the words that `word` reads.
fn settled(word: impl Fn(usize) -> u64) -> Settled {
    let at = SETTLED + 4 * word(LAST).min(1) as usize;
    let [taken, segment, at, sequence] = std::array::from_fn(|k| word(at + k));
    Settled { taken, segment, at, sequence }
}

/// The records that a killed server left.
pub(super) struct Left {
    /// Time 0 of the recording `[tick]`.
    pub(super) start: u64,
    /// The end of the file.
    pub(super) end: Settled,
    /// The bodies that the file may lack.
    pub(super) bodies: Vec<Vec<u64>>,
}

/// Whether a server of the recording `run` lives or left its ring.
pub(super) fn is_there(run: u64) -> bool {
    LeftWords::exist(&name(run))
}

/// The records that the dead server of the recording `run` left; waits while another process
/// completes the recording.
///
/// # Errors
/// They are another user's, or cannot be read.
pub(super) fn left(run: u64) -> io::Result<Option<(Left, LeftWords)>> {
    let Some(words) = LeftWords::take(&name(run))? else { return Ok(None) };
    Ok(Some((parse(&words.bytes(RING + CAPACITY)?), words)))
}

fn parse(bytes: &[u8]) -> Left {
    let capacity = (bytes.len() / WORD).saturating_sub(RING) as u64;
    let at = |at: usize| word(bytes, at);
    let end = settled(at);
    let ring = |position: u64| at(RING + (position % capacity.max(1)) as usize);
    let put = at(PUT);
    let mut bodies: Vec<Vec<u64>> = Vec::new();
    let mut from = end.taken;
    while from < put && put - from <= capacity {
        let n = ring(from);
        if !(BODY_HEAD as u64..=MAX_BODY as u64).contains(&n) {
            break;
        }
        bodies.push((1..=n).map(|k| ring(from + k)).collect());
        from += 1 + n;
    }
    // after a kill between ring and mark the record is in both
    let n = at(STAGED) as usize;
    if (BODY_HEAD..=MAX_BODY).contains(&n) && at(PLACE) == put {
        bodies.push((0..n).map(|k| at(RECORD + k)).collect());
    }
    Left { start: at(START), end, bodies }
}

/// Removes the rings of dead servers; their paths.
pub fn clear() -> Vec<PathBuf> {
    LeftWords::clear(NAME)
}

#[cfg(test)]
mod tests {
    use sarrus_proto::{Field, FieldSet, Request};

    use super::*;

    const QUERY: Query =
        Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
    /// The recording `k` of this process.
    fn run(k: u64) -> u64 {
        u64::from(std::process::id()) << 8 | k
    }

    const OK: Answer = Answer { status: Status::Ok, warnings: Warnings::NONE };

    #[test]
    fn records_come_out_as_they_went_in_round_after_round() {
        let (mut recorder, mut records) = ring(run(1), 0, Settled::default(), 100).unwrap();
        let mut body = Vec::new();
        for k in 0..1000_u32 {
            let head = RequestHead { plan: 7, sequence: u64::from(k), ..RequestHead::default() };
            // numbers with arbitrary bits, including signalling NaN
            let input = vec![f64::from_bits(0x7ff0_0000_0000_0001 + u64::from(k)); k as usize % 20];
            recorder.take(u64::from(k), Client::Lane(3));
            recorder.record(&head, &QUERY, &input, &[f64::from(k)], OK);
            assert!(!records.next(&mut body));
            recorder.commit();
            assert!(records.next(&mut body));
            assert_eq!(body[..2], [u64::from(k), 0]);
            assert_eq!(body[2..4], [join(7, 3), u64::from(k)]);
            let mut numbers = body[BODY_HEAD..].to_vec();
            assert_eq!(numbers.pop(), Some(f64::from(k).to_bits()));
            assert_eq!(numbers, input.iter().map(|number| number.to_bits()).collect::<Vec<_>>());
            assert!(!records.next(&mut body));
            records.settle(Settled::default());
        }
    }

    #[test]
    fn what_is_not_settled_is_left_after_a_kill() {
        let end = |at| Settled { taken: 0, segment: 3, at, sequence: 4 };
        let (mut recorder, mut records) = ring(run(2), 77, end(1), 150).unwrap();
        let mut body = Vec::new();
        let record = |recorder: &mut Recorder, k: u32| {
            let head = RequestHead { sequence: u64::from(k), ..RequestHead::default() };
            recorder.record(&head, &QUERY, &[1.0; 5], &[f64::from(k); 5], OK);
        };
        let memory = recorder.memory.clone();
        let left = || {
            let words = memory.words().iter();
            parse(&words.flat_map(|word| word.load(Relaxed).to_le_bytes()).collect::<Vec<u8>>())
        };
        let sequences = || left().bodies.iter().map(|body| body[3]).collect::<Vec<_>>();
        for k in 0..40_u32 {
            record(&mut recorder, k);
            assert_eq!(sequences().last(), Some(&u64::from(k)), "staged");
            recorder.commit();
            assert_eq!(sequences().last(), Some(&u64::from(k)), "in the ring, once");
            assert_eq!(sequences().len(), 1 + k as usize % 3);
            if k % 3 == 2 {
                while records.next(&mut body) {}
                assert_eq!(sequences().len(), 3);
                records.settle(end(u64::from(k)));
                let Left { start, end: found, bodies } = left();
                assert_eq!((start, found.at, bodies.len()), (77, u64::from(k), 0));
                assert_eq!((found.segment, found.sequence), (3, 4));
            }
        }
        // the ring of a living process is its own, and goes with it
        assert!(is_there(run(2)) && super::left(run(2)).unwrap().is_none());
        drop((recorder, records, memory));
        assert!(!is_there(run(2)) && super::left(run(2)).unwrap().is_none());
    }

    #[test]
    fn a_record_that_does_not_fit_is_left_out_and_counted() {
        let capacity = 2 * (1 + BODY_HEAD + 10);
        let (mut recorder, mut records) = ring(run(3), 0, Settled::default(), capacity).unwrap();
        let mut body = Vec::new();
        for _ in 0..10 {
            recorder.record(&RequestHead::default(), &QUERY, &[1.0; 5], &[2.0; 5], OK);
            recorder.commit();
        }
        assert_eq!([(); 3].map(|()| records.next(&mut body)), [true, true, false]);
        records.settle(Settled::default());
        recorder.record_refusal(&RequestHead::default(), Status::WrongModel);
        recorder.commit();
        recorder.commit();
        assert!(records.next(&mut body));
        assert_eq!((body.len(), body[1]), (BODY_HEAD, 8));
        assert!(!records.is_abandoned());
        drop(recorder);
        assert!(records.is_abandoned());
    }
}
