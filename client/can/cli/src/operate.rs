//! `sarrus-can arm`, `disarm`, `reset`, `return` and `confirm`: an operator's requests to a running
//! bridge.

use std::io::{self, Write};
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::Observer;
use sarrus_client::actuators::{ActuatorState, MechanismState, Operation, Reason, flag};
use sarrus_client::watch::BridgeStatistics;

use crate::failed;
use crate::top::{meanings, of};

/// Flags of all of them.
#[derive(Args)]
pub(crate) struct Operate {
    /// Name of the bridge
    #[arg(default_value = "default")]
    name: String,
    /// Only the mechanism that this actuator acts on
    #[arg(long)]
    actuator: Option<String>,
    /// Wait at most this long for the bridge to be where it is to go `[s]`; without it 5 s, and as
    /// long as motors are being stopped
    #[arg(long)]
    timeout: Option<f64>,
}

/// A request may find a bridge that does not know of this program yet: it is repeated after this
/// time.
const AGAIN: Duration = Duration::from_millis(50);
/// Timeout without a flag `[s]`, and that of the way back inside the limits.
const SECONDS: f64 = 5.0;
const RETURN_SECONDS: f64 = 70.0;
/// Statistics with the names of the actuators come within this time.
const NAMES: Duration = Duration::from_secs(3);
/// After this time without a change a request to arm was refused at once.
const REFUSED: Duration = Duration::from_millis(300);

impl Operate {
    /// 0 when the bridge is where it was to go, 1 when it is not (and why), 2 without a bridge.
    pub(crate) fn run(&self, operation: Operation) -> ExitCode {
        let name = operation.name();
        let (observer, actuator) = match self.connect() {
            Ok(connected) => connected,
            Err(error) => return failed(name, error),
        };
        match self.ask(&observer, operation, actuator) {
            Ok(()) => {
                // a closed stdout is no failure
                let _ = writeln!(io::stdout(), "{}", goal(operation));
                ExitCode::SUCCESS
            }
            Err(states) => {
                eprintln!("sarrus-can {name}: {states}");
                tell_meanings(&observer, operation);
                ExitCode::from(1)
            }
        }
    }

    /// The bridge, and the place in u of the actuator that is meant.
    fn connect(&self) -> Result<(Observer, Option<usize>), String> {
        let observer = Observer::connect(&self.name).map_err(|error| error.to_string())?;
        let actuator = self.actuator.as_deref().map(|name| place(&observer, name)).transpose()?;
        Ok((observer, actuator))
    }

    /// Asks until the bridge is where it is to go, or will not get there.
    fn ask(
        &self,
        observer: &Observer,
        operation: Operation,
        actuator: Option<usize>,
    ) -> Result<(), String> {
        let operate = |operation: Operation| match actuator {
            Some(actuator) => observer.operate_mechanism(operation, actuator),
            None => observer.operate(operation),
        };
        let seconds = self.timeout.unwrap_or(match operation {
            Operation::Return => RETURN_SECONDS,
            _ => SECONDS,
        });
        let timeout = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let begin = Instant::now();
        let mut asked = operate(operation);
        let mut repeated = begin;
        let mut begun = false;
        let mut before = None;
        let mut last: Option<StateCounts> = None;
        let is_stopping = |last: Option<StateCounts>| last.is_some_and(|last| last.stopping > 0);
        while begin.elapsed() < timeout || self.timeout.is_none() && is_stopping(last) {
            thread::sleep(Duration::from_millis(5));
            let Some(state) = observer.state() else { continue };
            let now = StateCounts::of(&state, actuator);
            let before = *before.get_or_insert(now);
            last = Some(now);
            if state.stamp_ns > asked {
                // a stop that has begun is not requested again: that would cut it short
                begun |= now != before || now.stopping > 0 || begin.elapsed() > REFUSED;
                match operation {
                    Operation::Disarm if now.enabled + now.arming + now.stopping == 0 => {
                        return Ok(());
                    }
                    Operation::Confirm if now.elsewhere == 0 => return Ok(()),
                    Operation::Reset if now.fault == 0 => return Ok(()),
                    Operation::Return if begun && now.arming + now.stopping == 0 => {
                        let is_back = now.reason == Reason::Disarmed as u32 && now != before;
                        return if is_back { Ok(()) } else { Err(now.why_not_back()) };
                    }
                    Operation::Arm if now.enabled == now.all && now.all > 0 => return Ok(()),
                    // refused, or given up
                    Operation::Arm if begun && now.arming == 0 => return Err(now.to_string()),
                    _ => {}
                }
            }
            if !begun && repeated.elapsed() > AGAIN {
                (asked, repeated) = (operate(operation), Instant::now());
            }
        }
        let Some(last) = last else { return Err("the bridge is silent".to_owned()) };
        if operation == Operation::Arm && last.enabled == 0 && last.arming > 0 {
            // power must not come after this program has ended
            operate(Operation::Disarm);
            thread::sleep(AGAIN);
            return Err(format!("{last}; given up after {seconds} s and disarmed"));
        }
        Err(last.to_string())
    }
}

