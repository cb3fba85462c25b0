//! One input log gives the same bytes in this process and in the replays of both frontends.

use std::process::{Command, Output};

use sarrus_tests::python::environment;
use serde_json::Value;

use super::harness::{BUSES, Frontend, N_U, Process, Stage, sarrus_can, wait_for};
use super::session::Session;

fn replay(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn both_fronts_give_the_bytes_of_the_library_for_one_log() {
    let stage = Stage::of_simulated_time();
    let mut session = Session::new(&stage.configuration, 5);
    session.play();
    assert!(session.frames.lines().count() > 10_000);
    let log = stage.folder.join("log.jsonl");
    std::fs::write(&log, &session.log).unwrap();
    let log = log.to_str().unwrap();
    let python = replay(environment().can(&["replay", &stage.configuration, log]));
    assert!(python == session.frames, "the replay in Python differs from the library");
    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, log]);
    assert!(replay(program) == session.frames, "the replay in Rust differs from the library");
    // a row each cycle; the last has the positions of the library
    let mut program = Command::new(sarrus_can());
    program.args(["log", &stage.configuration, log, "--csv"]);
    let table = replay(program);
    assert_eq!(table.lines().count(), session.log.matches("\"cycle\":true").count() + 1);
    let cells = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let [head, last] =
        [table.lines().next(), table.lines().last()].map(|line| cells(line.unwrap()));
    assert_eq!((head.len(), last.len()), (1 + 8 * N_U, 1 + 8 * N_U));
    let named = |end: &str| -> Vec<&str> {
        let pairs = head.iter().zip(&last).filter(|(name, _)| name.ends_with(end));
        pairs.map(|(_, cell)| cell.as_str()).collect()
    };
    let positions: Vec<f64> =
        named("/position").iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
    let same = |(a, b): (&f64, &f64)| a == b || a.is_nan() && b.is_nan();
    assert!(positions.iter().zip(&session.positions()).all(same), "{positions:?}");
    assert!(positions.iter().any(|x| x.is_finite()));
    assert_eq!(named("/reason").len(), N_U);
    // `sarrus.identify` reads the same columns from the table and from the log
    let path = stage.folder.join("table.csv");
    std::fs::write(&path, &table).unwrap();
    let script = "import sys\nimport numpy as np\nfrom sarrus import logs\n\
        ours = logs.replayed(*sys.argv[1:3])\n\
        theirs = logs.of_csv(sys.argv[3])\n\
        assert len(ours) > 4 and ours.keys() < theirs.keys(), theirs.keys()\n\
        for name, column in ours.items():\n    \
            if name.endswith('/state'):\n        \
                assert list(column) == theirs[name], name\n        \
                continue\n    \
            a, b = (logs.numbers(x, name) for x in (column, theirs[name]))\n    \
            b = b - b[0] if name == 'time' else b\n    \
            np.testing.assert_allclose(a, b, rtol=0, atol=2e-9 * (name == 'time'))\n";
    let arguments = ["-c", script, &stage.configuration, log, path.to_str().unwrap()];
    let output = environment().command(&arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_line_that_is_none_is_told_by_both_frontends_in_the_same_words() {
    let stage = Stage::new();
    let log = stage.folder.join("log.jsonl");
    let path = log.to_str().unwrap();
    for (line, word) in [
        ("[]", "no time"),
        ("{", "not JSON"),
        (r#"{"t": 1}"#, "says nothing"),
        (r#"{"t": -1, "cycle": true}"#, "no time"),
        (r#"{"t": 1.5, "cycle": true}"#, "no time"),
        (r#"{"t": Infinity, "cycle": true}"#, "not JSON"),
        (r#"{"t": 18446744073709551616, "cycle": true}"#, "no time"),
        (r#"{"t": 1, "frame": "1#", "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": "+12#00", "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": 5, "bus": "left"}"#, "frame"),
        (r#"{"t": 1, "frame": "123#00", "bus": "none"}"#, "none"),
        (r#"{"t": 1, "frame": "123#00"}"#, "no bus"),
        (r#"{"t": 1, "operate": "dance"}"#, "no such operation"),
        (r#"{"t": 1, "event": "rain", "bus": "left"}"#, "no such event"),
        (r#"{"t": 1, "event": "dropped", "count": -1, "bus": "left"}"#, "`count`"),
        (r#"{"t": 1, "event": "dropped", "count": 4294967296, "bus": "left"}"#, "`count`"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": [NaN]}}"#, "not JSON"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": ["1"]}}"#, "`position`"),
        (r#"{"t": 1, "command": {"sequence": 1, "position": 1}}"#, "`position`"),
        (r#"{"t": 1, "command": {"sequence": -1}}"#, "`sequence`"),
        (r#"{"t": 1, "command": {"torque": [1]}}"#, "`torque`"),
        (r#"{"t": 1, "command": null}"#, "no mapping"),
    ] {
        std::fs::write(&log, format!("{}\n\n{line}\n", r#"{"t": 0, "cycle": true}"#)).unwrap();
        let python = environment().can(&["replay", &stage.configuration, path]).output().unwrap();
        let rust = Command::new(sarrus_can())
            .args(["replay", &stage.configuration, path])
            .output()
            .unwrap();
        let text = |output: &Output| String::from_utf8(output.stderr.clone()).unwrap();
        assert_eq!(
            (python.status.code(), rust.status.code()),
            (Some(1), Some(1)),
            "{line}: {}{}",
            text(&python),
            text(&rust)
        );
        let rust = text(&rust);
        assert!(
            rust.starts_with(&format!("{path}:3:1: ")) && rust.contains(word),
            "{line}: {rust}"
        );
        assert_eq!(text(&python), format!("sarrus.can: {rust}"), "{line}");
    }
    // missing lists are zeros
    let line = r#"{"t": 1, "command": {"sequence": 1, "stamp_ns": 1}}"#;
    std::fs::write(&log, format!("{line}\n{}\n", r#"{"t": 2, "cycle": true}"#)).unwrap();
    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, path]);
    let frames = replay(program);
    assert!(!frames.is_empty());
    assert_eq!(replay(environment().can(&["replay", &stage.configuration, path])), frames);
    // a file that is not text is refused
    std::fs::write(&log, b"\xFF\xFE\n").unwrap();
    let python = environment().can(&["replay", &stage.configuration, path]).output().unwrap();
    let rust =
        Command::new(sarrus_can()).args(["replay", &stage.configuration, path]).output().unwrap();
    assert_eq!((python.status.code(), rust.status.code()), (Some(2), Some(2)));
}

#[test]
fn a_run_that_was_logged_sends_the_same_frames_when_it_is_replayed() {
    let stage = Stage::new();
    let mut motors: Vec<Process> = BUSES.iter().map(|(bus, _)| stage.motors(bus)).collect();
    let log = stage.folder.join("run.jsonl");
    let recording = stage.folder.join("run.log");
    let log = log.to_str().unwrap();
    let recording = recording.to_str().unwrap();
    let mut command = stage.bridge_command(Frontend::Python);
    command.args(["--log", log, "--record", recording]);
    let mut bridge = Process::start("bridge", command);
    assert!(bridge.line().starts_with("ready "));
    let mut controller = stage.controller();
    let mut powered = |desired: bool| {
        wait_for("power", || {
            motors
                .iter_mut()
                .flat_map(Process::report)
                .all(|motor| motor["power"] == desired)
                .then_some(())
        });
    };
    controller.tell("arm");
    powered(true);
    controller.tell("nan 3");
    powered(false);
    controller.tell("good");
    controller.tell("arm");
    powered(true);
    controller.tell("disarm");
    powered(false);
    bridge.signal("-INT");
    assert_eq!(bridge.end().code(), Some(0));

    let mut program = Command::new(sarrus_can());
    program.args(["replay", &stage.configuration, log]);
    let replayed = replay(program);
    assert!(
        replay(environment().can(&["replay", &stage.configuration, log])) == replayed,
        "the frontends differ"
    );
    let sent = std::fs::read_to_string(recording).unwrap();
    let logged = std::fs::read_to_string(log).unwrap();
    let logged: Vec<Value> =
        logged.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    for (bus, actuators) in BUSES {
        // `(time) bus frame`, and in a recording also the direction
        let of_bus = |line: &str| line.split(' ').skip(1).map(str::to_owned).collect::<Vec<_>>();
        let frames = |text: &str, goes: bool| -> Vec<String> {
            let lines = text.lines().map(of_bus).filter(|line| line[0] == bus);
            lines
                .filter(|line| line.get(2).is_none_or(|way| (way == "T") == goes))
                .map(|mut line| line.swap_remove(1))
                .collect()
        };
        let replayed = frames(&replayed, true);
        let sent = frames(&sent, true);
        assert!(replayed.len() > 100 * actuators.len(), "{bus}: {} frames", replayed.len());
        // a bus that is late drops frames of older cycles, and the log counts them
        let is_dropped = |line: &&Value| line["event"] == "dropped" && line["bus"] == bus;
        let dropped = logged.iter().filter(is_dropped).filter_map(|line| line["count"].as_u64());
        let mut sent = sent.iter().peekable();
        let missing = replayed.iter().filter(|frame| sent.next_if_eq(frame).is_none()).count();
        assert!(missing as u64 <= dropped.sum::<u64>(), "{bus}: {missing} frames are missing");
        // only shutdown frames follow the last cycle
        assert!(sent.peek().is_some(), "{bus}");
        assert!(sent.all(|frame| frame.ends_with("#FFFFFFFFFFFFFFFD")), "{bus}");
    }
}
