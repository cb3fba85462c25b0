//! From the answering thread to the recorder: a bounded ring of words with one writer and one
//! reader.
//!
//! The answering thread copies head, numbers and answer; it allocates nothing, takes no lock, makes
//! no system call and reads no clock. What does not fit is left out and counted.

use rtrb::{Consumer, Producer, RingBuffer};
use sarrus_proto::message::RequestHead;
use sarrus_proto::{Answer, Query, Status, Warnings};

use super::format::{BODY_HEAD, Client, MAX_BODY, MAX_BODY_HEAD, join, write_query};

/// Words that wait at most `[8 byte]`: 16 MiB, at 16 MB/s the work of a second.
pub(super) const CAPACITY: usize = 1 << 21;
/// Where a body keeps its time and the count of losses.
pub(super) const TIME: usize = 0;

/// The answering thread's end.
///
/// The words travel as doubles, so that the numbers of a request are copied as they are; a copy
/// changes no bit.
pub(crate) struct Recorder {
    ring: Producer<f64>,
    lost: u64,
    taken: u64,
    client: Client,
}

/// The recorder's end.
pub(super) struct Records {
    ring: Consumer<f64>,
}

/// Both ends of a ring of `capacity` words, whose memory is mapped.
pub(super) fn ring(capacity: usize) -> (Recorder, Records) {
    let (mut producer, mut consumer) = RingBuffer::new(capacity);
    // the answering thread meets no page that nobody touched
    while producer.push(0.0).is_ok() {}
    while consumer.pop().is_ok() {}
    let recorder = Recorder { ring: producer, lost: 0, taken: 0, client: Client::Service };
    (recorder, Records { ring: consumer })
}

impl Recorder {
    /// Whose request comes next, and when it was found `[tick]`.
    #[inline]
    pub(crate) fn take(&mut self, ticks: u64, client: Client) {
        (self.taken, self.client) = (ticks, client);
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
        let mut words = [0; 1 + MAX_BODY_HEAD];
        let [length, body @ ..] = &mut words;
        let (fixed, plan) = body.split_at_mut(BODY_HEAD - 3);
        fixed.copy_from_slice(&self.fixed(head, input.len(), output.len(), answer));
        let n_head = fixed.len() + write_query(query, plan);
        *length = (n_head + input.len() + output.len()) as u64;
        self.push(&words, n_head, input, output);
    }

    /// Notes a request that was refused before any plan ran.
    #[cold]
    pub(crate) fn record_refusal(&mut self, head: &RequestHead, status: Status) {
        let mut words = [0; 1 + MAX_BODY_HEAD];
        let [length, body @ ..] = &mut words;
        let (fixed, _) = body.split_at_mut(BODY_HEAD - 3);
        fixed.copy_from_slice(&self.fixed(head, 0, 0, Answer { status, warnings: Warnings::NONE }));
        *length = BODY_HEAD as u64;
        self.push(&words, BODY_HEAD, &[], &[]);
    }

    /// The words of a body up to the query.
    fn fixed(
        &self,
        head: &RequestHead,
        n_in: usize,
        n_out: usize,
        answer: Answer,
    ) -> [u64; BODY_HEAD - 3] {
        [
            self.taken,
            self.lost,
            join(head.plan, self.client.code()),
            head.sequence,
            join(answer.status as u32, answer.warnings.0),
            join(n_in as u32, n_out as u32),
        ]
    }

    fn push(&mut self, words: &[u64], n_head: usize, input: &[f64], output: &[f64]) {
        let n = 1 + n_head + input.len() + output.len();
        if self.ring.cached_slots() < n && self.ring.slots() < n {
            self.lost += 1;
            return;
        }
        let mut head = [0.0; 1 + MAX_BODY_HEAD];
        head.iter_mut().zip(words).for_each(|(to, word)| *to = f64::from_bits(*word));
        // SYNC POINT: ring of records (the other end is `next`): there is room for all parts, and
        // the reader waits until it sees all of them
        for part in [head.get(..1 + n_head).unwrap_or_default(), input, output] {
            let _ = self.ring.push_entire_slice(part);
        }
    }
}

impl Records {
    /// The next body, if one is there whole.
    pub(super) fn next(&mut self, body: &mut Vec<u64>) -> bool {
        // SYNC POINT: ring of records (the other end is `push`)
        let Ok(length) = self.ring.peek() else { return false };
        let n = (length.to_bits() as usize).min(MAX_BODY);
        let Ok(chunk) = self.ring.read_chunk(1 + n) else { return false };
        let (first, second) = chunk.as_slices();
        body.clear();
        body.extend(first.iter().chain(second).skip(1).map(|word| word.to_bits()));
        chunk.commit_all();
        true
    }

    /// True when the answering thread has dropped its end.
    pub(super) fn is_abandoned(&self) -> bool {
        self.ring.is_abandoned()
    }
}

#[cfg(test)]
mod tests {
    use sarrus_proto::{Field, FieldSet, Request};

    use super::*;

    const QUERY: Query =
        Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), FieldSet::of(&[Field::Q]));
    const OK: Answer = Answer { status: Status::Ok, warnings: Warnings::NONE };

    #[test]
    fn what_comes_out_is_what_went_in_round_after_round() {
        let (mut recorder, mut records) = ring(100);
        let mut body = Vec::new();
        for k in 0..1000_u32 {
            let head = RequestHead { plan: 7, sequence: u64::from(k), ..RequestHead::default() };
            // numbers of any bits, also signalling NaN
            let input = vec![f64::from_bits(0x7ff0_0000_0000_0001 + u64::from(k)); k as usize % 20];
            recorder.take(u64::from(k), Client::Lane(3));
            recorder.record(&head, &QUERY, &input, &[f64::from(k)], OK);
            assert!(records.next(&mut body));
            assert_eq!(body[..2], [u64::from(k), 0]);
            assert_eq!(body[2..4], [join(7, 3), u64::from(k)]);
            let mut numbers = body[BODY_HEAD..].to_vec();
            assert_eq!(numbers.pop(), Some(f64::from(k).to_bits()));
            assert_eq!(numbers, input.iter().map(|number| number.to_bits()).collect::<Vec<_>>());
            assert!(!records.next(&mut body));
        }
    }

    #[test]
    fn what_does_not_fit_is_left_out_and_counted() {
        let (mut recorder, mut records) = ring(40);
        let mut body = Vec::new();
        for _ in 0..10 {
            recorder.record(&RequestHead::default(), &QUERY, &[1.0; 5], &[2.0; 5], OK);
        }
        assert_eq!([(); 3].map(|()| records.next(&mut body)), [true, true, false]);
        recorder.record_refusal(&RequestHead::default(), Status::WrongModel);
        assert!(records.next(&mut body));
        assert_eq!((body.len(), body[1]), (BODY_HEAD, 8));
        assert!(!records.is_abandoned());
        drop(recorder);
        assert!(records.is_abandoned());
    }
}
