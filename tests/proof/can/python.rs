//! The Python package by its own tests, and by its commands and pages.

use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use sarrus_tests::python::environment;

use super::harness::{BUSES, Frontend, Process, Stage, wait_for};

#[test]
fn the_package_loads_and_has_the_protocols_of_the_core() {
    let script = "import sarrus, sarrus.can as can; print(sarrus.__version__); print(*[p['name'] \
        for p in can.protocols()])";
    let output = environment().command(&["-c", script]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let names: Vec<&str> =
        sarrus_can_core::protocol::PROTOCOLS.iter().map(|protocol| protocol.name).collect();
    let text = format!("{}\n{}\n", env!("CARGO_PKG_VERSION"), names.join(" "));
    assert_eq!(String::from_utf8(output.stdout).unwrap(), text);
}

#[test]
fn its_own_tests_pass() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../client/python/tests");
    let output = environment()
        .command(&["-W", "error", "-m", "unittest", "discover", "--start-directory", folder])
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    let count = text
        .lines()
        .find_map(|line| line.strip_prefix("Ran ")?.split(' ').next()?.parse::<usize>().ok());
    assert!(count > Some(15) && !text.contains("skipped"), "{text}");
}

#[test]
fn commissioning_finds_reads_zeroes_and_moves_one_motor() {
    let stage = Stage::new();
    let motors = stage.motors("left");
    let can = |arguments: &[&str]| {
        let mut command = environment().can(&arguments[..1]);
        command.arg(&stage.configuration).args(&arguments[1..]);
        let output = command.stdin(std::process::Stdio::null()).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let (code, out, err) = can(&["scan", "ALElbowAct"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.starts_with("ALElbowAct  left  mit  0x7"), "{out}");
    let (code, out, err) = can(&["read", "ALElbowAct"]);
    assert_eq!(code, Some(0), "{out}{err}");
    let row = |name: &str| {
        out.lines().find_map(|line| {
            line.split_whitespace()
                .skip(1)
                .collect::<Vec<_>>()
                .join(" ")
                .strip_prefix(name)
                .map(str::to_owned)
        })
    };
    assert_eq!(
        (row("PMAX ").as_deref(), row("power ").as_deref()),
        (Some("12.5 rad"), Some("off")),
        "{out}"
    );
    assert_eq!(
        (row("Gr ").as_deref(), row("UV_Value ").as_deref()),
        (Some("10"), Some("15 V")),
        "{out}"
    );
    let (code, out, err) = can(&["zero", "ALElbowAct", "--at", "0.05"]);
    assert_eq!((code, err.as_str()), (Some(0), ""), "{out}");
    let offset: f64 = out.strip_prefix("offset: ").unwrap().trim().parse().unwrap();
    assert!((offset - 0.05).abs() < 1e-4, "{out}");
    // without confirmation nothing moves
    let motion = [
        "direction",
        "ALElbowAct",
        "--distance",
        "0.01",
        "--stiffness",
        "20000",
        "--damping",
        "2500",
        "--seconds",
        "0.5",
    ];
    let (code, out, err) = can(&motion);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(err.contains("not confirmed") && out.contains("emergency stop"), "{out}{err}");
    assert!(motors.said().iter().all(|event| event["event"] != "power"));
    let (code, out, err) = can(&[&motion[..], &["--yes"]].concat());
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("% of the distance"), "{out}");
    let events: Vec<_> =
        motors.said().into_iter().filter(|event| event["event"] == "power").collect();
    assert_eq!(
        events.iter().map(|event| event["value"] == true).collect::<Vec<_>>(),
        [true, false],
        "{events:?}"
    );
    let (code, out, err) = can(&["zero", "ALElbowAct", "--yes"]);
    assert_eq!(code, Some(0), "{out}{err}");
    // flags and files
    assert_eq!(can(&["scan", "Elbow"]).0, Some(2));
    assert_eq!(
        can(&["direction", "ALElbowAct", "--distance", "0", "--stiffness", "1", "--damping", "1"])
            .0,
        Some(2)
    );
    let (code, _, err) = can(&["scan", "BodyYaw"]);
    assert_eq!(code, Some(2), "{err}");
    let missing = environment().can(&["run", "/nothing/robot.yml"]).output().unwrap();
    assert_eq!(missing.status.code(), Some(2));
}

/// `python -m sarrus.can` with a configuration: code, stdout, stderr.
fn can(configuration: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = environment().can(&arguments[..1]);
    command.arg(configuration).args(&arguments[1..]);
    let output = command.stdin(std::process::Stdio::null()).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn motors_that_no_configuration_knows_are_found_and_get_another_identifier() {
    let stage = Stage::new();
    let mut motors = stage.motors("left");
    let text = std::fs::read_to_string(&stage.configuration).unwrap();
    let other = stage.folder.join("other.yml");
    std::fs::write(&other, text.replace("id: 7, reply_id: 263", "id: 77, reply_id: 333")).unwrap();
    let other = other.to_str().unwrap();
    let stranger = |id: u32| format!("left  mit  damiao  id {id}  replies on 0x107");
    let (code, out, err) = can(other, &["scan", "ALElbowAct", "--all"]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(out.contains("no answer") && out.contains(&stranger(7)), "{out}{err}");
    assert_eq!(out.matches("replies on").count(), 1, "{out}");
    assert!(err.contains("left: mit damiao: 2046 of 2046"), "{err}");
    // refused without confirmation, then because the number is taken; then changed
    let (code, _, err) = can(&stage.configuration, &["set-id", "ALElbowAct", "0x17"]);
    assert!(code == Some(1) && err.contains("not confirmed"), "{err}");
    let (code, _, err) = can(&stage.configuration, &["set-id", "ALElbowAct", "8", "--yes"]);
    assert!(code == Some(1) && err.contains("somebody has 8 already"), "{err}");
    let (code, out, err) = can(&stage.configuration, &["set-id", "ALElbowAct", "0x17", "--yes"]);
    assert!(code == Some(0) && out.contains("answers as 23"), "{out}{err}");
    let (_, out, err) = can(&stage.configuration, &["scan", "ALElbowAct", "--all"]);
    assert!(out.contains("no answer") && out.contains(&stranger(23)), "{out}{err}");
    assert!(motors.report().iter().all(|motor| motor["power"] == false));
    assert!(motors.said().iter().all(|event| event["event"] != "power"));
    // a protocol that cannot be scanned, and an unknown variant
    let (code, _, err) =
        can(&stage.configuration, &["scan", "ALElbowAct", "--all", "--protocol", "dbc"]);
    assert!(code == Some(2) && err.contains("cannot be asked"), "{err}");
    let (code, _, err) =
        can(&stage.configuration, &["scan", "ALElbowAct", "--all", "--protocol", "mit:none"]);
    assert!(code == Some(2) && err.contains("no variant `none`"), "{err}");
}

#[test]
fn a_zero_is_stored_where_the_protocol_can_and_refused_where_it_cannot() {
    let stage = Stage::new();
    let _motors = stage.motors("left");
    let (code, out, err) = can(&stage.configuration, &["zero", "ALElbowAct", "--save", "--yes"]);
    assert!(code == Some(0) && out.contains("stored"), "{out}{err}");
    let (code, _, err) = can(&stage.configuration, &["zero", "ALElbowAct", "--save", "--at", "1"]);
    assert_eq!(code, Some(2), "{err}");
    let text = std::fs::read_to_string(&stage.configuration).unwrap();
    std::fs::write(&stage.configuration, text.replace("variant: damiao", "variant: t_motor"))
        .unwrap();
    let (code, _, err) = can(&stage.configuration, &["zero", "ALElbowAct", "--save", "--yes"]);
    assert!(code == Some(1) && err.contains("mit t_motor cannot store its zero"), "{err}");
}

#[test]
fn a_limit_that_stops_a_motion_is_named_and_not_the_motor_and_so_are_malformed_answers() {
    let stage = Stage::new();
    let motors = stage.motors("left");
    let text = std::fs::read_to_string(&stage.configuration).unwrap();
    let limits = "limits: {position: [-0.05, 0.05], velocity: 5, effort: 500}";
    let text = text.replace("limits: {position: [-0.09, 0.09], effort: 500, velocity: 5}", limits);
    std::fs::write(&stage.configuration, &text).unwrap();
    let move_by = |distance: &str, stiffness: &str, seconds: &str| {
        let (code, out, err) = can(
            &stage.configuration,
            &[
                "direction",
                "ALElbowAct",
                "--yes",
                "--distance",
                distance,
                "--stiffness",
                stiffness,
                "--damping",
                "100",
                "--seconds",
                seconds,
            ],
        );
        assert_eq!(code, Some(1), "{out}{err}");
        err
    };
    let err = move_by("0.2", "100", "2");
    assert!(err.contains("beyond its upper limit of position, 0.05: the limit stops it"), "{err}");
    let err = move_by("-0.04", "100", "0.001");
    assert!(err.contains("beyond its limit of velocity, 5"), "{err}");
    let err = move_by("0.04", "100000", "2");
    assert!(err.contains("beyond its limit of effort, 500"), "{err}");
    assert!(motors.said().iter().all(|event| event["event"] != "power"));
    // a motor with another protocol than the configured one
    drop(motors);
    let short = text.replace("variant: damiao", "variant: mini_cheetah");
    std::fs::write(&stage.configuration, short).unwrap();
    let _motors = stage.motors("left");
    std::fs::write(&stage.configuration, &text).unwrap();
    let (code, _, err) = can(&stage.configuration, &["zero", "ALElbowAct", "--at", "0"]);
    assert!(code == Some(1) && err.contains("answer(s) are malformed"), "{err}");
}

#[test]
fn the_controller_of_the_readme_holds_the_robot_where_it_is() {
    let stage = Stage::of_long_times();
    let mut motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
    let _bridge = stage.bridge(Frontend::Python);
    let readme =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../client/python/README.md"))
            .unwrap();
    let mut scripts = readme.split("```python\n").filter_map(|rest| rest.split("```").next());
    let script = scripts.find(|script| script.contains("Controller(")).unwrap();
    let script = script.replace("Controller(", "Controller(\"end_to_end\", ");
    let _controller =
        Process::start("controller", stage.at_home(environment().command(&["-c", &script])));
    let mut all = |desired: &dyn Fn(&Value) -> bool| {
        motors.iter_mut().flat_map(Process::report).all(|motor| desired(&motor))
    };
    wait_for("power", || all(&|motor| motor["power"] == true).then_some(()));
    let end = Instant::now() + Duration::from_secs(1);
    while Instant::now() < end {
        assert!(all(&|motor| motor["power"] == true
            && motor["actuator_position"].as_f64().is_some_and(|position| position.abs() < 1e-3)));
    }
}

/// Moves the elbow there and back for this time, without confirmation.
fn direction(stage: &Stage, seconds: &str) -> Command {
    let mut command = environment().can(&[
        "direction",
        &stage.configuration,
        "ALElbowAct",
        "--distance",
        "0.01",
        "--stiffness",
        "20000",
    ]);
    command.args(["--damping", "2500", "--yes", "--seconds", seconds]);
    command
}

/// The elbow's report among the motors of its bus.
fn elbow(motors: &mut Process) -> Value {
    motors.report().remove(3)
}

#[test]
fn a_motor_is_not_moved_before_its_own_watchdog_is_known_to_be_on() {
    let stage = Stage::new();
    // its protocol cannot read the watchdog
    let text = std::fs::read_to_string(&stage.configuration)
        .unwrap()
        .replace("variant: damiao", "variant: mini_cheetah");
    std::fs::write(&stage.configuration, &text).unwrap();
    let motors = stage.motors("left");
    let output = direction(&stage, "0.2").output().unwrap();
    let reported = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{reported}");
    assert!(reported.contains("ALElbowAct gets no power: watchdog_unknown"), "{reported}");
    assert!(motors.said().iter().all(|event| event["event"] != "power"));
    // its owner has set it by other means and declares so
    std::fs::write(
        &stage.configuration,
        text.replace("  damping: 1\n", "  damping: 1\n  watchdog: believed\n"),
    )
    .unwrap();
    let output = direction(&stage, "0.2").output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(motors.said().iter().any(|event| event["event"] == "power" && event["value"] == true));
}

#[test]
fn a_motor_that_is_moved_loses_its_power_on_every_way_out() {
    let stage = Stage::new();
    let mut motors = stage.motors("left");
    for signals in [&["-INT"][..], &["-QUIT"], &["-TSTP"], &["-INT", "-TERM", "-HUP"]] {
        let mut moving = Process::start("direction", direction(&stage, "30"));
        wait_for("power", || (elbow(&mut motors)["power"] == true).then_some(()));
        signals.iter().for_each(|signal| moving.signal(signal));
        assert_eq!(moving.end().code(), Some(1), "{signals:?}");
        let elbow = elbow(&mut motors);
        assert!(elbow["power"] == false && elbow["tripped"] == false, "{signals:?}: {elbow}");
    }
    // its parent ends
    let inner = direction(&stage, "30");
    let mut shell = Command::new("sh");
    shell.args(["-c", "\"$@\" & wait", "sh"]).arg(inner.get_program()).args(inner.get_args());
    shell.envs(inner.get_envs().filter_map(|(name, value)| Some((name, value?))));
    let shell = Process::start("shell", shell);
    wait_for("power", || (elbow(&mut motors)["power"] == true).then_some(()));
    shell.signal("-KILL");
    let elbow =
        wait_for("no power", || Some(elbow(&mut motors)).filter(|elbow| elbow["power"] == false));
    assert_eq!(elbow["tripped"], false, "{elbow}");
}
