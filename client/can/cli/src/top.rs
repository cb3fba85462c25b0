//! `sarrus-can top`: a running bridge at a glance.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write as _};
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_can_core::bridge::BusState;
use sarrus_can_core::protocol::fault;
use sarrus_client::actuators::{ActuatorState, MechanismState, Reason, flag};
use sarrus_client::watch::{BridgeStatistics, Times};
use sarrus_client::{ConnectError, Observer};
use sarrus_proto::counts::{BusCounts, CommandVerdict};
use serde_json::{Map, Value, json};

use crate::check::{Format, table};

/// Time for the first state and statistics to come.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Flags of `top`.
#[derive(Args)]
pub(crate) struct Top {
    /// Name of the bridge
    #[arg(default_value = "default")]
    name: String,
    /// Look once; so it is where the output is no terminal
    #[arg(long)]
    once: bool,
    /// As text, or as one JSON object for each look
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Top {
    /// 0, or 2 where there is no bridge.
    pub(crate) fn run(&self) -> ExitCode {
        crate::ended("top", self.watch())
    }

    fn watch(&self) -> Result<(), Box<dyn std::error::Error>> {
        let observer = Observer::connect(&self.name)?;
        let is_live = !self.once && std::io::stdout().is_terminal();
        let mut state = None;
        let mut statistics = None;
        let begin = Instant::now();
        let mut heard = begin;
        loop {
            if let Some(new) = observer.state() {
                (state, heard) = (Some(new), Instant::now());
            }
            statistics = observer.statistics().or(statistics);
            if heard.elapsed() > TIMEOUT || (statistics.is_none() && begin.elapsed() > TIMEOUT) {
                return Err(Box::new(ConnectError::SilentBridge(self.name.clone())));
            }
            if let (Some(state), Some(statistics)) = (&state, &statistics) {
                let text = match self.format {
                    Format::Text => text(state, statistics),
                    Format::Json => format!("{}\n", object(state, statistics)),
                };
                let clear =
                    if is_live && self.format == Format::Text { "\x1b[2J\x1b[H" } else { "" };
                let mut out = std::io::stdout().lock();
                if write!(out, "{clear}{text}").and_then(|()| out.flush()).is_err() || !is_live {
                    return Ok(());
                }
            }
            thread::sleep(Duration::from_millis(if statistics.is_some() { 500 } else { 20 }));
        }
    }
}

/// A motor's own code as a number, a fault found by its drive in words.
fn fault_words(code: u32) -> String {
    fault::describe(code).map_or_else(|| format!("{code:#x}"), str::to_owned)
}

/// A line for each actuator of which more is known than its reason.
pub(crate) fn meanings(
    state: &ActuatorState,
    statistics: Option<&BridgeStatistics>,
) -> Vec<String> {
    (0..state.n_u as usize)
        .filter_map(|place| {
            let words = fault::describe(of(&state.faults, place))?;
            let name = statistics.and_then(|statistics| statistics.actuators.get(place));
            let name =
                name.map_or_else(|| format!("actuator {place}"), |name| name.as_str().to_owned());
            Some(format!("{name}: {words}"))
        })
        .collect()
}

/// One actuator's numbers, by its place.
pub(crate) fn of<T: Copy + Default>(numbers: &[T], place: usize) -> T {
    numbers.get(place).copied().unwrap_or_default()
}

fn times(name: &str, times: &Times) -> Vec<String> {
    let us = |ns: u64| format!("{:.1}", ns as f64 / 1e3);
    vec![
        name.to_owned(),
        times.count.to_string(),
        us(times.p50),
        us(times.p99),
        us(times.p999),
        us(times.max),
    ]
}

fn text(state: &ActuatorState, statistics: &BridgeStatistics) -> String {
    let mut out = String::new();
    let s = statistics;
    let up = s.stamp_ns.saturating_sub(s.started_ns) as f64 * 1e-9;
    // writing to a string cannot fail
    let _ = writeln!(
        out,
        "{} ({})   process {}, {up:.0} s, {} cycles",
        MechanismState::name_of(state.state),
        Reason::name_of(state.reason),
        s.process,
        s.cycles
    );
    let count =
        |verdict: &CommandVerdict| format!("{} {}", s.commands.of(*verdict), verdict.words());
    let (taken, refused) = CommandVerdict::ALL.split_at(1);
    let [taken, refused] = [taken, refused].map(|part| part.iter().map(count).collect::<Vec<_>>());
    let _ = writeln!(out, "commands: {}; refused: {}\n", taken.join(", "), refused.join(", "));
    let rows = [("wake", &s.wake), ("work", &s.work), ("command age", &s.age), ("reply", &s.reply)];
    let rows = rows.map(|(name, of)| times(name, of));
    table(&mut out, "µs | count | p50 | p99 | p99.9 | max", &rows);
    out.push('\n');
    let head = format!("bus | state | load | sent | {}", BusCounts::NAMES.join(" | "));
    let mut rows = Vec::new();
    for bus in s.buses.iter().take(s.n_buses as usize) {
        let mut row = vec![
            bus.name.as_str().to_owned(),
            BusState::name_of(bus.state as u32).to_owned(),
            format!("{:.0} %", bus.load * 100.0),
            bus.sent.to_string(),
        ];
        row.extend(bus.counts.each().map(|(_, count)| count.to_string()));
        rows.push(row);
    }
    table(&mut out, &head, &rows);
    out.push('\n');
    let head = "actuator | state | reason | position | velocity | effort | °C | fault | flags";
    let mut rows = Vec::new();
    for (place, name) in s.actuators.iter().enumerate().take(s.n_u as usize) {
        rows.push(vec![
            name.as_str().to_owned(),
            MechanismState::name_of(of(&state.states, place)).to_owned(),
            Reason::name_of(of(&state.reasons, place)).to_owned(),
            format!("{:.4}", of(&state.position, place)),
            format!("{:.3}", of(&state.velocity, place)),
            format!("{:.3}", of(&state.effort, place)),
            format!("{:.0}", of(&state.temperature, place)),
            fault_words(of(&state.faults, place)),
            flag::names(of(&state.flags, place)).join(" "),
        ]);
    }
    table(&mut out, head, &rows);
    out
}

fn object(state: &ActuatorState, s: &BridgeStatistics) -> Value {
    let times = |times: &Times| {
        json!({"count": times.count, "p50": times.p50, "p99": times.p99,
    "p999": times.p999, "max": times.max})
    };
    let commands: Map<String, Value> = CommandVerdict::ALL
        .iter()
        .map(|verdict| (verdict.name().to_owned(), json!(s.commands.of(*verdict))))
        .collect();
    let buses: Vec<Value> = s
        .buses
        .iter()
        .take(s.n_buses as usize)
        .map(|bus| {
            let mut object = json!({
                "name": bus.name.as_str(),
                "state": BusState::name_of(bus.state as u32),
                "load": bus.load,
                "sent": bus.sent,
            });
            for (name, count) in bus.counts.each() {
                object[name] = json!(count);
            }
            object
        })
        .collect();
    let actuators: Vec<Value> = s
        .actuators
        .iter()
        .enumerate()
        .take(s.n_u as usize)
        .map(|(place, name)| {
            let number =
                |numbers: &[f64]| Some(of(numbers, place)).filter(|number| number.is_finite());
            json!({"name": name.as_str(),
               "state": MechanismState::name_of(of(&state.states, place)),
               "reason": Reason::name_of(of(&state.reasons, place)),
               "position": number(&state.position), "velocity": number(&state.velocity),
               "effort": number(&state.effort),
               "temperature": number(&state.temperature), "fault": of(&state.faults, place),
               "meaning": fault::describe(of(&state.faults, place)),
               "flags": flag::names(of(&state.flags, place)),
               "measured_ns": of(&state.measured_ns, place)})
        })
        .collect();
    json!({
        "state": MechanismState::name_of(state.state), "reason": Reason::name_of(state.reason),
        "sequence": state.sequence, "command": state.command,
        "stamp_ns": state.stamp_ns, "fingerprint": format!("{:016x}", state.fingerprint),
        "process": s.process, "cycles": s.cycles,
        "commands": commands,
        "times_ns": {"wake": times(&s.wake), "work": times(&s.work), "age": times(&s.age),
        "reply": times(&s.reply)},
        "buses": buses, "actuators": actuators,
    })
}
