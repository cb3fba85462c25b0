//! The Python package by its own tests, and what it says of itself.

use sarrus_tests::python::environment;

use super::harness::Stage;

#[test]
fn the_package_loads_and_has_the_protocols_of_the_core() {
    let script = "import sarrus, sarrus.can as can; print(sarrus.__version__); print(*[p['name'] for p in can.protocols()])";
    let output = environment().command(&["-c", script]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let names: Vec<&str> = sarrus_can::protocol::PROTOCOLS.iter().map(|protocol| protocol.name).collect();
    let text = format!("{}\n{}\n", env!("CARGO_PKG_VERSION"), names.join(" "));
    assert_eq!(String::from_utf8(output.stdout).unwrap(), text);
}

#[test]
fn its_own_tests_pass() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../client/python/tests");
    let output = environment().command(&["-W", "error", "-m", "unittest", "discover", "--start-directory", folder]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let count = told.lines().find_map(|line| line.strip_prefix("Ran ")?.split(' ').next()?.parse::<usize>().ok());
    assert!(count > Some(15) && !told.contains("skipped"), "{told}");
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
        out.lines().find_map(|line| line.split_whitespace().skip(1).collect::<Vec<_>>().join(" ").strip_prefix(name).map(str::to_owned))
    };
    assert_eq!((row("PMAX ").as_deref(), row("power ").as_deref()), (Some("12.5 rad"), Some("off")), "{out}");
    assert_eq!((row("Gr ").as_deref(), row("UV_Value ").as_deref()), (Some("10"), Some("15 V")), "{out}");
    let (code, out, err) = can(&["zero", "ALElbowAct", "--at", "0.05"]);
    assert_eq!((code, err.as_str()), (Some(0), ""), "{out}");
    let offset: f64 = out.strip_prefix("offset: ").unwrap().trim().parse().unwrap();
    assert!((offset - 0.05).abs() < 1e-4, "{out}");
    // nobody said yes: nothing moves
    let motion = ["direction", "ALElbowAct", "--distance", "0.01", "--stiffness", "20000", "--damping", "2500", "--seconds", "0.5"];
    let (code, out, err) = can(&motion);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(err.contains("not confirmed") && out.contains("emergency stop"), "{out}{err}");
    assert!(motors.said().iter().all(|event| event["event"] != "power"));
    let (code, out, err) = can(&[&motion[..], &["--yes"]].concat());
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("% of the distance"), "{out}");
    let events: Vec<_> = motors.said().into_iter().filter(|event| event["event"] == "power").collect();
    assert_eq!(events.iter().map(|event| event["value"] == true).collect::<Vec<_>>(), [true, false], "{events:?}");
    let (code, out, err) = can(&["zero", "ALElbowAct", "--yes"]);
    assert_eq!(code, Some(0), "{out}{err}");
    // flags and files
    assert_eq!(can(&["scan", "Elbow"]).0, Some(2));
    assert_eq!(can(&["direction", "ALElbowAct", "--distance", "0", "--stiffness", "1", "--damping", "1"]).0, Some(2));
    let (code, _, err) = can(&["scan", "BodyYaw"]);
    assert_eq!(code, Some(2), "{err}");
    let missing = environment().can(&["run", "/nothing/robot.yml"]).output().unwrap();
    assert_eq!(missing.status.code(), Some(2));
}