/// Prints the actuators that did not get power, and details of single actuators beyond their
/// reasons; names come twice a second.
fn tell_meanings(observer: &Observer, operation: Operation) {
    let mut state = None;
    let mut statistics = None;
    for _ in 0..60 {
        thread::sleep(Duration::from_millis(10));
        state = observer.state().or(state);
        statistics = observer.statistics().or(statistics);
        let is_told = statistics.is_some()
            || operation != Operation::Arm
                && state.as_ref().is_some_and(|state| meanings(state, None).is_empty());
        if state.is_some() && is_told {
            break;
        }
    }
    let Some(state) = state else { return };
    if let (Operation::Arm, Some(statistics)) = (operation, &statistics) {
        without_power(&state, statistics).iter().for_each(|line| eprintln!("  {line}"));
    }
    meanings(&state, statistics.as_ref()).iter().for_each(|line| eprintln!("  {line}"));
}

/// The actuators with motors that have no power, by state and reason.
fn without_power(state: &ActuatorState, statistics: &BridgeStatistics) -> Vec<String> {
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    let names = statistics.actuators.iter().take(state.n_u as usize);
    let places = names.zip(state.flags.iter().zip(state.states.iter().zip(&state.reasons)));
    for (name, (flags, (code, why))) in places {
        if *flags & flag::NO_MOTOR != 0 || *code == MechanismState::Enabled as u32 {
            continue;
        }
        let help = match MechanismState::from_code(*code) {
            Some(MechanismState::Fault) => "; `sarrus-can reset` after somebody looked",
            _ => "",
        };
        let words = format!("{}{help}", in_words(*code, *why));
        match groups.iter_mut().find(|(known, _)| *known == words) {
            Some((_, names)) => names.push(name.as_str()),
            None => groups.push((words, vec![name.as_str()])),
        }
    }
    groups.iter().map(|(words, names)| format!("{}: {words}", names.join(", "))).collect()
}

/// A state, and why where there is a reason.
fn in_words(state: u32, reason: u32) -> String {
    match reason {
        0 => MechanismState::name_of(state).to_owned(),
        reason => format!("{}: {}", MechanismState::name_of(state), Reason::name_of(reason)),
    }
}

/// The place in u of an actuator, by the names that the bridge sends twice a second.
fn place(observer: &Observer, name: &str) -> Result<usize, String> {
    let begin = Instant::now();
    while begin.elapsed() < NAMES {
        let Some(statistics) = observer.statistics() else {
            thread::sleep(Duration::from_millis(5));
            continue;
        };
        let names = statistics.actuators.iter().take(statistics.n_u as usize);
        let names: Vec<&str> = names.map(|name| name.as_str()).collect();
        let fault = || format!("the bridge has no actuator {name}, expected {}", names.join(", "));
        return names.iter().position(|known| *known == name).ok_or_else(fault);
    }
    Err("the bridge is silent".to_owned())
}

/// Message after success.
fn goal(operation: Operation) -> &'static str {
    match operation {
        Operation::Arm => "enabled",
        Operation::Disarm => "disarmed",
        Operation::Return => "inside the limits",
        Operation::Confirm => "confirmed",
        _ => "reset",
    }
}

/// How many actuators with motors stand where, and the worst of their reasons.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct StateCounts {
    all: usize,
    enabled: usize,
    arming: usize,
    stopping: usize,
    fault: usize,
    /// Number of those elsewhere than where they were last seen.
    elsewhere: usize,
    state: u32,
    reason: u32,
}

impl StateCounts {
    /// Of all mechanisms, or of that of an actuator.
    fn of(state: &ActuatorState, actuator: Option<usize>) -> StateCounts {
        let all = state.flags.iter().zip(&state.states).take(state.n_u as usize).enumerate();
        let meant = all.filter(|(place, _)| actuator.is_none_or(|meant| meant == *place));
        let meant: Vec<(&u32, &u32)> = meant.map(|(_, of)| of).collect();
        let with_motor = || meant.iter().filter(|(flags, _)| **flags & flag::NO_MOTOR == 0);
        let count =
            |state: MechanismState| with_motor().filter(|(_, of)| **of == state as u32).count();
        StateCounts {
            all: with_motor().count(),
            enabled: count(MechanismState::Enabled),
            arming: count(MechanismState::Arming),
            stopping: count(MechanismState::Stopping),
            fault: count(MechanismState::Fault),
            elsewhere: meant
                .iter()
                .filter(|(flags, _)| **flags & flag::POSITION_CHANGED != 0)
                .count(),
            state: actuator.map_or(state.state, |place| of(&state.states, place)),
            reason: actuator.map_or(state.reason, |place| of(&state.reasons, place)),
        }
    }

    /// Why nothing was brought back inside its limits.
    fn why_not_back(&self) -> String {
        if self.enabled > 0 {
            format!("{self}; what has power is not brought back, disarm it first")
        } else if matches!(Reason::from_code(self.reason), Some(Reason::None | Reason::Disarmed)) {
            format!("{self}; nothing is outside its limits")
        } else {
            self.to_string()
        }
    }
}

impl core::fmt::Display for StateCounts {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "the bridge is {}; {} of {} actuators have power",
            in_words(self.state, self.reason),
            self.enabled + self.stopping,
            self.all
        )
    }
}
