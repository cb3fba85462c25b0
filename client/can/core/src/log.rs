//! Logs of a bridge's inputs, one JSON line for each. The same log gives the same frames, in every
//! frontend.
//!
//! ```json
//! {"t": 2000000, "frame": "123#0011AA", "bus": "left_arm"}
//! {"t": 2100000, "event": "dropped", "count": 3, "bus": "left_arm"}
//! {"t": 2200000, "operate": "arm"}
//! {"t": 2200000, "operate": "reset", "actuator": "ALElbowAct"}
//! {"t": 2300000, "command": {"sequence": 1, "stamp_ns": 2300000, "effort": [0.5, 0]}}
//! {"t": 4000000, "cycle": true}
//! {"t": 9000000000, "state": "1f 0 3ff0000000000000"}
//! ```
//!
//! `t` is the monotonic clock `[ns]`; frames are as `candump -L` writes them. Missing fields of a
//! command are zero (`fingerprint` and `n_u`: those of the configuration); `null` is NaN, which
//! JSON cannot express. `state` is all that the bridge depends on at that time ([`Bridge::save`]),
//! for a log that does not begin with the bridge: numbers of base 16.

use serde_json::{Value, json};

use crate::bridge::{Bridge, BusEvent};
use crate::config::{Configuration, MAX_ACTUATORS};
use crate::frame::Frame;
use sarrus_proto::actuators::{ActuatorCommand, Operation};

/// One line of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Time of the input `[ns]`.
    pub t: u64,
    /// Content.
    pub what: What,
}

/// Input of a bridge.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// A frame arrived on a bus.
    Frame(usize, Frame),
    /// Another event on a bus.
    Event(usize, BusEvent),
    /// An operator asked for something, of all mechanisms or of that of an actuator.
    Operate(Operation, Option<usize>),
    /// A controller commanded.
    Command(Box<ActuatorCommand>),
    /// It was time for a cycle.
    Cycle,
    /// The state of the bridge, whose inputs before are left out.
    State(Box<[u64]>),
}

impl Line {
    /// Reads a line.
    ///
    /// # Errors
    /// The fault, and the expected text.
    pub fn read(text: &str, configuration: &Configuration) -> Result<Line, String> {
        let line: Value =
            serde_json::from_str(text).map_err(|error| format!("this is not JSON: {error}"))?;
        let t = line.get("t").and_then(Value::as_u64);
        let t = t.ok_or("the line has no time, expected `\"t\": NANOSECONDS`")?;
        let bus = || {
            let name = line.get("bus").and_then(Value::as_str);
            let name = name.ok_or("the line has no bus, expected `\"bus\": NAME`")?;
            configuration.bus(name).ok_or(format!("there is no bus `{name}` in the configuration"))
        };
        let what = if let Some(text) = line.get("frame") {
            let frame = text.as_str().and_then(Frame::from_text);
            let fault = "the frame cannot be read, expected ID#DATA as candump writes it";
            let frame = frame.ok_or(fault)?;
            What::Frame(bus()?, frame)
        } else if let Some(name) = line.get("event") {
            let count = line
                .get("count")
                .map_or(Some(1), Value::as_u64)
                .and_then(|count| u32::try_from(count).ok());
            let count = count.ok_or("`count` is no whole number of 32 bits")?;
            let event = name
                .as_str()
                .and_then(|name| BusEvent::named(name, count))
                .ok_or("there is no such event")?;
            What::Event(bus()?, event)
        } else if let Some(name) = line.get("operate") {
            let operation =
                Operation::ALL.iter().find(|operation| Some(operation.name()) == name.as_str());
            let operation = *operation
                .ok_or("there is no such operation, expected arm, disarm, reset or return")?;
            let actuator = line.get("actuator").map(|name| actuator(name, configuration));
            What::Operate(operation, actuator.transpose()?)
        } else if let Some(fields) = line.get("command") {
            What::Command(Box::new(command(fields, configuration)?))
        } else if line.get("cycle").is_some() {
            What::Cycle
        } else if let Some(words) = line.get("state") {
            let words = words.as_str().unwrap_or("-").split(' ');
            let words: Result<_, _> = words.map(|word| u64::from_str_radix(word, 16)).collect();
            What::State(words.map_err(|_| "`state` is no list of numbers of base 16")?)
        } else {
            return Err("the line says nothing, expected frame, event, operate, command or cycle"
                .to_owned());
        };
        Ok(Line { t, what })
    }

