//! SocketCAN of a real kernel: Linux in a process of its own (user-mode Linux), which reads this
//! computer's files and has the CAN modules.
//!
//! The tests are skipped with a message where `linux.uml`, `busybox`, `cansend`, `candump`,
//! `cangen`, `slcand`, `ip` or `cc` are missing: on Debian `apt-get install user-mode-linux
//! busybox-static can-utils iproute2 gcc`. The clock has a resolution of 10 ms, so the tests check
//! results and never times.

use std::os::unix::process::CommandExt;
use std::process::{Command, Stdio};

use sarrus_tests::python::environment;
use serde_json::Value;

use super::harness::{Allowance, FRONTENDS, Frontend, Stage, sarrus_can};

/// Completes the processor state for a kernel older than the processor.
const WHOLE_STATE: &str = include_str!("whole_state.c");
/// Start of the virtual machine's first process.
const START: &str = include_str!("start.sh");

const TOOLS: [&str; 8] =
    ["linux.uml", "busybox", "cansend", "candump", "cangen", "slcand", "ip", "cc"];

const MIT: &str = "offset: 0, limits: {position: [-9, 9], effort: 10, velocity: 5}, watchdog_ms: WATCHDOG, watchdog: \
    believed, drive: {protocol: mit, \
    variant: robstride, id: 3, reply_id: 19, position_range: 12.5, velocity_range: 30, \
    torque_range: 10, stiffness_range: 500, \
    damping_range: 5}";
const MOTEUS: &str = "offset: 0, limits: {position: [-9, 9], effort: 1, velocity: 5}, watchdog_ms: 1000, drive: \
    {protocol: moteus, id: 1}";
/// Script of a bridge on a bus that goes away.
const BRIDGE: &str = include_str!("bridge.sh");
/// Frame that takes the power of a RobStride away.
const DISABLE: &str = "003#FFFFFFFFFFFFFFFD";

#[test]
fn frames_states_and_full_queues_of_a_real_kernel() {
    let Some(said) = boot(Frontend::Rust, include_str!("frames.sh")) else { return };
    let step = |name: &str| step(&said, name);

    // classic and FD frames pass, in both directions
    assert!(step("enable").contains("vcan0 003#FFFFFFFFFFFFFFFC"), "{said}");
    assert!(step("enable").contains("vcan0 013#037FFF"), "{said}");
    for expected in [
        "vcan0 003#FFFFFFFFFFFFFFFC",
        "vcan0 013#037FFF",
        "vcan0 1ABCDEF0##10011223344556677",
        "\"event\":\"power\"",
    ] {
        assert!(step("heard").contains(expected), "{expected}:\n{said}");
    }
    // a classic bus refuses FD and a missing interface cannot be opened
    assert!(
        step("classic").contains("carries no CAN FD")
            && step("classic").contains("none cannot be opened"),
        "{said}"
    );
    assert_eq!(step("classic").matches("code 2").count(), 2, "{said}");
    // the kernel's error frames
    for state in ["ErrorWarning", "ErrorPassive", "ErrorActive", "BusOff"] {
        assert!(step("states").contains(state), "{state}:\n{said}");
    }
    // a full queue drops frames and does not stop the sender
    let report = reports(step("full")).pop().unwrap_or_else(|| panic!("{said}"));
    let bus = &report["buses"][0];
    assert!(bus["sent"].as_u64().unwrap() > 0 && bus["lost"].as_u64().unwrap() > 4, "{said}");
    assert!(said.contains("ENOBUFS"), "{said}");
    assert!(said.contains("step end"), "{said}");
}

#[test]
fn the_bridge_outlives_a_bus_that_goes_away_and_arms_only_when_it_is_told() {
    for frontend in FRONTENDS {
        let Some(said) = boot(frontend, BRIDGE) else { return };
        let said = Said(said);
        // SIGTERM takes the power away
        said.has("power", "enabled\ncode 0");
        said.powers("power", true);
        said.has("term", "code 0");
        said.powers("term", false);
        let Said(text) = &said;
        assert!(
            reports(step(text, "term"))
                .iter()
                .all(|report| report["motors"][0]["tripped"] == false),
            "{frontend:?} {text}"
        );
        // down and up, removed and added, bus-off by error frames
        for (gone, back, again) in
            [("down", "up", "reset"), ("removed", "removed", "added"), ("told", "told", "told")]
        {
            said.refused(gone, "bus_off");
            said.refused(back, "bus_off");
            assert!(
                reports(step(text, back))
                    .iter()
                    .any(|report| report["motors"][0]["frame"] == DISABLE),
                "{frontend:?} {back}:\n{text}"
            );
            said.has(again, "reset\nenabled\ncode 0");
        }
        said.powers("reset", true);
        said.powers("added", true);
        said.powers("up", false);
        said.powers("told", false);
        assert!(text.contains("step end"), "{frontend:?} {text}");
    }
}

