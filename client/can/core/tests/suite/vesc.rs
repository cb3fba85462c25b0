//! VESC. The set current's frame is the example of documentation/comm_can.md in vedderb/bldc; the
//! others follow its tables and the C code beside them (comm_can.c).

use std::f64::consts::TAU;

use crate::support::{COMMON, cycle, drive, receive, survives_hostile_frames, torque};
use sarrus_can_core::drive::{Drive, DriveCommand, Measurement, Mode, Power, Receipt, Setpoint};
use sarrus_can_core::protocol::Common;

/// 45° of a turn, 30 °C and 25 °C.
const STATUS_4: &str = "00001017#012C00FA000008CA";

fn vesc(mode: Mode) -> Box<dyn Drive> {
    let yaml = "{id: 23, motor_torque_constant: 0.1, pole_pairs: 7}";
    drive("vesc", yaml, Common { mode, torque_limit: 6.0, ..COMMON })
}

fn enabled(mode: Mode) -> Box<dyn Drive> {
    let mut drive = vesc(mode);
    receive(&mut *drive, STATUS_4);
    assert_eq!(drive.state().power, Power::Off);
    (0..2).for_each(|_| {
        cycle(&mut *drive, DriveCommand::On(Setpoint::default()));
    });
    assert_eq!(drive.state().power, Power::Starting);
    (0..2).for_each(|_| {
        receive(&mut *drive, STATUS_4);
    });
    assert_eq!(drive.state().power, Power::On);
    drive
}

#[test]
fn the_example_of_the_documentation_comes_out() {
    // 51 A on VESC ID 23
    let mut drive = enabled(Mode::Torque);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(5.1))), ["00000117#0000C738"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(99.0))), ["00000117#0000EA60"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["00000117#00000000"]);
}

#[test]
fn speeds_and_positions_come_out_with_their_limit_of_current() {
    // comm_can_set_rpm: electrical rpm; comm_can_set_pos: degrees × 1000000
    let mut drive = enabled(Mode::Velocity);
    let setpoint = Setpoint { velocity: TAU, ..Setpoint::default() };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["00000317#000001A4"]);
    let mut drive = enabled(Mode::Position);
    let setpoint = Setpoint { position: 1.25 * TAU, ..Setpoint::default() };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["00000417#055D4A80"]);
    // CAN_PACKET_CONF_CURRENT_LIMITS: least and largest, × 1000
    let mut drive = vesc(Mode::Position);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::Off),
        ["00000117#00000000", "00001517#FFFF15A00000EA60"]
    );
    receive(&mut *drive, STATUS_4);
    let primed = cycle(&mut *drive, DriveCommand::On(setpoint));
    assert_eq!(primed, ["00001517#FFFF15A00000EA60", "00000117#00000000"]);
}

#[test]
fn status_messages_are_read_and_the_position_goes_on_over_its_turn() {
    let mut drive = vesc(Mode::Torque);
    let mut position = |degrees: f64| {
        let code = (degrees * 50.0) as u16;
        match receive(&mut *drive, &format!("00001017#012C00FA0000{code:04X}")) {
            Receipt::Measured(Measurement { position, .. }) => position.to_degrees(),
            other => panic!("{other:?}"),
        }
    };
    let places = [350.0, 359.0, 8.0, 100.0, 250.0, 30.0, 350.0, 200.0].map(&mut position);
    assert_eq!(places.map(f64::round), [350.0, 359.0, 368.0, 460.0, 610.0, 750.0, 710.0, 560.0]);
    // 4200 electrical rpm are ten turns of the rotor a second; 3.2 A, positive where the motor
    // takes power, at a positive, a negative and no voltage
    let mut reported = |current_and_duty: &str| {
        let status_1 = format!("00000917#00001068{current_and_duty}");
        assert_eq!(receive(&mut *drive, &status_1), Receipt::Noted);
        let Receipt::Measured(measured) = receive(&mut *drive, STATUS_4) else { panic!() };
        assert!((measured.velocity - 10.0 * TAU).abs() < 1e-9);
        assert_eq!(measured.temperature, 30.0);
        measured.torque
    };
    for (current_and_duty, torque) in [
        ("002000C8", 0.32),
        ("0020FF38", -0.32),
        ("FFE000C8", -0.32),
        ("FFE0FF38", 0.32),
        ("00000000", 0.0),
    ] {
        assert!((reported(current_and_duty) - torque).abs() < 1e-12, "{current_and_duty}");
    }
    assert!(reported("FFE00000").is_nan());
    assert_eq!(receive(&mut *drive, "00001B17#0000000000F00000"), Receipt::Noted);
    // a status 1 of long ago is not used
    let late = drive.receive(300_000_000, &crate::support::frame(STATUS_4));
    assert!(matches!(late, Receipt::Measured(measured) if measured.velocity.is_nan()));
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = vesc(Mode::Torque);
    for text in ["00001018#012C00FA000008CA", "017#0000C738", "00001217#1700"] {
        assert_eq!(receive(&mut *drive, text), Receipt::NotMine, "{text}");
    }
    for text in ["00000117#0000C738", "00000317#000001A4", "00001517#FFFF15A00000EA60"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Foreign, "{text}");
    }
    assert_eq!(receive(&mut *drive, "00001017#012C"), Receipt::Malformed);
    survives_hostile_frames(&mut *drive, 13);
}
