//! Simulated motors against frames of the protocols' authors and counterparts, not of our drives.
//! Each test names where its bytes come from.

use crate::support::{frame, settled};
use sarrus_can_core::drive::{Mode, Setpoint};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::Common;
use sarrus_can_sim::{Physics, Simulated};

fn motor(protocol: &str, yaml: &str, mode: Mode) -> Simulated {
    let common = Common {
        mode,
        watchdog_ms: 0,
        torque_limit: f64::INFINITY,
        velocity_limit: f64::INFINITY,
        period_ns: 0,
    };
    let (_, settings) = settled(protocol, yaml, common, "").unwrap();
    let physics = Physics { inertia: 0.01, friction: 0.0, torque_limit: f64::INFINITY };
    Simulated::new(protocol, &settings, common, physics).unwrap()
}

/// Answers of a motor to a frame.
fn answers(motor: &mut Simulated, text: &str) -> Vec<String> {
    let mut out = FrameQueue::new(8);
    assert!(motor.receive(0, &frame(text), &mut out), "{text} is for this motor");
    out.frames().iter().map(ToString::to_string).collect()
}

fn near(law: &Setpoint, expected: [f64; 5]) {
    let law = [law.position, law.velocity, law.stiffness, law.damping, law.torque];
    for (got, expected) in law.into_iter().zip(expected) {
        assert!((got - expected).abs() < 1e-5, "{law:?}");
    }
}

#[test]
fn the_mini_cheetahs_motor_does_what_its_authors_c_code_does() {
    // B. Katz, motorcontrol (2023-07-02): float_to_uint, uint_to_float and pack_reply, compiled.
    // A command of 0.1 rad, -0.5 rad/s, 20 N m/rad, 0.5 N m s/rad, 1 N m over P 12.5, V 45, Kp 500,
    // Kd 5, T 18, and the numbers that unpack_cmd reads from it
    let yaml = "{variant: mini_cheetah, id: 4, reply_id: 0, position_range: 12.5, velocity_range: \
        45, torque_range: 18, stiffness_range: 500, damping_range: 5}";
    let mut motor = motor("mit", yaml, Mode::Impedance);
    answers(&mut motor, "004#FFFFFFFFFFFFFFFC");
    answers(&mut motor, "004#81057E80A3199871");
    near(motor.follows().unwrap(), [0.099756, -0.516483, 19.902319, 0.499389, 0.997803]);
    // pack_reply of 3 rad, -20 rad/s, 5 N m, 24 V
    motor.plant.carry(3.0, -20.0);
    motor.plant.torque = 5.0;
    assert_eq!(answers(&mut motor, "004#FFFFFFFFFFFFFFFD")[0][..8], "000#049E"[..]);
    motor.plant.torque = 5.0;
    let fresh = answers(&mut motor, "004#8000800000000800");
    assert_eq!(fresh, ["000#049EB7471A3899"]);
}

#[test]
fn a_moteus_does_what_its_makers_client_says() {
    // PyPI moteus 1.1.1: Controller(id=1).make_position(position=nan, velocity=0,
    // feedforward_torque=.5, kp_scale=0, kd_scale=0, ilimit_scale=0, maximum_torque=1.23,
    // watchdog_timeout=.05)
    let mut motor = motor("moteus", "{id: 1}", Mode::Torque);
    const COMMAND: &str =
        "01000A0E200000C07F000000000404223200000000007B00012705012B0011001F01130D";
    answers(&mut motor, &format!("00008001##1{COMMAND}{}", "50".repeat(12)));
    motor.step(1_000_000, &mut FrameQueue::new(8));
    let law = motor.follows().unwrap();
    assert_eq!((law.stiffness, law.damping), (0.0, 0.0));
    assert!((law.torque - 0.5).abs() < 1e-9);
    assert!((motor.plant.physics.torque_limit - 1.23).abs() < 1e-9);
    assert_eq!(motor.plant.watchdog_ns, 50_000_000);
}

#[test]
fn an_rmd_answers_as_in_the_examples_of_its_manual() {
    // MyActuator, Motor Motion Protocol V4.2: examples of 2.12, 2.15, 2.19 and 2.30
    let mut motor = motor("rmd", "{id: 1, motor_torque_constant: 2.0}", Mode::Torque);
    motor.plant.temperature = 50.0;
    motor.plant.carry(360_f64.to_radians(), 0.0);
    assert_eq!(answers(&mut motor, "141#9200000000000000"), ["241#92000000A08C0000"]);
    motor.plant.carry(45.001_f64.to_radians(), 500.001_f64.to_radians());
    motor.plant.torque = 2.0;
    assert_eq!(answers(&mut motor, "141#9C00000000000000"), ["241#9C326400F4012D00"]);
    answers(&mut motor, "141#7700000000000000");
    answers(&mut motor, "141#A10000009CFF0000");
    assert_eq!(motor.follows().unwrap().torque, -2.0, "-1 A");
    let timeout = answers(&mut motor, "141#B3000000E8030000");
    assert_eq!(timeout, ["241#B3000000E8030000"], "the same as the command, says the text");
    assert_eq!(motor.plant.watchdog_ns, 1_000_000_000);
}

#[test]
fn a_vesc_takes_the_example_of_its_documentation() {
    // vedderb/bldc, documentation/comm_can.md: 51 A on VESC ID 23
    let yaml = "{id: 23, motor_torque_constant: 0.1, pole_pairs: 7}";
    let mut motor = motor("vesc", yaml, Mode::Torque);
    answers(&mut motor, "00000117#0000C738");
    assert!((motor.follows().unwrap().torque - 5.1).abs() < 1e-9);
}

#[test]
fn an_ak_in_servo_mode_takes_and_tells_what_its_counterpart_sends_and_reads() {
    // PyPI TMotorCANControl 1.2.6: comm_can_set_current(104, -7.1234); parse_servo_message reads
    // 12.3°, -450 electrical rpm, 3.21 A, 35 °C, no fault from the state sent here
    let yaml = "{id: 104, motor_torque_constant: 1.0, pole_pairs: 21, reduction: 9}";
    let mut motor = motor("ak_servo", yaml, Mode::Torque);
    answers(&mut motor, "00000168#FFFFE42D");
    assert!((motor.follows().unwrap().torque + 7.123).abs() < 1e-9);
    answers(&mut motor, "00000168#00000000");
    assert!(motor.follows().is_none());
    let rpm = -450.1 / 189.0;
    motor.plant.carry(12.3001_f64.to_radians(), rpm * std::f64::consts::TAU / 60.0);
    (motor.plant.torque, motor.plant.temperature) = (3.21001, 35.0);
    let mut out = FrameQueue::new(8);
    motor.tick(1_000_000, &mut out);
    assert_eq!(out.frames()[0].to_string(), "00002968#007BFFD301412300");
}
