//! Counters of the answering thread, and the percentiles of its latency.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use quanta::Clock;
use sarrus_proto::Answer;
use sarrus_proto::message::Counts;

/// Buckets of latency: sixteen for each doubling of the counter's ticks.
const N_BUCKETS: usize = 640;

/// The transport of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Transport {
    /// A lane.
    Lane,
    /// The service.
    Service,
}

/// Counters with one writer, the answering thread, and any number of readers.
pub(crate) struct Counters {
    counts: Counts<AtomicU64>,
    buckets: [AtomicU64; N_BUCKETS],
    /// Late answers of the client at each place.
    late: Box<[AtomicU64]>,
}

impl Counters {
    /// Counters for this many places.
    pub(crate) fn new(n_places: usize) -> Counters {
        Counters {
            counts: Counts::default(),
            buckets: [const { AtomicU64::new(0) }; N_BUCKETS],
            late: (0..n_places).map(|_| AtomicU64::new(0)).collect(),
        }
    }

    /// Counts one answer; `ticks` of the processor's counter from finding the request to publishing
    /// the answer.
    #[inline]
    pub(crate) fn record(&self, transport: Transport, status: u32, ticks: u64) {
        let Counts { lane_requests, service_requests, .. } = &self.counts;
        match transport {
            Transport::Lane => add_one(lane_requests),
            Transport::Service => add_one(service_requests),
        }
        self.count(status);
        add_one(&self.buckets[bucket_of(ticks)]);
    }

    /// Counts the states of a tile of a batch.
    pub(crate) fn record_states(&self, answers: &[Answer]) {
        for answer in answers {
            add_one(&self.counts.batch_states);
            self.count(answer.status as u32);
        }
    }

    /// Counts a status.
    #[inline]
    pub(crate) fn count(&self, status: u32) {
        let statuses = &self.counts.statuses;
        add_one(&statuses[(status as usize).min(statuses.len() - 1)]);
    }

    /// Number of answers by kernels.
    #[inline]
    pub(crate) fn set_by_kernel(&self, answers: u64) {
        self.counts.by_kernel.store(answers, Relaxed);
    }

    /// Counts an answer after its deadline, for the client at this place.
    #[cold]
    pub(crate) fn record_late(&self, place: usize) {
        add_one(&self.counts.late);
        if let Some(late) = self.late.get(place) {
            add_one(late);
        }
    }

    /// Resets the count of a place for a new client.
    pub(crate) fn forget_late(&self, place: usize) {
        if let Some(late) = self.late.get(place) {
            late.store(0, Relaxed);
        }
    }

    /// Late answers of the client at this place.
    pub(crate) fn late_of(&self, place: usize) -> u64 {
        self.late.get(place).map_or(0, |late| late.load(Relaxed))
    }

    /// p50, p90, p99, p99.9 and the largest latency so far, to a sixteenth `[ns]`.
    pub(crate) fn percentiles(&self, clock: &Clock) -> [u64; 5] {
        let counts = self.buckets.each_ref().map(|bucket| bucket.load(Relaxed));
        let total = counts.iter().sum::<u64>() as f64;
        [0.5, 0.9, 0.99, 0.999, 1.0].map(|quantile: f64| {
            let wanted = (quantile * total).ceil().max(1.0) as u64;
            let mut seen = 0;
            let is_there = |count: &u64| {
                seen += count;
                seen >= wanted
            };
            let bucket = counts.iter().position(is_there);
            bucket.map_or(0, |bucket| clock.delta_as_nanos(0, middle_of(bucket)))
        })
    }

    /// The counters on the wire.
    pub(crate) fn counts(&self) -> Counts {
        self.counts.map(|counter| counter.load(Relaxed))
    }
}

// one writer: a load and a store, no locked instruction
#[inline]
fn add_one(counter: &AtomicU64) {
    counter.store(counter.load(Relaxed).wrapping_add(1), Relaxed);
}

#[inline]
fn bucket_of(ticks: u64) -> usize {
    if ticks < 16 {
        return ticks as usize;
    }
    let exponent = ticks.ilog2() as usize;
    ((exponent - 3) * 16 + (ticks >> (exponent - 4) & 15) as usize).min(N_BUCKETS - 1)
}

/// The middle of a bucket in ticks.
fn middle_of(bucket: usize) -> u64 {
    if bucket < 16 {
        return bucket as u64;
    }
    let exponent = bucket / 16 + 3;
    let part = (bucket % 16) as u64;
    ((16 + part) << (exponent - 4)) + (1_u64 << (exponent - 4)) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_resolve_ticks_to_a_sixteenth() {
        for exponent in 0..42 {
            for ticks in
                [1_u64 << exponent, (1 << exponent) + (1 << exponent) / 3, (2 << exponent) - 1]
            {
                let middle = middle_of(bucket_of(ticks)) as f64;
                assert!(
                    (middle - ticks as f64).abs() <= ticks as f64 / 16.0,
                    "{ticks} became {middle}"
                );
            }
        }
        assert_eq!(bucket_of(u64::MAX), N_BUCKETS - 1);
    }

    #[test]
    fn late_answers_are_counted_for_all_and_for_the_client_of_each_slot() {
        let counters = Counters::new(5);
        [3, 6, 3, 5].into_iter().for_each(|place| counters.record_late(place));
        assert_eq!((counters.counts().late, counters.late_of(3), counters.late_of(4)), (4, 2, 0));
        counters.forget_late(3);
        assert_eq!((counters.counts().late, counters.late_of(3)), (4, 0));
    }

    #[test]
    fn percentiles_come_from_the_counts() {
        let counters = Counters::new(0);
        assert_eq!(counters.percentiles(&Clock::new()), [0; 5]);
        (0..1000).for_each(|k| {
            counters.record(
                if k % 2 == 0 { Transport::Lane } else { Transport::Service },
                k % 2,
                1 << 20,
            )
        });
        let counts = counters.counts();
        assert_eq!(
            (counts.lane_requests, counts.service_requests, counts.statuses[1]),
            (500, 500, 500)
        );
        let [p50, .., max] = counters.percentiles(&Clock::new());
        assert!(p50 > 0 && max >= p50 && max < 2 * p50);
    }
}
