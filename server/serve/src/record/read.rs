//! Reads a recording, which may be cut off, damaged or forged.

use std::io::{Read, Seek, SeekFrom};

use sarrus_proto::{Answer, Query, Status, Warnings};

use super::error::RecordingError;
use super::file::segment_head;
use super::format::{
    BODY_HEAD, Client, FRAME, FRAME_HEAD, MAX_BODY, PAGE, QUERY_HEAD, SEGMENT_HEAD, WORD, checksum,
    halves, read_query, word, words,
};
use super::header::Header;
use super::robot::RecordedRobot;

/// Most bytes without a record that are read: only the newest segment has many of them.
const HOLES: u64 = 1 << 30;

/// One request and its answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry<'a> {
    /// Time of finding the request, from the start of the recording `[ns]`.
    pub time_ns: u64,
    /// Requests that were answered but not recorded until then.
    pub lost: u64,
    /// The plan's number on the wire.
    pub plan: u32,
    /// The client.
    pub client: Client,
    /// The client's count of its requests.
    pub sequence: u64,
    /// The answer: number of the status, bits of the warnings.
    pub answer: [u32; 2],
    /// The query of the plan; `None` if the request was refused before any plan ran.
    pub query: Option<Query>,
    /// The numbers of the request, as the server read them.
    pub input: &'a [f64],
    /// The numbers of the answer.
    pub output: &'a [f64],
}

impl Entry<'_> {
    /// Status and warnings of a computed answer, as in the record.
    pub const fn code(answer: Answer) -> [u32; 2] {
        let Answer { status, warnings: Warnings(bits) } = answer;
        [status as u32, bits]
    }

    /// The recorded status.
    pub const fn status(&self) -> Status {
        Status::of_answer(self.answer[0])
    }
}

/// Missing and damaged records.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gaps {
    /// Records between the first and the last that cannot be read.
    pub damaged: u64,
    /// True when the last record was cut off while it was written.
    pub cut_off: bool,
}

/// A recording that can be read.
#[derive(Debug)]
pub struct Recording<R> {
    source: R,
    header: Header,
    robot: RecordedRobot,
    /// Numbers of the segments in use, in order.
    segments: Vec<u64>,
}

impl<R: Read + Seek> Recording<R> {
    /// Reads everything except the records.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn open(mut source: R) -> Result<Recording<R>, RecordingError> {
        let found = source.seek(SeekFrom::End(0))?;
        let header = Header::read(&bytes_at(&mut source, 0, found.min(PAGE as u64))?)?;
        let expected = header.file().ok_or(RecordingError::Header)?;
        if found < expected {
            return Err(RecordingError::Truncated { found, expected });
        }
        let robot = bytes_at(&mut source, PAGE as u64, header.robot)?;
        if checksum(0, words(&robot)) != header.robot_checksum {
            return Err(RecordingError::Robot);
        }
        let robot = serde_json::from_slice(&robot).map_err(|_| RecordingError::Robot)?;