#[test]
fn bit_rates_and_states_of_a_controller_are_compared_before_the_bridge_begins() {
    // the functions of the other script, without its steps
    let functions = BRIDGE.split("echo \"step").next().unwrap_or_default();
    for frontend in FRONTENDS {
        let Some(said) = boot(frontend, &(functions.to_owned() + include_str!("rates.sh"))) else {
            return;
        };
        let said = Said(said);
        // compares the kernel's bit rate, and refuses a bus that is down, off or passive
        said.has(
            "rate",
            "slcan0 is down: `ip link set slcan0 up type can bitrate 1000000`\ncode 2",
        );
        said.has("rate", "slcan0 has a bit rate of 500000 bit/s, expected 1000000");
        said.has(
            "rate",
            "`ip link set slcan0 down`, then `ip link set slcan0 up type can bitrate \
            1000000`\ncode 2",
        );
        said.has(
            "rate",
            "bus_passive; 0 of 1 actuators have power; given up after 1 s and disarmed\n",
        );
        said.has("same", "enabled\ncode 0");
        said.powers("same", true);
        // the kernel's own bus-off, after which only the motors' watchdogs remain
        said.refused("off", "bus_off");
        said.has("off", "slcan0 is bus-off");
        said.has("off", "code 2");
        said.refused("on", "bus_off");
        let Said(text) = &said;
        assert!(
            reports(step(text, "on")).iter().any(|report| report["motors"][0]["frame"] == DISABLE),
            "{text}"
        );
        said.has("on", "reset\nenabled\ncode 0");
        said.powers("on", true);
        said.has("last", "code 0");
        said.powers("last", false);
        assert!(text.contains("step end"), "{frontend:?} {text}");
    }
}

/// Output of a kernel, split by steps.
struct Said(String);

impl Said {
    fn has(&self, name: &str, expected: &str) {
        assert!(step(&self.0, name).contains(expected), "{name}, {expected}:\n{}", self.0);
    }

    fn refused(&self, name: &str, reason: &str) {
        // on a busy machine a motor may be late before its bus is off, which the bridge names first
        self.has(name, "the bridge is fault: ");
        self.has(name, "; 0 of ");
        self.has(name, &format!("fault: {reason};"));
        self.has(name, "actuators have power\n");
        self.has(name, "code 1");
    }

    /// Checks the last report of a step: all motors have power, or all are without it since the
    /// bridge's frame.
    fn powers(&self, name: &str, power: bool) {
        let said = &self.0;
        let report = reports(step(said, name))
            .pop()
            .unwrap_or_else(|| panic!("no report in {name}:\n{said}"));
        for motor in report["motors"].as_array().unwrap() {
            assert_eq!(motor["power"], power, "{name}: {motor}\n{said}");
            assert_eq!(motor["setpoint"].is_object(), power, "{name}: {motor}\n{said}");
        }
        let heard = report["motors"][0]["frame"].as_str().unwrap();
        assert_eq!(heard == DISABLE, !power, "{name}: {heard}\n{said}");
    }
}

/// Output of one step.
fn step<'a>(said: &'a str, name: &str) -> &'a str {
    let from = said
        .split(&format!("step {name}\n"))
        .nth(1)
        .unwrap_or_else(|| panic!("no step {name}:\n{said}"));
    from.split("step ").next().unwrap_or_default()
}

/// Reports of simulated motors among lines.
fn reports(lines: &str) -> Vec<Value> {
    lines
        .lines()
        .filter_map(|line| serde_json::from_str(line).ok())
        .filter(|value: &Value| value["event"] == "report")
        .collect()
}

fn find(tool: &str) -> Option<std::path::PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders = std::env::split_paths(&path).chain(["/usr/sbin".into(), "/sbin".into()]);
    folders.map(|folder| folder.join(tool)).find(|path| path.exists())
}

/// A command with its environment as text for a shell.
fn words(command: &Command) -> String {
    let word = |text: &std::ffi::OsStr| format!("'{}'", text.to_string_lossy());
    let set = command
        .get_envs()
        .filter_map(|(name, value)| Some(format!("{}={}", name.to_string_lossy(), word(value?))));
    let arguments = std::iter::once(command.get_program()).chain(command.get_args()).map(word);
    std::iter::once("env".to_owned()).chain(set).chain(arguments).collect::<Vec<_>>().join(" ")
}

