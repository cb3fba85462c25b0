//! Files of the CAN bridge: its configuration, a DBC file, a log.

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::bus_load::loads;
use sarrus_can_core::config::{Configuration, Surroundings};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::log::{Line, sent};
use sarrus_models::{LoadError, Loaded, Options, Report, Source, load};
use sarrus_proto::actuators::Operation;

use super::{BETWEEN, Check, Target, corpus, diagnostics, kind, law, parts};

/// A configuration with a motor of every protocol.
const EVERY: &str = include_str!("../../corpus/configuration/every.yml");
/// The configuration of one motor of a DBC file, and such a file.
const DBC_YAML: &str = include_str!("../../corpus/configuration/dbc.yml");
const DBC_FILE: &str = include_str!("../../corpus/dbc/motor.dbc");

pub(super) const CONFIGURATION: Target = Target {
    name: "configuration",
    seeds: corpus!("configuration/every.yml", "configuration/dbc.yml", "configuration/lambda.yml"),
    tokens: &[
        "robot: lambda",
        "urdf: a.urdf",
        "submechanisms: a.yml",
        "rate_hz: 500",
        "ramp_ms: 10",
        "timeouts: {damping_ms: 20, disable_ms: 100, feedback_ms: 20}",
        "stop: robot",
        "buses:",
        "- {name: a, interface: slcan, channel: x, bitrate: 1000000}",
        "data_bitrate: 5000000",
        "motors:",
        "- actuator: a",
        "bus: a",
        "protocol: mit",
        "cybergear",
        "odrive",
        "moteus",
        "cia402",
        "dbc",
        "variant: damiao",
        "id: 1",
        "reply_id: 17",
        "position_range: 12.5",
        "offset: 0",
        "sign: -1",
        "gear: 10",
        "limits: {position: [-1, 1], velocity: 1, effort: 1}",
        "watchdog_ms: 50",
        "watchdog: believed",
        "damping: 1",
        "file: motor.dbc",
        "~",
        "[]",
        "{}",
        "&a ",
        "*a",
        "!!int ",
        "---\n",
        "\u{feff}",
        "\r\n",
        "constants: Command.Kind=5",
    ],
    start: || {
        let check: Check = Box::new(|input| {
            let (read, kind) = configured(input, DBC_FILE)?;
            if let Some((one, two)) = read {
                alike(Bridge::new(one), Bridge::new(two), &[])?;
            }
            Ok(kind)
        });
        Ok(check)
    },
};

pub(super) const DBC: Target = Target {
    name: "dbc",
    seeds: || {
        let frames = b"101#A100000000000000\n401#0000000000000100\n00000401#0011223344556677";
        let files = corpus!("dbc/motor.dbc", "dbc/orders.dbc", "dbc/floats.dbc")();
        let with_frames = |file| [file, BETWEEN.as_bytes().to_vec(), frames.to_vec()].concat();
        files.into_iter().map(with_frames).collect()
    },
    tokens: &[
        "BO_ ",
        " SG_ ",
        "SIG_VALTYPE_ ",
        "SG_MUL_VAL_ ",
        "BU_:",
        "VERSION \"\"",
        "CM_ ",
        "VAL_ ",
        "BO_ 3221225472 VECTOR__INDEPENDENT_SIG_MSG: 0 Vector__XXX",
        "2147483648",
        "2047",
        "2048",
        "Command",
        "State",
        "Enable",
        "Torque",
        "Position",
        "Speed",
        ": 8 Host",
        "0|8@1+",
        "7|8@0-",
        "0|64@1-",
        "63|64@0+",
        "(1,0)",
        "(0,0)",
        "(-1e308,1e308)",
        "(1e-320,0)",
        "[0|0]",
        "\"\"",
        " M ",
        " m0 ",
        " m3M ",
        "|",
        "@",
        "511",
        "512",
        "64",
        "65",
        "\r\n",
    ],
    start: || {
        let check: Check = Box::new(|input| {
            let [file, frames] = parts(input);
            let (read, kind) = configured(DBC_YAML.as_bytes(), &latin(file))?;
            if let Some((one, two)) = read {
                let frames: Vec<Frame> =
                    latin(frames).lines().take(32).filter_map(Frame::from_text).collect();
                alike(Bridge::new(one), Bridge::new(two), &frames)?;
            }
            Ok(kind)
        });
        Ok(check)
    },
};

pub(super) const LOG: Target = Target {
    name: "log",
    seeds: corpus!("log/start.jsonl", "log/events.jsonl"),
    tokens: &[
        "{\"t\": 1, \"cycle\": true}",
        "\"t\": ",
        "\"frame\": \"123#00\"",
        "\"bus\": \"fd\"",
        "\"bus\": \"classic\"",
        "\"event\": \"bus_off\"",
        "\"dropped\"",
        "\"restarted\"",
        "\"count\": 1",
        "\"operate\": \"arm\"",
        "\"disarm\"",
        "\"reset\"",
        "\"command\": {",
        "\"position\": [",
        "\"effort\": [null]",
        "\"n_u\": 7",
        "\"stiffness\": [1]",
        "\"fingerprint\": 0",
        "\"sequence\": 1",
        "\"stamp_ns\": 0",
        "##1",
        "1FFFFFFF#",
        "null",
        "\\u0000",
        "\\ud800",
        "}\n{",
    ],
    start: || {
        let (read, _) = configured(EVERY.as_bytes(), DBC_FILE)?;
        read.ok_or("every.yml is refused")?;
        let check: Check = Box::new(log);
        Ok(check)
    },
};

