//! `sarrus-can commission`: the record of a robot, and arming with and without it.

use std::path::Path;
use std::process::Command;

use super::allowance::slowness;
use super::{Folder, Program};

/// The bundled elbow by its one linear drive; times that no pause of this machine passes.
fn elbow(folder: &Folder, name: &str, motor: &str) -> String {
    let channel = folder.path("bus").display().to_string();
    let pause_ms = (300.0 * slowness()).clamp(300.0, 2000.0);
    let text = format!(
        "robot: lambda\nrate_hz: 250\ntimeouts: {{damping_ms: {pause_ms}, disable_ms: {}, \
         feedback_ms: {}}}\nmonitors: {{late_ms: off, second_answer: off}}\nbuses: [{{name: arm, \
         interface: slcan, channel: {channel}}}]\nmotors:\n- {{actuator: ElbowAct, bus: arm, \
         drive: {{protocol: mit, variant: damiao, id: 4, reply_id: 20, position_range: 12.5, \
         velocity_range: 45, torque_range: 3, stiffness_range: 500, damping_range: 5}}, gear: \
         628.3185, limits: {{position: [-0.01, 0.01], velocity: 0.05, effort: 200}}, damping: \
         3000, watchdog_ms: 10000, {motor}}}\n",
        5.0 * pause_ms,
        4.0 * pause_ms,
    );
    let path = folder.path(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

pub(crate) fn sarrus_can(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_sarrus-can")).args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn a_robot_is_armed_with_a_record_that_fits_and_not_without() {
    let folder = Folder::new();
    let good = elbow(&folder, "good.yml", "offset: 0");
    let name = format!("commission-test-{}", std::process::id());
    let simulated = || Program::start(&["simulate", &good, "--pty", "--dynamics", "robot"]);
    // why the bridge does not arm
    let refusal = |configuration: &str| {
        let motors = simulated();
        motors.line();
        let bridge = Program::start(&["run", configuration, "--name", &name]);
        while !bridge.line().starts_with("ready") {}
        let (code, _, err) = sarrus_can(&["arm", &name, "--timeout", "20"]);
        assert_eq!(code, Some(1), "{err}");
        err
    };
    assert!(refusal(&good).contains("not_commissioned"));

    let commission = |configuration: &str| {
        let motors = simulated();
        motors.line();
        sarrus_can(&["commission", configuration, "--yes"])
    };
    let record = folder.path("good.commissioned");
    let (code, out, err) = commission(&good);
    assert_eq!(code, Some(0), "{out}{err}");
    assert_eq!(out.lines().last(), Some(record.to_str().unwrap()), "{out}");
    assert!(out.contains("ElbowAct") && out.contains("closed"), "{out}");
    assert!(out.contains("a wrong zero or gear shows in the effort alone"), "{out}");
    let text = std::fs::read_to_string(&record).unwrap();
    assert!(text.contains("sign: 1, gear: 628.3185, offset: 0,"), "{text}");
    let warns = |path: &str| sarrus_can(&["check", path]).2.contains("no record of the commission");
    assert!(!warns(&good));
    // nothing but a controller is missing now
    assert!(refusal(&good).contains("no_command"));

    // a record of other motors does not fit
    let other = elbow(&folder, "other.yml", "offset: 0.001");
    std::fs::copy(&record, folder.path("other.commissioned")).unwrap();
    assert!(warns(&other));
    assert!(refusal(&other).contains("not_commissioned"));
    let waived = elbow(&folder, "waived.yml", "offset: 0");
    let text = std::fs::read_to_string(&waived).unwrap();
    std::fs::write(&waived, format!("commissioning: none\n{text}")).unwrap();
    assert!(refusal(&waived).contains("no_command"));
}

#[test]
fn a_sign_that_contradicts_the_model_is_found_and_gives_no_record() {
    let folder = Folder::new();
    let good = elbow(&folder, "good.yml", "offset: 0");
    let wrong = elbow(&folder, "wrong.yml", "offset: 0, sign: -1");
    let motors = Program::start(&["simulate", &good, "--pty", "--dynamics", "robot"]);
    motors.line();
    let (code, out, err) = sarrus_can(&["commission", &wrong, "--yes"]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(out.contains("another effort: sign"), "{out}{err}");
    assert!(!Path::new(&folder.path("wrong.commissioned")).exists());
}

#[test]
fn an_effort_that_nothing_could_contradict_is_not_judged() {
    let folder = Folder::new();
    let path = elbow(&folder, "strong.yml", "offset: 0");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("effort: 200", "effort: 1800")).unwrap();
    let motors = Program::start(&["simulate", &path, "--pty", "--dynamics", "robot"]);
    motors.line();
    let (code, out, err) = sarrus_can(&["commission", &path, "--yes"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("effort not judged: the model needs less"), "{out}");
}
