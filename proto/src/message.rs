//! Payloads: plain numbers of fixed size, without pointers and without trusted lengths.

use core::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::{Status, Warnings};

/// Version of everything on the wire; a change of any payload raises it, together with the type
/// names in `lane.rs`.
pub const PROTOCOL_VERSION: u32 = 8;
/// Plans that a server holds at once; a power of two, see [`PlanNumber`].
pub const MAX_PLANS: usize = 1024;
/// Plans that one process of clients may hold; the others stay for other processes.
pub const MAX_PLANS_OF_PROCESS: usize = 768;
/// Numbers that one request can carry: y, ẏ, ÿ and a guess of a thousand joints.
pub const MAX_NUMBERS_IN: usize = 4096;
/// Numbers that one answer can carry.
pub const MAX_NUMBERS_OUT: usize = 16384;
/// Clients that can have a service at once.
pub const MAX_SERVICE_CLIENTS: usize = 32;
/// Number of status counters, more than there are statuses.
pub const N_STATUSES: usize = 32;

/// The number of a plan on the wire: a slot in the server's table and a generation, so that the
/// number of a released plan is never reused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct PlanNumber(pub u32);

impl PlanNumber {
    /// Most uses of one slot.
    pub const GENERATIONS: u32 = u32::MAX / MAX_PLANS as u32 + 1;

    /// The number of a slot in its `generation`-th use.
    pub const fn new(slot: usize, generation: u32) -> PlanNumber {
        PlanNumber(generation * MAX_PLANS as u32 + slot as u32)
    }

    /// The slot in the table.
    #[inline]
    pub const fn slot(self) -> usize {
        self.0 as usize % MAX_PLANS
    }
}

/// The head of every request, through either transport.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct RequestHead {
    /// [`PROTOCOL_VERSION`] of the client.
    pub version: u32,
    /// Number of the plan, as the server gave it; see [`PlanNumber`].
    pub plan: u32,
    /// Fingerprint of the model that the client was made for.
    pub fingerprint: u64,
    /// Counts the client's requests from 1; the answer repeats it. In a lane, 0 means no request.
    pub sequence: u64,
    /// The client's CLOCK_MONOTONIC at the request `[ns]`, if it wants times or has a deadline;
    /// else 0, and the server reads no clock for it.
    pub stamp_ns: u64,
    /// Largest age of the request when its answer is published `[ns]`; 0 for any age.
    pub deadline_ns: u64,
    /// [`checksum::of_request`] where the plan's query asks for it; else 0.
    ///
    /// [`checksum::of_request`]: crate::checksum::of_request
    pub checksum: u64,
}

/// Words of a [`RequestHead`].
pub(crate) const HEAD: usize = 6;

impl RequestHead {
    /// The head as words in the order of its bytes.
    #[inline]
    pub(crate) fn words(&self) -> [u64; HEAD] {
        let RequestHead { version, plan, fingerprint, sequence, stamp_ns, deadline_ns, checksum } =
            *self;
        [pair(version, plan), fingerprint, sequence, stamp_ns, deadline_ns, checksum]
    }
}

/// One word of two numbers.
#[inline]
pub(crate) fn pair(low: u32, high: u32) -> u64 {
    u64::from(low) | u64::from(high) << 32
}

/// The two numbers of one word.
#[inline]
pub(crate) fn halves(word: u64) -> [u32; 2] {
    [word as u32, (word >> 32) as u32]
}

/// The head of every answer, through either transport.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct ResponseHead {
    /// Number of the [`Status`].
    pub status: u32,
    /// Bits of the [`Warnings`].
    pub warnings: u32,
    /// The request's sequence.
    pub sequence: u64,
    /// Age of the request when the server took it `[ns]`, saturated; 0 if it has no stamp.
    pub age_ns: u32,
    /// Time from taking the request to publishing this answer `[ns]`, saturated; 0 if the request
    /// has no stamp.
    pub took_ns: u32,
    /// [`checksum::of_answer`] where the request has one; else 0.
    ///
    /// [`checksum::of_answer`]: crate::checksum::of_answer
    pub checksum: u64,
}

