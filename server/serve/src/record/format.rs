//! The layout of a recording: words of 64 bits, little-endian, independent of every other layout of
//! the program.
//!
//! ```text
//! header, one page    MAGIC, format, protocol, fingerprint, start, seconds, run,
//!                     bytes of the robot, its checksum, segments, bytes of a segment, checksum
//! robot               JSON, filled up to whole pages
//! segments            MAGIC, number from 1, first sequence, checksum; then frames
//! frame               FRAME and words of the body, sequence, checksum of both, of the body; body
//! body                time, lost, plan and client, sequence, status and warnings, counts,
//!                     request and links, given, want, tolerances of loops and of the given state,
//!                     indices of links, numbers in, numbers out
//! ```
//!
//! Segments are written one after the other and round again; a new number voids the
//! former content of the segment, because every checksum in it depends on that number.

use sarrus_proto::message::{MAX_NUMBERS_IN, MAX_NUMBERS_OUT};
use sarrus_proto::{FieldSet, MAX_FRAMES, MAX_JOINT_RUNS, MAX_WRENCHES, Query};
use sarrus_proto::{QueryOptions, Request, TaskParts, Tolerance};

/// First word of a recording.
pub(super) const MAGIC: u64 = u64::from_le_bytes(*b"sarrusRC");
/// First word of a segment.
pub(super) const SEGMENT: u64 = u64::from_le_bytes(*b"sarrusSG");
/// Upper half of the first word of a frame.
pub(super) const FRAME: u32 = u32::from_le_bytes(*b"saFR");
/// Version of this layout.
pub(super) const FORMAT: u64 = 7;
/// Bytes of a word.
pub(super) const WORD: usize = 8;
/// Bytes of the header; the robot is padded to a multiple of it.
pub(super) const PAGE: usize = 4096;
/// Words of the header.
pub(super) const HEADER: usize = 12;
/// Words before the first frame of a segment.
pub(super) const SEGMENT_HEAD: usize = 4;
/// Words before the body of a frame.
pub(super) const FRAME_HEAD: usize = 4;
/// Words of a body that has no links, joints or numbers.
pub(super) const BODY_HEAD: usize = 16;
/// Words of a query that has neither links nor joints.
pub(super) const QUERY_HEAD: usize = 10;
/// The most words of a body before its numbers: four lists, each filled up to a word.
pub(super) const MAX_BODY_HEAD: usize =
    BODY_HEAD + (2 * MAX_FRAMES + MAX_WRENCHES + 2 * MAX_JOINT_RUNS).div_ceil(LINKS) + 3;
/// The most words of a body.
pub(super) const MAX_BODY: usize = MAX_BODY_HEAD + MAX_NUMBERS_IN + MAX_NUMBERS_OUT;
/// Bytes of the largest frame.
pub(super) const MAX_FRAME: usize = WORD * (FRAME_HEAD + MAX_BODY);
/// Indices of links, or ends of runs of joints, in one word.
const LINKS: usize = 4;

/// A checksum; any change within one word changes it, because each step is one to one in the word
/// and in the sum so far.
pub(super) fn checksum(seed: u64, words: impl IntoIterator<Item = u64>) -> u64 {
    let mixed = words
        .into_iter()
        .fold(seed, |sum, word| (sum.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    mixed ^ mixed >> 32
}

/// The words of bytes; the last one is filled up with zeros.
pub(super) fn words(bytes: &[u8]) -> impl Iterator<Item = u64> {
    bytes.chunks(WORD).map(|chunk| {
        let mut word = [0; WORD];
        word.iter_mut().zip(chunk).for_each(|(to, from)| *to = *from);
        u64::from_le_bytes(word)
    })
}

/// One word of bytes; zero beyond them.
pub(super) fn word(bytes: &[u8], index: usize) -> u64 {
    bytes.get(WORD * index..).and_then(|rest| words(rest).next()).unwrap_or(0)
}

/// Two halves of a word.
pub(super) const fn join(low: u32, high: u32) -> u64 {
    low as u64 | (high as u64) << 32
}

/// Lower and upper half.
pub(super) const fn halves(word: u64) -> (u32, u32) {
    (word as u32, (word >> 32) as u32)
}

/// The client of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Client {
    /// The holder of a lane, by the lane's slot.
    Lane(u32),
    /// A client of the service.
    Service,
}

impl Client {
    const SERVICE: u32 = u32::MAX;

    pub(super) const fn code(self) -> u32 {
        match self {
            Client::Lane(slot) => slot,
            Client::Service => Client::SERVICE,
        }
    }

    pub(super) const fn from_code(code: u32) -> Client {
        match code {
            Client::SERVICE => Client::Service,
            slot => Client::Lane(slot),
        }
    }
}

impl std::fmt::Display for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Client::Lane(slot) => write!(f, "lane {slot}"),
            Client::Service => f.write_str("service"),
        }
    }
}

