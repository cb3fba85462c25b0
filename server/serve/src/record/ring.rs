//! Passes records from the answering thread to the recorder: a bounded ring of words with one
//! writer and one reader.
//!
//! The answering thread copies head, numbers and answer; it allocates nothing, takes no lock, makes
//! no system call and reads no clock. A record that does not fit is dropped and counted.

use rtrb::{Consumer, Producer, RingBuffer};
use sarrus_proto::message::RequestHead;
use sarrus_proto::{Answer, Query, Status, Warnings};

use super::format::{BODY_HEAD, Client, MAX_BODY, MAX_BODY_HEAD, QUERY_HEAD, join, write_query};

/// Most pending words `[8 byte]`: 16 MiB, one second at 16 MB/s.
pub(super) const CAPACITY: usize = 1 << 21;
/// Offsets of the time and the count of losses in a body.
pub(super) const TIME: usize = 0;

/// The answering thread's end. The record is assembled in this thread's memory while the answer is
/// computed, and enters the ring after the answer is published: the ring's memory is cold, and no
/// client waits for it.
///
/// Words are stored as doubles, so that the numbers of a request are copied without conversion; a
/// copy changes no bit.
pub(crate) struct Recorder {
    ring: Producer<f64>,
    /// The record that is not in the ring yet, its first `n_staged` words.
    staged: Box<[f64]>,
    n_staged: usize,
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
    // maps all pages before the answering thread uses them
    while producer.push(0.0).is_ok() {}
    while consumer.pop().is_ok() {}
    let recorder = Recorder {
        ring: producer,
        staged: vec![0.0; 1 + MAX_BODY].into(),
        n_staged: 0,
        lost: 0,
        taken: 0,
        client: Client::Service,
    };
    (recorder, Records { ring: consumer })
}

impl Recorder {
    /// Notes the client of the next request and its time `[tick]`.
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
        let record = self.staged.get(..n).unwrap_or_default();
        // SYNC POINT: ring of records (the other end is `next`)
        if self.ring.push_entire_slice(record).is_err() {
            self.lost += 1;
        }
    }

    /// Commits a row of a batch; half of the ring is for single requests.
    #[inline]
    pub(crate) fn commit_row(&mut self) {
        if 2 * self.ring.slots() < self.ring.buffer().capacity() {
            self.n_staged = 0;
            self.lost += 1;
        } else {
            self.commit();
        }
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
            self.taken,
            self.lost,
            join(head.plan, self.client.code()),
            head.sequence,
            join(answer.status as u32, answer.warnings.0),
            join(n_in as u32, n_out as u32),
        ]
    }

    fn stage(&mut self, words: &[u64], input: &[f64], output: &[f64]) {
        let n = words.len() + input.len() + output.len();
        // plans have no more numbers
        let Some((length, body)) = self.staged.get_mut(..=n).and_then(<[f64]>::split_first_mut)
        else {
            self.lost += 1;
            return;
        };
        *length = f64::from_bits(n as u64);
        let (to_words, numbers) = body.split_at_mut(words.len());
        to_words.iter_mut().zip(words).for_each(|(to, word)| *to = f64::from_bits(*word));
        let (to_input, to_output) = numbers.split_at_mut(input.len());
        to_input.copy_from_slice(input);
        to_output.copy_from_slice(output);
        self.n_staged = n + 1;
    }
}

impl Records {
    /// The next body, if it is complete.
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
    fn records_come_out_as_they_went_in_round_after_round() {
        let (mut recorder, mut records) = ring(100);
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
        }
    }

    #[test]
    fn a_record_that_does_not_fit_is_left_out_and_counted() {
        let (mut recorder, mut records) = ring(2 * (1 + BODY_HEAD + 10));
        let mut body = Vec::new();
        for _ in 0..10 {
            recorder.record(&RequestHead::default(), &QUERY, &[1.0; 5], &[2.0; 5], OK);
            recorder.commit();
        }
        assert_eq!([(); 3].map(|()| records.next(&mut body)), [true, true, false]);
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
