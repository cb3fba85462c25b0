//! Statistics of a frontend for monitoring: distributions of its times, and the bridge's counts.

use hdrhistogram::Histogram;
use sarrus_proto::watch::{BridgeStatistics, BusStatistics, Label, MAX_BUSES, Times};

use crate::bridge::Bridge;
use crate::config::bus_load::Load;

/// Longer times saturate at this `[ns]`.
const LONGEST_NS: u64 = 10_000_000_000;
/// Time between two sets of statistics `[ns]`.
const STATISTICS_NS: u64 = 500_000_000;

/// Distributions since the start, in a fixed amount of memory.
#[derive(Debug)]
pub struct Telemetry {
    wake: Histogram<u64>,
    work: Histogram<u64>,
    age: Histogram<u64>,
    reply: Histogram<u64>,
    replies: u64,
    sent: [u64; MAX_BUSES],
    published_ns: u64,
    fixed: BridgeStatistics,
}

impl Telemetry {
    /// Empty distributions of the process with this number, started at the monotonic time
    /// `started_ns`; `None` without memory. Allocates; nothing after it does.
    pub fn new(
        bridge: &Bridge,
        loads: &[Load],
        process: u32,
        started_ns: u64,
    ) -> Option<Telemetry> {
        let configuration = bridge.configuration();
        let mut fixed = BridgeStatistics {
            started_ns,
            process: u64::from(process),
            n_buses: configuration.buses.len() as u64,
            n_u: configuration.actuators.len() as u64,
            ..BridgeStatistics::default()
        };
        for (into, (bus, load)) in fixed.buses.iter_mut().zip(configuration.buses.iter().zip(loads))
        {
            *into = BusStatistics {
                name: Label::new(&bus.name),
                load: load.fraction,
                ..BusStatistics::default()
            };
        }
        for (into, name) in fixed.actuators.iter_mut().zip(&configuration.actuators) {
            *into = Label::new(name);
        }
        Some(Telemetry {
            wake: histogram()?,
            work: histogram()?,
            age: histogram()?,
            reply: histogram()?,
            replies: 0,
            sent: [0; MAX_BUSES],
            published_ns: 0,
            fixed,
        })
    }

    /// Takes a cycle that has just ended: from its scheduled time to its start, and from its start
    /// to its last frame `[ns]`.
    pub fn cycle(&mut self, bridge: &Bridge, wake_ns: u64, work_ns: u64) {
        let counters = bridge.counters();
        self.wake.saturating_record(wake_ns);
        self.work.saturating_record(work_ns);
        if counters.commands.accepted > 0 {
            self.age.saturating_record(counters.age_ns);
        }
        if counters.replies > self.replies {
            self.replies = counters.replies;
            self.reply.saturating_record(counters.reply_ns);
        }
        for (bus, sent) in self.sent.iter_mut().enumerate() {
            *sent += bridge.frames(bus).len() as u64;
        }
    }

    /// Everything, when it is time to publish it again: whole histograms are read, which is too
    /// much for every cycle.
    pub fn due(&mut self, bridge: &Bridge, now_ns: u64) -> Option<BridgeStatistics> {
        let is_due = now_ns.saturating_sub(self.published_ns) > STATISTICS_NS;
        is_due.then(|| {
            self.published_ns = now_ns;
            self.statistics(bridge, now_ns)
        })
    }

    /// Everything, as of `now_ns`.
    pub fn statistics(&self, bridge: &Bridge, now_ns: u64) -> BridgeStatistics {
        let counters = bridge.counters();
        let mut statistics = BridgeStatistics {
            stamp_ns: now_ns,
            cycles: counters.cycles,
            commands: counters.commands,
            wake: times(&self.wake),
            work: times(&self.work),
            age: times(&self.age),
            reply: times(&self.reply),
            ..self.fixed
        };
        for (bus, (into, sent)) in statistics.buses.iter_mut().zip(self.sent).enumerate() {
            let Some((state, counters)) = bridge.bus_counters(bus) else { continue };
            *into = BusStatistics {
                state: state as u64,
                sent: sent.saturating_sub(counters.counts.dropped),
                counts: counters.counts,
                ..*into
            };
        }
        statistics
    }
}

/// Two digits, up to the longest: a table that is soon read.
fn histogram() -> Option<Histogram<u64>> {
    Histogram::new_with_bounds(1, LONGEST_NS, 2).ok()
}

fn times(histogram: &Histogram<u64>) -> Times {
    Times {
        count: histogram.len(),
        p50: histogram.value_at_quantile(0.5),
        p99: histogram.value_at_quantile(0.99),
        p999: histogram.value_at_quantile(0.999),
        max: histogram.max(),
    }
}
