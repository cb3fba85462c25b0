//! `sarrus-can simulate` over a pseudo-terminal, spoken to byte by byte as the manuals of slcan and
//! MIT mode have it.

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::allowance::{slowness, wait_for};
use super::{Folder, Host, Program};

const MOTOR: &str = "{actuator: elbow, bus: arm, sign: -1, gear: 10, offset: 0.5, watchdog_ms: \
    1000, watchdog: believed, limits: {position: [-9, 9], velocity: 50, effort: 10}, \
    drive: {protocol: mit, variant: mini_cheetah, id: 3, reply_id: 19, position_range: 12.5, \
    velocity_range: 30, torque_range: 10, \
    stiffness_range: 500, damping_range: 5}}";
const POWER_ON: &str = "t0038FFFFFFFFFFFFFFFC";
const POWER_OFF: &str = "t0038FFFFFFFFFFFFFFFD";
/// Position 2 rad (code 38010), velocity 0, stiffness 50 (code 409), damping 1 (code 819), torque
/// 0.
const HOLD_2_RAD: &str = "t0038947A7FF199333800";
/// `HOLD_2_RAD` with damping 5.
const HOLD_2_RAD_DAMPED: &str = "t0038947A7FF199FFF800";

fn simulate(folder: &Folder, motors: &[&str], more: &[&str]) -> Program {
    let configuration = folder.configuration(motors);
    let arguments = [&["simulate", configuration.to_str().unwrap(), "--pty"], more].concat();
    let program = Program::start(&arguments);
    assert_eq!(program.line(), format!("ready arm {}", folder.path("bus").display()));
    program
}

#[test]
fn a_motor_is_enabled_follows_and_goes_safe_by_itself() {
    let folder = Folder::new();
    // a watchdog that no pause of this machine trips
    let watchdog_ms = (1000.0 * slowness()).clamp(1000.0, 10_000.0) as u64;
    let motor = MOTOR.replace("watchdog_ms: 1000", &format!("watchdog_ms: {watchdog_ms}"));
    let mut motors = simulate(&folder, &[&motor], &[]);
    let mut host = Host::opened(&folder.path("bus"));
    assert_eq!(&host.ask(HOLD_2_RAD)[..7], "t013703");
    assert_eq!(motors.report()["power"], false);

    // set-points until it is there
    assert_eq!(&host.ask(POWER_ON)[..7], "t013703");
    assert_eq!(motors.event("power")["value"], true);
    wait_for("the motor at 2 rad", || {
        let last = host.ask(HOLD_2_RAD);
        let code = u32::from_str_radix(&last[7..11], 16).unwrap();
        ((f64::from(code) / 65535.0 * 25.0 - 14.5).abs() < 0.01).then_some(())
    });
    // and until it has stopped swinging about it
    for _ in 0..100 {
        host.ask(HOLD_2_RAD);
        std::thread::sleep(Duration::from_millis(2));
    }
    let silent = motors.report();
    let first = motors.event("first_setpoint");
    assert!((first["value"]["position"].as_f64().unwrap() - 2.0).abs() < 2e-4, "{first}");
    assert_eq!(silent["frame"], "003#947A7FF199333800");
    assert!((silent["setpoint"]["position"].as_f64().unwrap() - 2.0).abs() < 2e-4, "{silent}");
    assert!((silent["setpoint"]["stiffness"].as_f64().unwrap() - 50.0).abs() < 0.07, "{silent}");
    assert!((silent["actuator_position"].as_f64().unwrap() - 0.3).abs() < 1e-3, "{silent}");

    // then none
    let tripped = motors.event("watchdog");
    let heard =
        silent["t"].as_u64().unwrap() as f64 - silent["frame_age_ms"].as_f64().unwrap() * 1e6;
    let took_ms = (tripped["t"].as_u64().unwrap() as f64 - heard) * 1e-6;
    assert!(took_ms >= watchdog_ms as f64, "{took_ms}");
    let report = motors.report();
    assert_eq!(report["tripped"], true);
    assert_eq!(report["setpoint"]["stiffness"], 0.0, "{report}");
    host.ask(POWER_OFF);
    assert_eq!(motors.event("power")["value"], false);
}

