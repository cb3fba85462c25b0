//! `sarrus-can doctor` and the warnings of `check`, as a stranger meets them.

use std::process::{Command, Output};

use super::{Folder, Program};

const GOOD: &str = "{actuator: elbow, bus: arm, offset: 0, damping: 0.1, watchdog_ms: 50, limits: \
    {position: [-3, 3], velocity: 5, effort: 2}, drive: {protocol: mit, variant: damiao, id: 3, \
    reply_id: 19, position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: \
    500, damping_range: 5}}";

fn sarrus_can(arguments: &[&str]) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } =
        Command::new(env!("CARGO_BIN_EXE_sarrus-can")).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (status.code(), text(stdout), text(stderr))
}

#[test]
fn check_warns_of_each_absurd_value() {
    let folder = Folder::new();
    let warnings = |motor: &str, top: &str| {
        let path = folder.configuration(&[motor]);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{top}{text}")).unwrap();
        let (code, _, err) = sarrus_can(&["check", path.to_str().unwrap()]);
        assert_eq!(code, Some(0), "{err}");
        err
    };
    assert_eq!(warnings(GOOD, ""), "");
    for (from, to, top, word) in [
        ("watchdog_ms: 50", "watchdog_ms: 10000", "", "the watchdog of `elbow` is 10000 ms"),
        ("watchdog_ms: 50", "watchdog_ms: 200", "", "is longer than `disable_ms`, 100"),
        ("", "", "timeouts: {disable_ms: 60000}\n", "`disable_ms` is 60000 ms"),
        ("", "", "timeouts: {feedback_ms: 5000}\n", "`feedback_ms` is 5000 ms"),
        ("", "", "ramp_ms: 0\n", "`ramp_ms` is 0"),
        ("damping: 0.1, ", "damping: 0, ", "", "has a `damping` of 0"),
        ("effort: 2", "effort: 1e6", "", "limit of effort of `elbow` is 1000000"),
        ("velocity: 5", "velocity: 500", "", "limit of velocity of `elbow` is 500"),
        ("[-3, 3]", "[-3, 30]", "", "limit of position of `elbow` is 30"),
    ] {
        let err = warnings(&GOOD.replacen(from, to, 1), top);
        let lines: Vec<&str> = err.lines().collect();
        assert!(lines.len() == 1 && lines[0].contains(word), "{word}:\n{err}");
    }
}

#[test]
fn check_refuses_a_motor_that_lacks_a_limit() {
    let folder = Folder::new();
    for (without, found) in [
        ("position: [-3, 3], ", "`limits` has no `position`"),
        ("velocity: 5, ", "`limits` has no `velocity`"),
        (", effort: 2", "`limits` has no `effort`"),
        ("limits: {position: [-3, 3], velocity: 5, effort: 2}, ", "the motor has no `limits`"),
    ] {
        assert!(GOOD.contains(without), "{without}");
        let path = folder.configuration(&[&GOOD.replacen(without, "", 1)]);
        let (code, _, err) = sarrus_can(&["check", path.to_str().unwrap()]);
        assert_eq!(code, Some(1), "{err}");
        let lines: Vec<&str> = err.lines().collect();
        assert!(lines.len() == 2 && lines[0].contains(found), "{found}:\n{err}");
    }
}

#[test]
fn doctor_says_what_to_do_in_one_line_a_finding() {
    let folder = Folder::new();
    let path = folder.configuration(&[&GOOD.replace("effort: 2", "effort: 1e6")]);
    let path = path.to_str().unwrap();
    let (code, out, err) = sarrus_can(&["doctor", path]);
    assert_eq!(code, Some(1), "{out}{err}");
    for (check, word) in [("configuration: ", "1000000"), ("bus arm: ", "cannot be opened")] {
        let line = out.lines().find(|line| line.starts_with(check));
        assert!(line.is_some_and(|line| line.contains(word)), "{check} {word}:\n{out}");
    }
    assert!(out.lines().all(|line| line.contains(": ")), "{out}");
    let (code, out, _) = sarrus_can(&["doctor", path, "--format", "json"]);
    let object: serde_json::Value = serde_json::from_str(&out).unwrap();
    assert!(code == Some(1) && object["findings"].as_array().unwrap().len() > 1, "{object}");
    // files and flags
    assert_eq!(sarrus_can(&["doctor", "/nothing/robot.yml"]).0, Some(2));
    assert_eq!(sarrus_can(&["doctor"]).0, Some(2));
    std::fs::write(folder.path("none.yml"), "rate_hz: 0").unwrap();
    assert_eq!(sarrus_can(&["doctor", folder.path("none.yml").to_str().unwrap()]).0, Some(1));
}

#[test]
fn doctor_reads_the_firmware_of_motors_that_answer_and_names_those_that_do_not() {
    let folder = Folder::new();
    let path = folder.configuration(&[GOOD]);
    let path = path.to_str().unwrap();
    let mut motors = Program::start(&["simulate", path, "--pty"]);
    assert!(motors.line().starts_with("ready arm "));
    let (_, out, err) = sarrus_can(&["doctor", path, "--motors"]);
    assert!(
        err.contains("firmware of elbow: sw_ver 5013") && !out.contains("motor elbow"),
        "{err}"
    );
    assert!(!out.contains("bus arm"), "{out}");
    motors.tell("silence elbow on");
    motors.report();
    let (code, out, _) = sarrus_can(&["doctor", path, "--motors"]);
    assert!(code == Some(1) && out.contains("motor elbow: no answer"), "{out}");
    assert_eq!(motors.report()["power"], false);
}