impl ResponseHead {
    /// The head of an answer.
    pub const fn new(status: Status, warnings: Warnings, sequence: u64) -> ResponseHead {
        ResponseHead {
            status: status as u32,
            warnings: warnings.0,
            sequence,
            age_ns: 0,
            took_ns: 0,
            checksum: 0,
        }
    }
}

/// One lane entry: a head and room for `N` numbers, of which the plan's count is used.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Entry<H, const N: usize> {
    /// The head.
    pub head: H,
    /// The numbers.
    pub numbers: [f64; N],
}

/// A request through the service. The client may change it while the server reads, so its
/// words are atomic and the server reads each of them once.
#[derive(Debug)]
#[repr(C)]
pub struct ComputeRequest {
    head: [AtomicU64; HEAD],
    numbers: [AtomicU64; MAX_NUMBERS_IN],
}

impl Default for ComputeRequest {
    /// All zero.
    fn default() -> ComputeRequest {
        ComputeRequest {
            head: [const { AtomicU64::new(0) }; HEAD],
            numbers: [const { AtomicU64::new(0) }; MAX_NUMBERS_IN],
        }
    }
}

impl ComputeRequest {
    /// Writes the head and the numbers; numbers beyond the payload are dropped, since the server
    /// refuses plans that need more.
    pub fn write(&self, head: &RequestHead, numbers: &[f64]) {
        self.head.iter().zip(head.words()).for_each(|(word, value)| word.store(value, Relaxed));
        store_numbers(&self.numbers, numbers);
    }

    /// Reads the head.
    pub fn head(&self) -> RequestHead {
        let words = self.head.each_ref().map(|word| word.load(Relaxed));
        let [first, fingerprint, sequence, stamp_ns, deadline_ns, checksum] = words;
        let [version, plan] = halves(first);
        RequestHead { version, plan, fingerprint, sequence, stamp_ns, deadline_ns, checksum }
    }

    /// Reads as many numbers as `numbers` holds.
    pub fn read(&self, numbers: &mut [f64]) {
        load_numbers(&self.numbers, numbers);
    }
}

/// An answer through the service, in atomic words as the request.
#[derive(Debug)]
#[repr(C)]
pub struct ComputeResponse {
    head: [AtomicU64; ANSWER_HEAD],
    numbers: [AtomicU64; MAX_NUMBERS_OUT],
}

/// Words of a [`ResponseHead`].
const ANSWER_HEAD: usize = 4;

impl ComputeResponse {
    /// Writes the head.
    pub(crate) fn write_head(&self, head: &ResponseHead) {
        let ResponseHead { status, warnings, sequence, age_ns, took_ns, checksum } = *head;
        let words = [pair(status, warnings), sequence, pair(age_ns, took_ns), checksum];
        self.head.iter().zip(words).for_each(|(word, value)| word.store(value, Relaxed));
    }

    /// Reads the head.
    pub(crate) fn head(&self) -> ResponseHead {
        let [outcome, sequence, times, checksum] =
            self.head.each_ref().map(|word| word.load(Relaxed));
        let [status, warnings] = halves(outcome);
        let [age_ns, took_ns] = halves(times);
        ResponseHead { status, warnings, sequence, age_ns, took_ns, checksum }
    }

    /// The words of its numbers.
    pub(crate) fn numbers(&self) -> &[AtomicU64] {
        &self.numbers
    }
}

/// Writes numbers to words that other processes reach; false if there are too few words. Never
/// allocates.
#[inline]
pub fn store_numbers(words: &[AtomicU64], numbers: &[f64]) -> bool {
    words.iter().zip(numbers).for_each(|(word, number)| word.store(number.to_bits(), Relaxed));
    numbers.len() <= words.len()
}