#[test]
fn hosts_come_and_go_and_the_link_goes_with_the_motors() {
    let folder = Folder::new();
    let motors = simulate(&folder, &[MOTOR], &[]);
    for _ in 0..3 {
        let mut host = Host::opened(&folder.path("bus"));
        assert_eq!(&host.ask(POWER_OFF)[..7], "t013703");
        host.write("C\r");
    }
    let pid = motors.child.id();
    assert!(
        std::process::Command::new("kill")
            .args(["-TERM", &pid.to_string()])
            .status()
            .unwrap()
            .success()
    );
    wait_for("the end of the link", || {
        folder.path("bus").symlink_metadata().is_err().then_some(())
    });
}

#[test]
fn every_signal_but_faults_ends_the_bridge_in_order() {
    let folder = Folder::new();
    let configuration = folder.configuration(&[MOTOR]).display().to_string();
    let _motors = simulate(&folder, &[MOTOR], &[]);
    for signal in ["TERM", "ABRT", "TRAP", "SYS", "STKFLT", "34", "64"] {
        let mut bridge = Program::start(&["run", &configuration, "--name", "ends"]);
        assert!(bridge.line().starts_with("ready "), "{signal}");
        let process = bridge.child.id().to_string();
        let sent =
            std::process::Command::new("kill").args([&format!("-{signal}"), &process]).status();
        assert!(sent.unwrap().success());
        assert_eq!(bridge.child.wait().unwrap().code(), Some(0), "{signal}");
    }
    // opening a FIFO without a reader would wait for one
    let fifo = folder.path("fifo");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let log = ["run", &configuration, "--name", "ends", "--log", fifo.to_str().unwrap()];
    let (code, _, err) = crate::commission::sarrus_can(&log);
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("is a FIFO, expected a file"), "{err}");
}

#[test]
fn an_adapter_answers_and_refuses_as_the_manual_says() {
    let folder = Folder::new();
    let _motors = simulate(&folder, &[MOTOR], &[]);
    let mut host = Host::open(&folder.path("bus"));
    assert_eq!(host.ask("V"), "V1013");
    assert_eq!(host.ask("N"), "NSARR");
    assert_eq!(host.ask("F"), "F00");
    assert_eq!(host.ask(POWER_ON), "bell", "the channel is closed");
    host.write("S8\rO\r");
    assert_eq!(host.ask("S8"), "bell", "the channel is open");
    assert_eq!(host.ask("t0039"), "bell");
    assert_eq!(host.ask(&"t".repeat(10_000)), "bell");
    assert_eq!(&host.ask(POWER_OFF)[..7], "t013703");
    // another motor's frame is nobody's here
    host.write("t0048FFFFFFFFFFFFFFFC\r");
    assert!(host.is_silent(Duration::from_millis(50)));
}

#[test]
fn mischief_is_done_on_demand() {
    let folder = Folder::new();
    let mut motors = simulate(&folder, &[MOTOR], &["--fault", "silence elbow on"]);
    let mut host = Host::opened(&folder.path("bus"));
    let now = |motors: &mut Program, line: &str| {
        motors.tell(line);
        motors.report();
    };
    host.write(&format!("{POWER_ON}\r"));
    assert!(host.is_silent(Duration::from_millis(50)));
    assert_eq!(motors.report()["power"], true, "a silent motor still hears");

    now(&mut motors, "silence elbow off");
    now(&mut motors, "wrong_id elbow on");
    assert_eq!(&host.ask(POWER_OFF)[..7], "t213703");
    now(&mut motors, "wrong_id elbow off");
    now(&mut motors, "loss 1");
    host.write(&format!("{POWER_ON}\r"));
    assert!(host.is_silent(Duration::from_millis(50)));
    assert_eq!(motors.report()["power"], false, "what is lost is not heard");

    now(&mut motors, "loss 0");
    now(&mut motors, "delay 60");
    let asked = Instant::now();
    assert_eq!(&host.ask(POWER_OFF)[..7], "t013703");
    assert!(asked.elapsed() >= Duration::from_millis(60));
    now(&mut motors, "delay 0");
    now(&mut motors, "busoff");
    assert_eq!(host.line(), "sb000255");
    assert_eq!(host.ask(POWER_ON), "bell");
    now(&mut motors, "active");
    assert_eq!(host.line(), "sa000000");
    assert_eq!(&host.ask(POWER_ON)[..7], "t013703");
    motors.tell("fault elbow 5");
    assert_eq!(motors.event("fault")["value"], 5);
    assert_eq!(motors.report()["power"], false);
}