    /// Gives the input to a bridge; false for a state of another configuration or version.
    pub fn apply(&self, bridge: &mut Bridge) -> bool {
        let t = self.t;
        match &self.what {
            What::Frame(bus, frame) => bridge.receive(t, *bus, frame),
            What::Event(bus, event) => bridge.bus_event(t, *bus, *event),
            What::Operate(operation, actuator) => {
                bridge.operate_mechanism(t, *operation, *actuator);
            }
            What::Command(command) => {
                let _ = bridge.command(t, command);
            }
            What::Cycle => bridge.cycle(t),
            What::State(words) => return bridge.restore(words),
        }
        true
    }

    /// The line's text, without its end.
    pub fn text(&self, configuration: &Configuration) -> String {
        let bus = |bus: usize| configuration.buses.get(bus).map_or("", |bus| bus.name.as_str());
        let t = self.t;
        let n_u = configuration.actuators.len();
        let line = match &self.what {
            What::Frame(of, frame) => json!({"t": t, "frame": frame.to_string(), "bus": bus(*of)}),
            What::Event(of, event) => match event.count() {
                Some(count) => {
                    json!({"t": t, "event": event.name(), "count": count, "bus": bus(*of)})
                }
                None => json!({"t": t, "event": event.name(), "bus": bus(*of)}),
            },
            What::Operate(operation, actuator) => {
                match actuator.and_then(|actuator| configuration.actuators.get(actuator)) {
                    Some(name) => json!({"t": t, "operate": operation.name(), "actuator": name}),
                    None => json!({"t": t, "operate": operation.name()}),
                }
            }
            What::Command(command) => {
                let mut command = **command;
                let mut fields = json!({
                    "sequence": command.sequence,
                    "stamp_ns": command.stamp_ns,
                    "fingerprint": command.fingerprint,
                    "n_u": command.n_u,
                });
                for (name, list) in command.lists() {
                    fields[name] = json!(list.get(..n_u));
                }
                json!({"t": t, "command": fields})
            }
            What::Cycle => json!({"t": t, "cycle": true}),
            What::State(words) => {
                let words: Vec<String> = words.iter().map(|word| format!("{word:x}")).collect();
                json!({"t": t, "state": words.join(" ")})
            }
        };
        line.to_string()
    }
}

/// The newest fault of a bridge: its actuators and the reason.
pub fn fault(bridge: &Bridge) -> Option<String> {
    let (_, newest) = bridge.faults();
    newest.map(|(mechanism, reason)| {
        let configuration = bridge.configuration();
        let of = configuration.actuators.iter().zip(&configuration.mechanisms);
        let names: Vec<&str> =
            of.filter(|(_, of)| **of == mechanism).map(|(name, _)| name.as_str()).collect();
        format!("{}: {}", names.join(", "), reason.name())
    })
}

/// The frames of the bridge's last cycle at `t` `[ns]`, a line each.
pub fn sent(bridge: &Bridge, t: u64) -> impl Iterator<Item = String> {
    let buses = bridge.configuration().buses.iter().enumerate();
    buses.flat_map(move |(bus, config)| {
        bridge.frames(bus).iter().map(move |frame| dumped(t, &config.name, frame))
    })
}

/// A frame, or other news of a bus at `t` `[ns]`, as `candump -L` writes frames.
pub fn dumped(t: u64, bus: &str, what: impl core::fmt::Display) -> String {
    format!("({}.{:06}) {bus} {what}", t / 1_000_000_000, t % 1_000_000_000 / 1000)
}

/// The whole numbers of a command; its lists follow them.
const WHOLE: [&str; 4] = ["sequence", "stamp_ns", "fingerprint", "n_u"];

/// Place of an actuator by its name.
fn actuator(name: &Value, configuration: &Configuration) -> Result<usize, String> {
    let place = name.as_str().and_then(|name| configuration.actuator(name));
    place.ok_or(format!("there is no actuator {name} in the configuration"))
}

