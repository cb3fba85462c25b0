//! The rules with every protocol that has a simulated motor, in this process: nothing allocates,
//! and both sides of the mapping have the same power.

use sarrus_can_core::bridge::{Bridge, CommandVerdict};
use sarrus_can_core::config::{Configuration, Surroundings};
use sarrus_can_core::drive::Measurement;
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::mapping::{ActuatorSetpoint, Mapping};
use sarrus_can_sim::{Physics, Simulated};
use sarrus_models::{LoadError, Options, Source, load};
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Operation, Reason};
use sarrus_tests::seed::Seeded;

use crate::allocation::calls;

const MS: u64 = 1_000_000;

/// One motor of each protocol, each on a bus of its own.
const ONE_OF_EACH: [(&str, &str); 9] = [
    (
        "mit",
        "variant: damiao, id: 1, reply_id: 17, position_range: 12.5, velocity_range: 30, \
            torque_range: 10, stiffness_range: 500, damping_range: 5",
    ),
    ("cybergear", "id: 10, position_range: 12.5"),
    ("odrive", "node: 3, watchdog_timeout_endpoint: 300, enable_watchdog_endpoint: 301"),
    ("moteus", "id: 1"),
    ("cia402", "node: 5, rated_torque: 2.0, counts_per_turn: 65536"),
    ("rmd", "id: 2, motor_torque_constant: 2"),
    ("vesc", "id: 23, motor_torque_constant: 0.1, pole_pairs: 7"),
    ("ak_servo", "id: 6, motor_torque_constant: 1, pole_pairs: 21, reduction: 9"),
    (
        "dbc",
        "file: motor.dbc, enable: Set.Power, torque: Set.Torque, measured_position: Is.Turn, \
            measured_velocity: Is.Speed, enabled: Is.Power",
    ),
];

const DBC_FILE: &str = r#"BO_ 32 Set: 8 Host
 SG_ Power : 0|1@1+ (1,0) [0|1] "" Motor
 SG_ Torque : 23|16@0- (0.001,0) [0|0] "Nm" Motor
BO_ 33 Is: 8 Motor
 SG_ Power : 0|1@1+ (1,0) [0|1] "" Host
 SG_ Turn : 8|24@1- (0.0001,0) [0|0] "rad" Host
 SG_ Speed : 32|16@1- (0.01,0) [0|0] "rad/s" Host
"#;

fn configuration() -> Configuration {
    let mut text = "rate_hz: 500\nramp_ms: 50\ntimeouts: {feedback_ms: 50}\nbuses:\n".to_owned();
    for (name, _) in ONE_OF_EACH {
        text += &format!("- {{name: {name}, channel: {name}, data_bitrate: 5000000}}\n");
    }
    text += "motors:\n";
    for (name, keys) in ONE_OF_EACH {
        text += &format!(
            "- actuator: {name}\n  bus: {name}\n  drive: {{protocol: {name}, {keys}}}\n  sign: \
                -1\n  gear: 2\n  offset: 0.1\n"
        );
        text += "  limits: {position: [-9, 9], effort: 2, velocity: 5}\n  damping: 0.1\n  watchdog_ms: 100\n";
        if matches!(name, "vesc" | "ak_servo" | "dbc") {
            text += "  watchdog: believed\n";
        }
    }
    let file = |_: &str| Ok(DBC_FILE.to_owned());
    let robot = |_: &_| Err(LoadError::Open("robot".into(), "absent".into()));
    Configuration::read("each.yml", text.into_bytes(), &Surroundings { file: &file, robot: &robot })
        .unwrap_or_else(|report| panic!("{report}"))
}

#[test]
fn a_cycle_allocates_nothing_whatever_the_protocol_and_whatever_happens() {
    let config = configuration();
    let physics = Physics { inertia: 0.01, friction: 0.01, torque_limit: f64::INFINITY };
    let mut motors: Vec<Simulated> = config
        .motors
        .iter()
        .map(|motor| {
            Simulated::new(motor.protocol.name, &motor.settings, motor.common, physics).unwrap()
        })
        .collect();
    let n_u = motors.len();
    let mut bridge = Bridge::new(config);
    let mut out = FrameQueue::new(64);
    let mut command = ActuatorCommand { n_u: n_u as u64, ..ActuatorCommand::default() };
    command.effort[..n_u].fill(0.05);
    command.damping[..n_u].fill(0.1);
    let mut now_ns = 10 * MS;
    let mut calls_of_bridge = 0;
    let mut seen = Vec::new();
    for step in 0..3000_u64 {
        now_ns += 2 * MS;
        // armed, late, lost and stopped, armed again, a NaN, a fault
        match step {
            200 | 1600 => bridge.operate(now_ns, Operation::Arm),
            2500 => motors[0].fault(0xA),
            2600 => bridge.operate(now_ns, Operation::Reset),
            _ => {}
        }
        command.sequence += 1;
        command.stamp_ns = now_ns;
        command.position[0] = if step % 500 == 499 { f64::NAN } else { 0.0 };
        let before = calls();
        if !(1000..1200).contains(&step) {
            let verdict = bridge.command(now_ns, &command);
            assert_eq!(verdict == CommandVerdict::NotFinite, step % 500 == 499);
        }
        bridge.cycle(now_ns);
        calls_of_bridge += calls() - before;
        seen.push(bridge.state().state);
        for (bus, motor) in motors.iter_mut().enumerate() {
            out.clear();
            for frame in bridge.frames(bus) {
                motor.receive(now_ns, frame, &mut out);
            }
            motor.step(now_ns + MS, &mut out);
            let before = calls();
            out.frames().iter().for_each(|frame| bridge.receive(now_ns + MS, bus, frame));
            calls_of_bridge += calls() - before;
        }
    }
    assert_eq!(calls_of_bridge, 0);
    for state in [
        MechanismState::Disabled,
        MechanismState::Arming,
        MechanismState::Enabled,
        MechanismState::Stopping,
        MechanismState::Fault,
    ] {
        assert!(seen.contains(&(state as u32)), "never {}", state.name());
    }
}