#[test]
fn a_robot_moves_behind_its_motors() {
    let folder = Folder::new();
    let urdf = "<robot name=\"pendulum\"><link name=\"base\"/><link \
        name=\"rod\"><inertial><origin xyz=\"1 0 0\"/><mass value=\"1\"/>\
        <inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial></link>\
        <joint name=\"elbow\" type=\"revolute\"><parent link=\"base\"/><child link=\"rod\"/><axis \
        xyz=\"0 1 0\"/>\
        <limit lower=\"-6\" upper=\"6\" effort=\"20\" velocity=\"10\"/></joint></robot>";
    std::fs::write(folder.path("pendulum.urdf"), urdf).unwrap();
    let configuration = folder.configuration(&[&MOTOR
        .replace("sign: -1, gear: 10, offset: 0.5", "gear: 1, offset: 0")
        .replace("watchdog_ms: 1000", "watchdog_ms: 10000")]);
    let text = std::fs::read_to_string(&configuration).unwrap();
    std::fs::write(&configuration, format!("urdf: pendulum.urdf\n{text}")).unwrap();
    let mut motors = Program::start(&[
        "simulate",
        configuration.to_str().unwrap(),
        "--pty",
        "--dynamics",
        "robot",
    ]);
    assert!(motors.line().starts_with("ready arm "));
    let mut host = Host::opened(&folder.path("bus"));
    let held = motors.report()["actuator_position"].as_f64().unwrap();
    assert!(held.abs() < 1e-3, "it is on its stand until it first has power: {held}");

    // stiffness alone would hold at 2 rad; gravity, 9.81 N m cos q, pulls the rod down from there
    host.ask(POWER_ON);
    wait_for("the rod at rest where spring and gravity balance", || {
        host.ask(HOLD_2_RAD_DAMPED);
        let report = motors.report();
        let number = |key: &str| report[key].as_f64().unwrap();
        let position = number("actuator_position");
        let velocity = number("actuator_velocity");
        let balance = 50.0 * (2.0 - position) + 9.81 * position.cos();
        let is_balanced = (position - 2.0).abs() > 0.02 && balance.abs() < 0.2;
        (is_balanced && velocity.abs() < 1e-3).then_some(())
    });

    // without power it is limp: it falls and swings
    let position = motors.report()["actuator_position"].as_f64().unwrap();
    host.ask(POWER_OFF);
    wait_for("a fall", || {
        let now = motors.report()["actuator_position"].as_f64().unwrap();
        ((now - position).abs() > 0.3).then_some(())
    });
}

#[test]
fn in_the_background_of_a_terminal_nothing_is_read_and_motors_go_on() {
    if Command::new("script").arg("--version").output().is_err() {
        return println!("not run: script is missing (Debian: bsdutils)");
    }
    let folder = Folder::new();
    let configuration = folder.configuration(&[MOTOR]);
    // a shell with jobs on a terminal of its own, as somebody types it
    let program = env!("CARGO_BIN_EXE_sarrus-can");
    let job = format!("{program} simulate {} --pty & read; kill %1", configuration.display());
    let shell = format!("bash --norc -ic '{job}'");
    let mut script = Command::new("script");
    script.args(["-qec", &shell, "/dev/null"]).stdin(Stdio::piped()).stdout(Stdio::null());
    let mut script = script.spawn().unwrap();
    wait_for("the bus", || folder.path("bus").exists().then_some(()));
    let mut host = Host::opened(&folder.path("bus"));
    for _ in 0..3 {
        assert_eq!(&host.ask(HOLD_2_RAD)[..7], "t013703");
        std::thread::sleep(Duration::from_millis(200));
    }
    // a line is the shell's, which then ends the motors
    writeln!(script.stdin.as_mut().unwrap()).unwrap();
    assert!(script.wait().unwrap().success());
}