/// Reads numbers from words that other processes reach; false if there are too few words. Never
/// allocates.
#[inline]
pub fn load_numbers(words: &[AtomicU64], numbers: &mut [f64]) -> bool {
    numbers.iter_mut().zip(words).for_each(|(number, word)| {
        *number = f64::from_bits(word.load(Relaxed));
    });
    numbers.len() <= words.len()
}

/// Counters of the answering thread, every counter once: a `u64` as it travels, an atomic
/// integer where it is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[repr(C)]
pub struct Counts<N = u64> {
    /// Requests answered through lanes.
    pub lane_requests: N,
    /// Requests answered through the service.
    pub service_requests: N,
    /// States answered in batches.
    pub batch_states: N,
    /// Answers by number of the [`Status`].
    pub statuses: [N; N_STATUSES],
    /// Answers that were published after the deadline of their requests.
    pub late: N,
    /// Answers by generated kernels.
    pub by_kernel: N,
}

impl<N> Counts<N> {
    /// Every counter converted.
    pub fn map<M>(&self, f: impl Fn(&N) -> M) -> Counts<M> {
        let Counts { lane_requests, service_requests, batch_states, statuses, late, by_kernel } =
            self;
        Counts {
            lane_requests: f(lane_requests),
            service_requests: f(service_requests),
            batch_states: f(batch_states),
            statuses: statuses.each_ref().map(&f),
            late: f(late),
            by_kernel: f(by_kernel),
        }
    }
}

/// The state of a run of the server, as its maintenance thread reports it.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Statistics {
    /// Seconds since the server was ready.
    pub uptime: f64,
    /// Counters of the answering thread.
    pub counts: Counts,
    /// Time from finding a request of one state to publishing its answer `[ns]`: p50, p90, p99,
    /// p99.9 and largest, to about 6 %.
    pub latency_ns: [u64; 5],
    /// Lanes that clients hold or are about to hold.
    pub lanes_taken: u64,
    /// Lanes that the server can give.
    pub lanes: u64,
    /// Lanes made since the start.
    pub lanes_made: u64,
    /// Plans that clients hold.
    pub plans: u64,
    /// Calls of the system's allocator by the thread that answers, after start-up.
    pub system_allocations: u64,
    /// Blocks that thread took from its own pool.
    pub pool_allocations: u64,
    /// Process number of the server.
    pub process: u64,
    /// The connected clients.
    pub clients: Vec<ClientStatistics>,
}

/// A client of a server.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ClientStatistics {
    /// Its process number; 0 if unknown here.
    pub process: u64,
    /// Its transport: `lane`, `service` or `none`.
    pub end: String,
    /// Plans that it holds.
    pub plans: u64,
    /// Answers that came after its deadline.
    pub late: u64,
}

impl Statistics {
    /// Number of answers with a status.
    pub fn answered(&self, status: Status) -> u64 {
        self.counts.statuses[status as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn payloads_keep_the_sizes_of_version_8() {
        assert_eq!(PROTOCOL_VERSION, 8);
        assert_eq!(size_of::<RequestHead>(), 48);
        assert_eq!(size_of::<ResponseHead>(), 32);
        assert_eq!(size_of::<Entry<RequestHead, 16>>(), 48 + 8 * 16);
        assert_eq!(size_of::<ComputeRequest>(), 48 + 8 * MAX_NUMBERS_IN);
        assert_eq!(size_of::<ComputeResponse>(), 32 + 8 * MAX_NUMBERS_OUT);
        assert!(Status::ALL.len() < N_STATUSES);
    }

    #[test]
    fn a_slot_has_another_number_each_time() {
        let last = PlanNumber::GENERATIONS - 1;
        assert_eq!(PlanNumber::new(7, 0), PlanNumber(7));
        assert_eq!(PlanNumber::new(MAX_PLANS - 1, last), PlanNumber(u32::MAX));
        for generation in [0, 1, 2, last] {
            assert_eq!(PlanNumber::new(1000, generation).slot(), 1000);
        }
        assert_ne!(PlanNumber::new(1000, 0), PlanNumber::new(1000, 1));
    }
}