/// Writes a query: request, counts of links and runs of joints, fields, indices of links, ends of
/// the runs, parts of the tasks; returns the number of words.
pub(super) fn write_query(query: &Query, words: &mut [u64]) -> usize {
    let frames = query.frames();
    let wrenches = query.wrench_links();
    let runs = query.joint_runs().as_flattened();
    let counts = frames.len() as u32 | (wrenches.len() as u32) << 8 | (runs.len() as u32) << 16;
    let packed = |links: &[u16]| links.iter().rev().fold(0, |word, link| word << 16 | *link as u64);
    let [given, given_above] = query.given.into();
    let [want, want_above] = query.want.into();
    let fixed = [
        join(query.request, counts),
        given,
        given_above,
        want,
        want_above,
        query.loop_tolerance.0,
        query.projection_tolerance.0,
        query.options.0,
        join(query.axes, query.relative_to),
        query.n_directions,
    ];
    let parts = query.tasks.map(|parts| u16::from(parts.0));
    let parts = &parts[..n_parts(query.request, frames.len())];
    let links = frames.chunks(LINKS).chain(wrenches.chunks(LINKS)).chain(runs.chunks(LINKS));
    let links = links.chain(parts.chunks(LINKS));
    let links = links.map(packed);
    words.iter_mut().zip(fixed.into_iter().chain(links)).map(|(to, word)| *to = word).count()
}

/// A task has a frame.
fn n_parts(request: u32, frames: usize) -> usize {
    if Request::from_code(request).is_some_and(Request::has_tasks) { frames } else { 0 }
}

/// Reads a query (`None` where no plan ran) and its number of words; `None` for malformed words.
pub(super) fn read_query(words: &[u64]) -> Option<(Option<Query>, usize)> {
    let (head, rest) = words.split_first_chunk::<5>()?;
    let [first, given, given_above, want, want_above] = *head;
    let [open, projection, options, seen, n_directions] = *rest.first_chunk::<5>()?;
    let (request, counts) = halves(first);
    if request == 0 {
        return Some((None, QUERY_HEAD));
    }
    let [n_frames, n_wrenches, runs, more] = counts.to_le_bytes().map(usize::from);
    let n_ends = runs | more << 8;
    if n_frames > MAX_FRAMES || n_wrenches > MAX_WRENCHES || n_ends > 2 * MAX_JOINT_RUNS {
        return None;
    }
    let mut at = QUERY_HEAD;
    let mut links = |n: usize| {
        let packed = words.get(at..at + n.div_ceil(LINKS))?;
        at += packed.len();
        let link =
            |k: usize| (packed.get(k / LINKS).copied().unwrap_or(0) >> (16 * (k % LINKS))) as u16;
        Some((0..n).map(link).collect::<Vec<u16>>())
    };
    let frames = links(n_frames)?;
    let wrenches = links(n_wrenches)?;
    let ends = links(n_ends)?;
    let parts = links(n_parts(request, n_frames))?;
    let request = Request::from_code(request)?;
    let (axes, relative_to) = halves(seen);
    let [given, want] = [[given, given_above], [want, want_above]].map(FieldSet::from);
    let mut query = Query {
        loop_tolerance: Tolerance(open),
        projection_tolerance: Tolerance(projection),
        options: QueryOptions(options),
        n_joint_runs: (n_ends / 2) as u32,
        axes,
        relative_to,
        n_directions,
        ..Query::new(request, given, want).with_frames(&frames)
    };
    query.joints.iter_mut().zip(ends.chunks_exact(2)).for_each(|(run, ends)| {
        *run = [ends[0], ends[1]];
    });
    for (to, parts) in query.tasks.iter_mut().zip(parts) {
        *to = TaskParts(u8::try_from(parts).ok()?);
    }
    let query = if wrenches.is_empty() { query } else { query.with_wrenches(&wrenches) };
    Some((Some(query), at))
}