        // the newest number, and those of the lap before it
        let mut segments = Vec::new();
        for index in 0..header.segments {
            let at = header.segment_at(index);
            let head = bytes_at(&mut source, at, (WORD * SEGMENT_HEAD) as u64)?;
            let [_, number, first, _] = std::array::from_fn(|k| word(&head, k));
            let expected = segment_head(header.run, number, first);
            let is_there = number.wrapping_sub(1) % header.segments == index && number > 0;
            if is_there && words(&head).eq(expected) {
                segments.push(number);
            }
        }
        segments.sort_unstable();
        let newest = segments.last().copied().unwrap_or(0);
        segments.retain(|number| newest - number < header.segments);
        Ok(Recording { source, header, robot, segments })
    }

    /// The robot that the recording holds.
    pub fn robot(&self) -> &RecordedRobot {
        &self.robot
    }

    /// Fingerprint of the server's model.
    pub fn fingerprint(&self) -> u64 {
        self.header.fingerprint
    }

    /// The requested length `[s]`.
    pub fn seconds(&self) -> u64 {
        self.header.seconds
    }

    /// Whether older records were overwritten.
    pub fn is_full(&self) -> bool {
        self.segments.first().is_some_and(|number| *number > 1)
    }

    /// Every record that can be read, from the oldest to the newest, with the
    /// progress over the segments; returns the gaps.
    ///
    /// # Errors
    /// [`RecordingError::Read`], [`RecordingError::Holes`].
    pub fn read(&mut self, mut each: impl FnMut(&Entry<'_>, f64)) -> Result<Gaps, RecordingError> {
        let mut expected = None;
        let mut gaps = Gaps::default();
        let mut numbers = Vec::with_capacity(MAX_BODY);
        let mut holes = 0;
        for (k, number) in self.segments.iter().enumerate() {
            let start = self.header.segment_at((number - 1) % self.header.segments);
            let segment = bytes_at(&mut self.source, start, self.header.segment)?;
            let mut at = WORD * SEGMENT_HEAD;
            gaps.cut_off = false;
            while let Some(rest) = segment.get(at..).filter(|rest| rest.len() >= WORD) {
                let Some(frame) = Frame::read(rest, self.header.run ^ number) else {
                    // the next frame may be readable
                    at += WORD;
                    holes += WORD as u64;
                    if holes > HOLES {
                        return Err(RecordingError::Holes(HOLES));
                    }
                    continue;
                };
                at += WORD * FRAME_HEAD + frame.body.len();
                gaps.cut_off = !frame.is_whole;
                let next = *expected.get_or_insert(frame.sequence);
                let Some(entry) = frame.entry(&mut numbers).filter(|_| frame.sequence >= next)
                else {
                    continue;
                };
                gaps.damaged = gaps.damaged.saturating_add(frame.sequence - next);
                expected = Some(frame.sequence.saturating_add(1));
                let part = at as f64 / segment.len() as f64;
                each(&entry, (k as f64 + part) / self.segments.len() as f64);
            }
        }
        Ok(gaps)
    }
}

/// A frame whose head is sound.
struct Frame<'a> {
    sequence: u64,
    body: &'a [u8],
    is_whole: bool,
}

impl Frame<'_> {
    /// The frame at the start of the bytes.
    fn read(bytes: &[u8], seed: u64) -> Option<Frame<'_>> {
        let (n, mark) = halves(word(bytes, 0));
        if mark != FRAME || n as usize > MAX_BODY {
            return None;
        }
        let sequence = word(bytes, 1);
        let body_seed = word(bytes, 2);
        if body_seed != checksum(seed, [word(bytes, 0), sequence]) {
            return None;
        }
        let body = bytes.get(WORD * FRAME_HEAD..)?.get(..WORD * n as usize)?;
        let is_whole = word(bytes, 3) == checksum(body_seed, words(body));
        Some(Frame { sequence, body, is_whole })
    }

    /// Its record; `None` if it is damaged.
    fn entry<'n>(&self, numbers: &'n mut Vec<f64>) -> Option<Entry<'n>> {
        if !self.is_whole {
            return None;
        }
        let head: [u64; BODY_HEAD - QUERY_HEAD] = std::array::from_fn(|k| word(self.body, k));
        let [time_ns, lost, plan, sequence, answer, counts] = head;
        let rest: Vec<u64> = words(self.body.get(WORD * head.len()..)?).collect();
        let (query, n_words) = read_query(&rest)?;
        numbers.clear();
        numbers.extend(rest.get(n_words..)?.iter().map(|word| f64::from_bits(*word)));
        let (n_in, n_out) = halves(counts);
        let (input, output) = numbers.split_at_checked(n_in as usize)?;
        let (plan, client) = halves(plan);
        let (status, warnings) = halves(answer);
        let entry = Entry {
            time_ns,
            lost,
            plan,
            client: Client::from_code(client),
            sequence,
            answer: [status, warnings],
            query,
            input,
            output,
        };
        Some(entry).filter(|entry| entry.output.len() == n_out as usize)
    }
}

/// Bytes of the source, which the caller has checked to exist.
fn bytes_at<R: Read + Seek>(source: &mut R, at: u64, n: u64) -> Result<Vec<u8>, RecordingError> {
    source.seek(SeekFrom::Start(at))?;
    let mut bytes = Vec::new();
    source.by_ref().take(n).read_to_end(&mut bytes)?;
    Ok(bytes)
}
