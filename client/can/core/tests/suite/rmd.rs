//! MyActuator RMD. Frames in these tests are the communication examples of MyActuator, *Motor
//! Motion Protocol V4.2*, unless another source is named.

use crate::support::{COMMON, cycle, drive, receive, survives_hostile_frames, torque};
use sarrus_can_core::drive::{Drive, DriveCommand, Measurement, Mode, Power, Receipt, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::Common;

/// Example of 2.15: 50 °C, 1 A, 500 °/s, 45°.
const STATE: &str = "241#9C326400F4012D00";
const ANGLE: &str = "141#9200000000000000";

fn rmd() -> Box<dyn Drive> {
    let common = Common { mode: Mode::Torque, watchdog_ms: 1000, torque_limit: 5.0, ..COMMON };
    drive("rmd", "{id: 1, motor_torque_constant: 2.0}", common)
}

fn enabled() -> Box<dyn Drive> {
    let mut drive = rmd();
    cycle(&mut *drive, DriveCommand::Off);
    receive(&mut *drive, STATE);
    assert_eq!(drive.state().power, Power::Off);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(torque(2.0))),
        ["141#A100000000000000", ANGLE],
        "no torque before the brake is open"
    );
    // example 1 of 2.19: 1 A, here 2 N m
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(torque(2.0))),
        ["141#7700000000000000", "141#A100000064000000", ANGLE]
    );
    for power in [Power::Starting, Power::On] {
        receive(&mut *drive, "241#A1326400F4012D00");
        assert_eq!(drive.state().power, power);
    }
    drive
}

#[test]
fn the_examples_of_the_manual_come_out_and_are_read() {
    let mut drive = enabled();
    // example 2 of 2.19: -1 A, answered by -1 A, -500 °/s
    let sent = cycle(&mut *drive, DriveCommand::On(torque(-2.0)));
    assert_eq!(sent, ["141#A10000009CFF0000", "141#9A00000000000000", ANGLE]);
    assert_eq!(receive(&mut *drive, "241#A1329CFF0CFED3FF"), Receipt::Noted);
    // 2.12: 360°
    let Receipt::Measured(Measurement { position, velocity, torque, temperature }) =
        receive(&mut *drive, "241#92000000A08C0000")
    else {
        panic!()
    };
    assert!((position.to_degrees() - 360.0).abs() < 1e-9);
    assert!((velocity.to_degrees() + 500.0).abs() < 1e-9);
    assert_eq!((torque, temperature), (-2.0, 50.0));
    // 2.14: 48.5 V, low voltage
    assert_eq!(receive(&mut *drive, "241#9A320001E5010400"), Receipt::Parameter(0, 48.5));
    assert_eq!((drive.state().fault, drive.state().power), (4, Power::Off));
    let mut queue = FrameQueue::new(4);
    drive.disable(&mut queue);
    let frames: Vec<String> = queue.frames().iter().map(ToString::to_string).collect();
    assert_eq!(frames, ["141#8000000000000000", "141#7800000000000000"]);
}

#[test]
fn the_watchdog_is_in_a_rom_and_written_until_it_is_answered() {
    // 2.30, example 2: 1000 ms
    const TIMEOUT: &str = "141#B3000000E8030000";
    let written = |drive: &mut dyn Drive| {
        let sent = (0..30).flat_map(|_| cycle(drive, DriveCommand::Off));
        sent.filter(|frame| frame == TIMEOUT).count()
    };
    let mut silent = rmd();
    assert_eq!(written(&mut *silent), 3);
    silent.prepare();
    assert_eq!((written(&mut *silent), silent.state().watchdog), (0, Watchdog::Unknown));
    let mut drive = rmd();
    receive(&mut *drive, &TIMEOUT.replace("141", "241"));
    assert_eq!((written(&mut *drive), drive.state().watchdog), (0, Watchdog::Set(1000)));
}

#[test]
fn a_torque_that_is_answered_by_itself_was_not_followed() {
    // as users report of the first command after B3's time has ended
    let mut drive = rmd();
    receive(&mut *drive, STATE);
    (0..2).for_each(|_| {
        cycle(&mut *drive, DriveCommand::On(torque(2.0)));
    });
    for _ in 0..5 {
        receive(&mut *drive, "241#A100000064000000");
        assert_eq!(drive.state().power, Power::Starting);
    }
}

#[test]
fn torques_are_limited_and_rounded_towards_zero() {
    let mut drive = enabled();
    let sent = |drive: &mut dyn Drive, value: f64| {
        cycle(drive, DriveCommand::On(torque(value)))[0].clone()
    };
    assert_eq!(sent(&mut *drive, 100.0), "141#A1000000FA000000", "2.5 A are 5 N m");
    assert_eq!(sent(&mut *drive, -0.0399), "141#A1000000FFFF0000");
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = rmd();
    assert_eq!(receive(&mut *drive, "242#9C326400F4012D00"), Receipt::NotMine);
    assert_eq!(receive(&mut *drive, "141#A100000064000000"), Receipt::Foreign);
    assert_eq!(receive(&mut *drive, "241#9C3264"), Receipt::Malformed);
    survives_hostile_frames(&mut *drive, 12);
}
