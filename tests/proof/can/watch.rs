//! The output of `sarrus-can top` on a running bridge of either frontend.

use std::path::Path;
use std::process::{Command, Output};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use sarrus_proto::actuators::ActuatorState;
use sarrus_proto::bridge::BridgeEnd;
use sarrus_proto::{Domain, ServerName};
use sarrus_tests::python::environment;
use serde_json::Value;

use super::harness::{BUSES, FRONTENDS, Frontend, N_U, Process, Stage, sarrus_can, wait_for};

fn top(stage: &Stage, format: &str) -> Output {
    let mut top = Command::new(sarrus_can());
    top.args(["top", "end_to_end", "--once", "--format", format]);
    stage.at_home(top).output().unwrap()
}

/// One report of the bridge.
fn look(stage: &Stage, format: &str) -> String {
    let output = top(stage, format);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Repeats the report until a condition holds.
fn until(stage: &Stage, what: &str, is_seen: impl Fn(&Value) -> bool) -> Value {
    wait_for(what, || {
        // on a busy computer the first state may come too late for one report
        let output = Some(top(stage, "json")).filter(|output| output.status.success())?;
        Some(serde_json::from_slice(&output.stdout).unwrap()).filter(&is_seen)
    })
}

fn count(value: &Value) -> u64 {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no count"))
}

/// Cycles in which a motor may go without a request: those of the set-up.
const PAUSE: u64 = 8;

#[test]
fn cycles_buses_and_distributions_of_both_fronts_are_seen() {
    for frontend in FRONTENDS {
        let stage = Stage::new();
        let mut motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
        let bridge = stage.bridge(frontend);
        let mut controller = stage.controller();
        controller.tell("nan 7");
        let first =
            until(&stage, "commands with NaN", |seen| count(&seen["commands"]["not_finite"]) > 0);
        controller.tell("good");
        // the controller answers each state that it receives, about one per cycle
        let accepted = count(&first["commands"]["accepted"]) + 50;
        let seen = until(&stage, "accepted commands", |seen| {
            count(&seen["commands"]["accepted"]) > accepted
        });
        assert_eq!(seen["process"], bridge.id(), "{frontend:?}");
        let cycles = count(&seen["cycles"]);
        assert!(
            cycles >= count(&first["cycles"]) + 50
                && count(&seen["stamp_ns"]) > count(&first["stamp_ns"]),
            "{frontend:?} {seen}"
        );

        let times = &seen["times_ns"];
        for (name, least) in [("wake", cycles), ("work", cycles), ("age", 50), ("reply", 50)] {
            let [n, p50, p99, p999, max] =
                ["count", "p50", "p99", "p999", "max"].map(|key| count(&times[name][key]));
            assert!((least..=cycles).contains(&n), "{frontend:?} {name}: {n} of {cycles}");
            assert!(
                0 < p50 && p50 <= p99 && p99 <= p999 && p999 <= max,
                "{frontend:?} {name}: {times}"
            );
        }

        let buses = seen["buses"].as_array().unwrap();
        assert_eq!(buses.len(), BUSES.len());
        for (bus, (name, actuators)) in buses.iter().zip(BUSES) {
            assert_eq!(
                (&bus["name"], &bus["state"]),
                (&name.into(), &"active".into()),
                "{frontend:?}"
            );
            // each motor gets a frame in each cycle after the set-up, and answers every one that
            // arrives
            let [sent, received, dropped] =
                ["sent", "received", "dropped"].map(|key| count(&bus[key]));
            let all = (cycles - PAUSE) * actuators.len() as u64;
            assert!(
                sent + dropped >= all && received > 50 && received <= sent,
                "{frontend:?} {cycles} cycles: {bus}"
            );
            assert!(
                ["unknown", "malformed", "off"].iter().all(|key| bus[*key] == 0),
                "{frontend:?}: {bus}"
            );
            assert!((0.01..0.9).contains(&bus["load"].as_f64().unwrap()), "{frontend:?}: {bus}");
        }
        let names: Vec<&str> = seen["actuators"]
            .as_array()
            .unwrap()
            .iter()
            .map(|actuator| actuator["name"].as_str().unwrap())
            .collect();
        assert_eq!(
            (names.len(), names),
            (N_U, BUSES.iter().flat_map(|(_, actuators)| *actuators).copied().collect()),
            "{frontend:?}"
        );

        let text = look(&stage, "text");
        for word in [
            "disabled",
            " cycles",
            "wake",
            "work",
            "command age",
            "reply",
            "torso",
            "left",
            "right",
            "ARWristRoll",
        ] {
            assert!(text.contains(word), "{frontend:?}: no `{word}` in\n{text}");
        }

        // frames that cannot be sent any more are not counted as sent
        drop(motors.remove(0));
        let off = until(&stage, "a bus that is off", |seen| seen["buses"][0]["state"] == "off");
        until(&stage, "frames that were dropped and not sent", |seen| {
            let [bus, before] = [seen, &off].map(|seen| &seen["buses"][0]);
            count(&bus["dropped"]) > count(&before["dropped"]) + 450
                && count(&bus["sent"]) < count(&before["sent"]) + 150
        });
    }
}

#[test]
fn a_dry_run_has_sent_nothing() {
    let stage = Stage::new();
    let _motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
    let mut command = stage.bridge_command(Frontend::Python);
    command.arg("--dry-run");
    let bridge = Process::start("bridge", command);
    assert!(bridge.line().starts_with("ready end_to_end "));
    let seen =
        until(&stage, "frames that were not sent", |seen| count(&seen["buses"][0]["dropped"]) > 0);
    assert!(
        seen["buses"]
            .as_array()
            .unwrap()
            .iter()
            .all(|bus| bus["sent"] == 0 && bus["received"] == 0),
        "{seen}"
    );
}

#[test]
fn a_bridge_without_statistics_is_not_waited_for_for_ever() {
    let stage = Stage::new();
    let node = Domain::at(&stage.root()).unwrap().node().unwrap();
    let end = BridgeEnd::create(&node, &ServerName::new("end_to_end").unwrap()).unwrap();
    let over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let looking = scope.spawn(|| {
            let output = top(&stage, "text");
            over.store(true, Relaxed);
            output
        });
        while !over.load(Relaxed) {
            assert!(end.publish(&ActuatorState::default()));
            std::thread::sleep(Duration::from_millis(20));
        }
        let output = looking.join().unwrap();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(
            String::from_utf8_lossy(&output.stderr).starts_with("sarrus-can top: "),
            "{output:?}"
        );
    });
}

#[test]
fn a_bridge_moves_a_measured_and_a_commanded_robot_in_a_browser() {
    if !environment().has_optional_packages() {
        return;
    }
    let stage = Stage::of_long_times();
    let _motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
    let _bridge = stage.bridge(Frontend::Rust);
    let mut controller = stage.controller();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("proof/python/shown.py");
    let arguments = [script.to_str().unwrap(), "bridge", "end_to_end"];
    let mut shown = Process::start("view", stage.at_home(environment().command(&arguments)));
    for _ in 0..2 {
        controller.tell(&shown.line());
        shown.tell("done");
    }
    let words = shown.line();
    assert!(words.contains("disabled: "), "{words}");
    assert!(shown.end().success());
}
