//! `sarrus top`: the current state of a server and its clients.

use std::fmt::Write;
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::{ServerView, Statistics, Status};
use serde_json::{Map, Value, json};

use super::output::{Failure, FormatFlag, Outcome, Results, table};

/// Time between the two readings of which a rate is made.
const SPAN: Duration = Duration::from_millis(500);

/// Flags of `top`.
#[derive(Args)]
pub(crate) struct Top {
    /// Name of the server.
    name: String,
    #[command(flatten)]
    format: FormatFlag,
}

impl Top {
    /// The state of the server.
    pub(crate) fn run(self) -> Outcome {
        let view =
            ServerView::connect(&self.name, Duration::from_secs(2)).map_err(Failure::start)?;
        let before = view.statistics().map_err(Failure::start)?;
        let start = Instant::now();
        std::thread::sleep(SPAN);
        let now = view.statistics().map_err(Failure::start)?;
        let seconds = start.elapsed().as_secs_f64();
        let rate = |f: fn(&Statistics) -> u64| (f(&now) - f(&before)) as f64 / seconds;
        let rates = [
            rate(|statistics| statistics.counts.lane_requests),
            rate(|statistics| statistics.counts.service_requests),
            rate(|statistics| statistics.counts.batch_states),
        ];
        let life = view.life();
        let silent_ms = life.silent.map(|silent| silent.as_secs_f64() * 1e3);
        let seen =
            Observation { name: &self.name, now, rates, silent_ms, state: life.state.name() };
        Ok(Results { text: self.format.render(&seen.json(), |_| seen.words()), code: 0 })
    }
}

/// The state of a server and its clients.
struct Observation<'a> {
    name: &'a str,
    now: Statistics,
    /// Answers each second through lanes, through services and in batches.
    rates: [f64; 3],
    silent_ms: Option<f64>,
    state: &'static str,
}

impl Observation<'_> {
    /// The count of each answered status.
    fn statuses(&self) -> impl Iterator<Item = (&'static str, u64)> {
        let counted = Status::ALL.iter().map(|status| (status.name(), self.now.answered(*status)));
        counted.filter(|(_, count)| *count > 0)
    }

    fn json(&self) -> Value {
        let Observation { now, rates, .. } = self;
        let counts = &now.counts;
        let [p50, p90, p99, p999, max] = now.latency_ns;
        let statuses: Map<String, Value> =
            self.statuses().map(|(name, count)| (name.to_owned(), count.into())).collect();
        json!({
            "server": self.name,
            "process": now.process,
            "uptime": now.uptime,
            "clients": now.clients,
            "lanes": now.lanes,
            "lanes_taken": now.lanes_taken,
            "plans": now.plans,
            "rates": { "lane": rates[0], "service": rates[1], "batch": rates[2] },
            "requests": {
                "lane": counts.lane_requests,
                "service": counts.service_requests,
                "batch": counts.batch_states,
            },
            "latency_ns": { "p50": p50, "p90": p90, "p99": p99, "p99.9": p999, "max": max },
            "statuses": statuses,
            "late": counts.late,
            "by_kernel": counts.by_kernel,
            "heartbeat": { "state": self.state, "age_ms": self.silent_ms },
        })
    }

    fn words(&self) -> String {
        let Statistics { uptime, counts, latency_ns, lanes_taken, lanes, plans, process, .. } =
            &self.now;
        let mut words = format!(
            "{}: process {process}, {}, up {uptime:.0} s, heartbeat {} ms ago\n\
             {lanes_taken} of {lanes} lanes, {plans} plans; answers/s: {:.0} through lanes, {:.0} \
             through services, {:.0} in batches; {} late, {} by kernels\n",
            self.name,
            self.state,
            self.silent_ms.map_or("?".to_owned(), |ms| format!("{ms:.1}")),
            self.rates[0],
            self.rates[1],
            self.rates[2],
            counts.late,
            counts.by_kernel
        );
        let us = latency_ns.map(|ns| format!("{:.1}", ns as f64 * 1e-3));
        let _ = writeln!(
            words,
            "µs: p50 {}, p90 {}, p99 {}, p99.9 {}, max {}",
            us[0], us[1], us[2], us[3], us[4]
        );
        for (name, count) in self.statuses() {
            let _ = writeln!(words, "{name}: {count}");
        }
        let rows: Vec<Vec<String>> = self
            .now
            .clients
            .iter()
            .map(|client| {
                let numbers = [client.plans, client.late].map(|number| number.to_string());
                let mut row = vec![client.process.to_string(), client.end.clone()];
                row.extend(numbers);
                row
            })
            .collect();
        words + &table("client | has | plans | late", &rows)
    }
}