#[test]
fn a_cycle_with_the_model_of_a_robot_allocates_nothing() {
    let text = include_str!("../../../client/can/examples/rh5v2_upper_body.yml");
    let text = format!("{text}\nmodel: {{external: 10}}\n");
    let robot = |_: &Source| load(&Source::Bundled("rh5v2_upper_body".into()), &Options::default());
    let surroundings = Surroundings { file: &|_| Err("absent".into()), robot: &robot };
    let config = Configuration::read("robot.yml", text.into(), &surroundings)
        .unwrap_or_else(|report| panic!("{report}"));
    let physics = Physics { inertia: 1e-3, friction: 0.01, torque_limit: f64::INFINITY };
    let mut motors: Vec<(usize, Simulated)> = config
        .motors
        .iter()
        .map(|motor| {
            let name = motor.protocol.name;
            let made = Simulated::new(name, &motor.settings, motor.common, physics).unwrap();
            (motor.bus, made)
        })
        .collect();
    let n_u = config.actuators.len();
    let fingerprint = config.fingerprint;
    let mut bridge = Bridge::new(config);
    let mut out = FrameQueue::new(64);
    let mut command =
        ActuatorCommand { n_u: n_u as u64, fingerprint, ..ActuatorCommand::default() };
    command.stiffness[..n_u].fill(10.0);
    command.damping[..n_u].fill(1.0);
    let mut now_ns = 10 * MS;
    let mut calls_of_bridge = 0;
    let mut seen = Vec::new();
    for step in 0..2000_u64 {
        now_ns += 2 * MS;
        if step == 50 {
            bridge.operate(now_ns, Operation::Arm);
        }
        // positions without a pose of the torso
        if step == 1000 {
            command.position[..2].fill(0.09);
            command.stiffness[..2].fill(20_000.0);
        }
        command.sequence += 1;
        command.stamp_ns = now_ns;
        let before = calls();
        bridge.command(now_ns, &command);
        bridge.cycle(now_ns);
        calls_of_bridge += calls() - before;
        seen.push((bridge.state().states[0], bridge.state().reasons[0]));
        for (bus, motor) in &mut motors {
            out.clear();
            for frame in bridge.frames(*bus) {
                motor.receive(now_ns, frame, &mut out);
            }
            motor.step(now_ns + MS, &mut out);
            let before = calls();
            out.frames().iter().for_each(|frame| bridge.receive(now_ns + MS, *bus, frame));
            calls_of_bridge += calls() - before;
        }
    }
    assert_eq!(calls_of_bridge, 0);
    assert!(seen.contains(&(MechanismState::Enabled as u32, Reason::None as u32)));
    assert_ne!(seen.last().unwrap().0, MechanismState::Enabled as u32);
}

#[test]
fn power_and_stiffness_are_the_same_on_both_sides_of_the_mapping() {
    let mut seeded = Seeded::new(11);
    for _ in 0..100_000 {
        let mapping = Mapping {
            sign: if seeded.chance(0.5) { 1.0 } else { -1.0 },
            gear: 10_f64.powf(seeded.within(-2.0, 4.0)),
            offset: seeded.within(-3.0, 3.0),
            torque_constant: 10_f64.powf(seeded.within(-1.0, 1.0)),
        };
        let at = ActuatorSetpoint {
            position: seeded.within(-3.0, 3.0),
            velocity: seeded.within(-10.0, 10.0),
            effort: seeded.within(-1000.0, 1000.0),
            stiffness: seeded.within(0.0, 1e4),
            damping: seeded.within(0.0, 1e3),
        };
        let motor = mapping.to_motor(&at);
        let near = |a: f64, b: f64, size: f64| {
            assert!((a - b).abs() <= 1e-12 * size, "{a} {b} {mapping:?}")
        };
        // the true torque is the constant times the protocol's torque
        let power = motor.torque * mapping.torque_constant * motor.velocity;
        near(power, at.effort * at.velocity, at.effort.abs() * at.velocity.abs());
        // a spring stores the same energy on both sides, a damper dissipates the same power
        let way = 0.3;
        let turn = 0.3 * mapping.gear;
        near(
            motor.stiffness * mapping.torque_constant * turn * turn,
            at.stiffness * way * way,
            at.stiffness,
        );
        near(
            motor.damping * mapping.torque_constant * turn * turn,
            at.damping * way * way,
            at.damping,
        );
        // mapped to the motor and back
        let measured = Measurement {
            position: motor.position,
            velocity: motor.velocity,
            torque: motor.torque,
            temperature: 20.0,
        };
        let back = mapping.to_actuator(&measured);
        near(back.position, at.position, 10.0);
        near(back.velocity, at.velocity, 10.0);
        near(back.effort, at.effort, 1000.0);
    }
}