/// Boots a kernel that runs a script and ends, and returns its output; `None` if tools are missing.
fn boot(frontend: Frontend, script: &str) -> Option<String> {
    let missing: Vec<&str> = TOOLS.into_iter().filter(|tool| find(tool).is_none()).collect();
    if !missing.is_empty() {
        eprintln!(
            "NOT RUN: the test of SocketCAN in a real kernel, for want of {}",
            missing.join(", ")
        );
        return None;
    }
    let stage = Stage::new();
    let path = |name: &str| stage.folder.join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).unwrap();
    // the kernel has one processor and may be seconds late
    let bus = |interface: &str, channel: &str, more: &str| {
        let times = "rate_hz: 50\nramp_ms: 200\nmonitors: {late_ms: off, second_answer: off}\n\
            timeouts: {damping_ms: 1000, disable_ms: 4000, feedback_ms: 3500, arming_ms: 10000}\n";
        format!(
            "{times}buses: [{{name: arm, interface: {interface}, channel: {channel}, bitrate: \
                1000000{more}}}]\nmotors:\n"
        )
    };
    let motor =
        |actuator: &str, text: &str| format!("- {{actuator: {actuator}, bus: arm, {text}}}\n");
    // a bridge that loses its bus leaves the motors with power; on the bus that is off their
    // watchdogs take it away
    let [slow, quick] =
        ["10000", "1000"].map(|watchdog| motor("elbow", &MIT.replace("WATCHDOG", watchdog)));
    write(
        "vcan.yml",
        &(bus("socketcan", "vcan0", ", data_bitrate: 5000000") + &slow + &motor("wrist", MOTEUS)),
    );
    write("slcan.yml", &(bus("slcan", &path("bus").display().to_string(), "") + &quick));
    write("kernel.yml", &(bus("socketcan", "slcan0", "") + &quick));
    write("whole_state.c", WHOLE_STATE);
    let tool = |name: &str| find(name).unwrap().display().to_string();
    let program = |path: &std::path::Path| path.display().to_string();
    let init = format!("{START}{script}$B poweroff -f\n");
    let init = init
        .replace("BUSYBOX", &tool("busybox"))
        .replace("IPROUTE", &tool("ip"))
        .replace("PROGRAM", &program(sarrus_can()));
    let bridging = match frontend {
        Frontend::Rust => Command::new(sarrus_can()),
        Frontend::Python => environment().can(&[]),
    };
    let init = init
        .replace("FRONTEND", &words(&bridging))
        .replace("HOLD", &program(&sarrus_can().with_file_name("examples/hold")));
    write("init", &init.replace("FOLDER", stage.folder.to_str().unwrap()));
    let executable = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(path("init"), executable).unwrap();
    let library = path("whole_state.so");
    let built = Command::new("cc")
        .args(["-O2", "-shared", "-fPIC", "-o"])
        .arg(&library)
        .arg(path("whole_state.c"))
        .status();
    assert!(built.unwrap().success());

    let mut kernel = Command::new(find("linux.uml").unwrap());
    kernel.args([
        "mem=512M",
        "rootfstype=hostfs",
        "rootflags=/",
        "rw",
        "con=null",
        "con0=fd:0,fd:1",
        "ssl=null",
        "quiet",
    ]);
    kernel.arg(format!("init={}", path("init").display())).env("LD_PRELOAD", &library);
    if std::path::Path::new("/dev/shm").is_dir() {
        kernel.env("TMPDIR", "/dev/shm");
    }
    // into a file: a killed kernel leaves processes behind that keep a pipe open
    let said = std::fs::File::create(path("said")).unwrap();
    let mut child = kernel
        .stdin(Stdio::null())
        .stdout(said)
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()
        .unwrap();
    // ends a kernel that hangs, whose output then names the place
    for _ in 0..16 {
        let mut allowance = Allowance::new();
        while child.try_wait().unwrap().is_none() && allowance.pause() {}
    }
    if child.try_wait().unwrap().is_none() {
        let group = format!("-{}", child.id());
        let _ = Command::new("kill").args(["-KILL", "--", &group]).status();
        let _ = child.wait();
    }
    Some(String::from_utf8_lossy(&std::fs::read(path("said")).unwrap()).replace('\r', ""))
}