fn command(fields: &Value, configuration: &Configuration) -> Result<ActuatorCommand, String> {
    let Value::Object(given) = fields else { return Err("the command is no mapping".to_owned()) };
    let mut command = ActuatorCommand::default();
    let lists = command.lists().map(|(name, _)| name);
    let known: Vec<&str> = WHOLE.into_iter().chain(lists).collect();
    if let Some(unknown) = given.keys().find(|key| !known.contains(&key.as_str())) {
        return Err(format!("a command has no `{unknown}`, expected {}", known.join(", ")));
    }
    let whole = |key: &str, otherwise: u64| {
        given
            .get(key)
            .map_or(Some(otherwise), Value::as_u64)
            .ok_or(format!("`{key}` is no whole number"))
    };
    let numbers = |key: &str| {
        let mut numbers = [0.0; MAX_ACTUATORS];
        let Some(given) = given.get(key) else { return Ok(numbers) };
        let given = given
            .as_array()
            .filter(|given| given.len() <= MAX_ACTUATORS)
            .ok_or(format!("`{key}` is no list of numbers"))?;
        for (into, number) in numbers.iter_mut().zip(given) {
            *into = if number.is_null() {
                f64::NAN
            } else {
                number.as_f64().ok_or(format!("`{key}` holds {number}, expected numbers"))?
            };
        }
        Ok::<_, String>(numbers)
    };
    command.sequence = whole("sequence", 0)?;
    command.stamp_ns = whole("stamp_ns", 0)?;
    command.fingerprint = whole("fingerprint", configuration.fingerprint)?;
    command.n_u = whole("n_u", configuration.actuators.len() as u64)?;
    for (name, list) in command.lists() {
        *list = numbers(name)?;
    }
    Ok(command)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Surroundings;
    use crate::frame::Id;
    use sarrus_models::LoadError;

    fn configuration() -> Configuration {
        let yaml = "rate_hz: 500\nbuses:\n- {name: x, channel: can0}\nmotors:\n- {actuator: a, \
            bus: x, drive: {protocol: cybergear, id: 1, \
                    position_range: 12.5}, offset: 0, limits: {position: [-9, 9], \
                    velocity: 5, effort: 1}, watchdog_ms: 50}\n";
        let surroundings = Surroundings {
            file: &|_| Err("absent".into()),
            robot: &|_| Err(LoadError::Open("robot".into(), "absent".into())),
        };
        Configuration::read("log.yml", yaml.into(), &surroundings).unwrap()
    }

    #[test]
    fn lines_are_read_as_they_are_written() {
        let configuration = configuration();
        let mut command =
            ActuatorCommand { sequence: 7, stamp_ns: 8, n_u: 1, ..ActuatorCommand::default() };
        (command.position[0], command.effort[0]) = (0.1 + 0.2, -1e-300);
        let whats = [
            What::Frame(0, Frame::classic(Id::Extended(0x1234), &[1, 2]).unwrap()),
            What::Event(0, BusEvent::Dropped(u32::MAX)),
            What::Event(0, BusEvent::BusOff),
            What::Operate(Operation::Reset, None),
            What::Operate(Operation::Arm, Some(0)),
            What::Command(Box::new(command)),
            What::Cycle,
            What::State([0, 1, u64::MAX].into()),
        ];
        for what in whats {
            let line = Line { t: u64::MAX, what };
            assert_eq!(Line::read(&line.text(&configuration), &configuration), Ok(line));
        }
        // NaN is null and back
        command.velocity[0] = f64::NAN;
        let line = Line { t: 0, what: What::Command(Box::new(command)) };
        let Ok(Line { what: What::Command(back), .. }) =
            Line::read(&line.text(&configuration), &configuration)
        else {
            panic!()
        };
        assert!(back.velocity[0].is_nan());
    }

    #[test]
    fn lines_that_are_none_say_what_is_wrong() {
        for (line, expected) in [
            ("{", "not JSON"),
            ("{\"t\": -1, \"cycle\": true}", "no time"),
            ("{\"t\": Infinity, \"cycle\": true}", "not JSON"),
            ("{\"t\": 1}", "says nothing"),
            ("{\"t\": 1, \"frame\": \"123#0\", \"bus\": \"x\"}", "cannot be read"),
            ("{\"t\": 1, \"frame\": \"+12#+f\", \"bus\": \"x\"}", "cannot be read"),
            ("{\"t\": 1, \"frame\": \"123#00\", \"bus\": \"y\"}", "no bus `y`"),
            ("{\"t\": 1, \"event\": \"dropped\", \"count\": -1, \"bus\": \"x\"}", "`count`"),
            (
                "{\"t\": 1, \"event\": \"dropped\", \"count\": 4294967296, \"bus\": \"x\"}",
                "`count`",
            ),
            ("{\"t\": 1, \"operate\": \"run\"}", "no such operation"),
            ("{\"t\": 1, \"operate\": \"arm\", \"actuator\": \"b\"}", "no actuator"),
            ("{\"t\": 1, \"state\": \"0 g\"}", "base 16"),
            ("{\"t\": 1, \"state\": [1]}", "base 16"),
            ("{\"t\": 1, \"command\": {\"position\": [NaN]}}", "not JSON"),
            ("{\"t\": 1, \"command\": {\"position\": [\"1\"]}}", "`position` holds"),
            ("{\"t\": 1, \"command\": {\"positions\": [1]}}", "no `positions`"),
            ("{\"t\": 1, \"command\": [1]}", "no mapping"),
        ] {
            let message = Line::read(line, &configuration()).unwrap_err();
            assert!(message.contains(expected), "{line}: {message}");
        }
    }
}