/// Bytes as text, the way the bridge reads files: in Latin-1 where they are not UTF-8.
fn latin(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec())
        .unwrap_or_else(|_| bytes.iter().copied().map(char::from).collect())
}

fn read(yaml: &[u8], dbc: &str) -> Result<Configuration, Report> {
    let robot = |source: &Source| -> Result<Loaded, LoadError> {
        match source {
            Source::Bundled(_) => load(source, &Options::default()),
            _ => Err(LoadError::Open("robot.urdf".into(), "absent".into())),
        }
    };
    let file = |name: &str| match name {
        "motor.dbc" => Ok(dbc.to_owned()),
        _ => Err("absent".to_owned()),
    };
    let surroundings = Surroundings { file: &file, robot: &robot };
    Configuration::read("can.yml", yaml.to_vec(), &surroundings)
}

/// Reads a configuration twice and returns the kind of its outcome.
fn configured(
    yaml: &[u8],
    dbc: &str,
) -> Result<(Option<(Configuration, Configuration)>, u64), String> {
    let files = [("can.yml", yaml)];
    match (read(yaml, dbc), read(yaml, dbc)) {
        (Ok(one), Ok(two)) => {
            let [report, again] = [&one, &two].map(|read| read.warnings.clone());
            law(report == again, || "two reports on one configuration".to_owned())?;
            let mut told = Report::default();
            told.warnings = report;
            let kind = diagnostics::check(&told, &files)?;
            law(one.rate_hz > 0.0 && one.period_ns() > 0, || format!("{} Hz", one.rate_hz))?;
            let n_u = one.actuators.len();
            law(one.motors.iter().all(|motor| motor.actuator < n_u), || "no actuator".to_owned())?;
            let loads = loads(&one);
            let are_numbers = loads.iter().all(|load| (0.0..).contains(&load.fraction));
            law(are_numbers, || format!("loads {loads:?}"))?;
            Ok((Some((one, two)), kind ^ (n_u.min(3) as u64) << 60))
        }
        (Err(report), Err(again)) => {
            law(report == again, || "two reports on one configuration".to_owned())?;
            law(!report.errors.is_empty(), || "refused without an error".to_owned())?;
            Ok((None, diagnostics::check(&report, &files)?))
        }
        _ => Err("read once and not again".to_owned()),
    }
}

/// Two bridges of one configuration send the same frames for the same input.
fn alike(mut one: Bridge, mut two: Bridge, frames: &[Frame]) -> Result<(), String> {
    let n_buses = one.configuration().buses.len();
    for (k, t) in (0..40).map(|k| (k, 1 + k as u64 * 2_000_000)) {
        let mut texts = Vec::new();
        for bridge in [&mut one, &mut two] {
            if k == 20 {
                bridge.operate(t, Operation::Arm);
            }
            if let Some(frame) = frames.get(k) {
                (0..n_buses).for_each(|bus| bridge.receive(t, bus, frame));
            }
            bridge.cycle(t);
            texts.push(sent(bridge, t).collect::<Vec<_>>());
        }
        law(texts[0] == texts[1], || format!("cycle {k}: {texts:?}"))?;
        comes_back(&texts[0])?;
    }
    [one, two].iter_mut().for_each(Bridge::shutdown);
    Ok(())
}

/// Frames that are sent are valid in the notation of recordings.
fn comes_back(sent: &[String]) -> Result<(), String> {
    for line in sent {
        let text = line.rsplit(' ').next().unwrap_or_default();
        let frame = Frame::from_text(text).map(|frame| frame.to_string());
        law(frame.as_deref() == Some(text), || format!("{text} is no frame"))?;
    }
    Ok(())
}

/// A log is read or reported; a log that was read is written and read again; two replays agree.
fn log(input: &[u8]) -> Result<u64, String> {
    let (Some((one, two)), _) = configured(EVERY.as_bytes(), DBC_FILE)? else {
        return Err("every.yml is refused".to_owned());
    };
    let mut one = Bridge::new(one);
    let mut two = Bridge::new(two);
    let mut kinds = 0;
    for text in latin(input).lines().take(64) {
        let line = match Line::read(text, one.configuration()) {
            Ok(line) => line,
            Err(words) => {
                kinds |= 1 << (kind(&words) % 61);
                law(!words.is_empty(), || "told without words".to_owned())?;
                continue;
            }
        };
        let written = line.text(one.configuration());
        let again = Line::read(&written, one.configuration())?.text(one.configuration());
        law(written == again, || format!("{written} is read as {again}"))?;
        [&mut one, &mut two].into_iter().for_each(|bridge| {
            line.apply(bridge);
        });
        let [ours, theirs] =
            [&one, &two].map(|bridge| sent(bridge, line.t).collect::<Vec<String>>());
        law(ours == theirs, || format!("{ours:?} and {theirs:?}"))?;
        comes_back(&ours)?;
        let states = format!("{:?}", one.state()) == format!("{:?}", two.state());
        law(states, || "two states of one log".to_owned())?;
        kinds |= 1 << 62;
    }
    Ok(kinds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_configuration_of_the_corpus_is_valid() {
        for seed in (CONFIGURATION.seeds)() {
            let read = read(&seed, DBC_FILE);
            let errors = read.err().map(|report| report.errors.to_vec());
            assert!(errors.is_none(), "{}: {errors:?}", latin(&seed));
        }
    }
}
