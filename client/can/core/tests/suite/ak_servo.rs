//! T-Motor AK in servo mode. Commands and states in these tests are those of
//! `comm_can_set_current`, `comm_can_set_origin` and `parse_servo_message` of TMotorCANControl
//! 1.2.6 (PyPI); the fields are those of CubeMars, *AK series actuator driver manual* V1.0.8, 5.1.2
//! and 5.2.1.

use std::f64::consts::TAU;

use crate::support::{COMMON, cycle, drive, receive, survives_hostile_frames, torque, try_drive};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, fault};

const YAML: &str = "{id: 104, motor_torque_constant: 1.0, pole_pairs: 21, reduction: 9}";
/// 12.3°, -450 electrical rpm, 3.21 A, 35 °C.
const STATE: &str = "00002968#007BFFD301412300";

fn servo() -> Box<dyn Drive> {
    drive("ak_servo", YAML, Common { mode: Mode::Torque, torque_limit: 10.0, ..COMMON })
}

#[test]
fn what_the_counterpart_sends_and_reads_is_the_same() {
    let mut drive = servo();
    let Receipt::Measured(measured) = receive(&mut *drive, STATE) else { panic!() };
    assert!((measured.position.to_degrees() - 12.3).abs() < 1e-9);
    assert!((measured.velocity + 450.0 / 60.0 / 189.0 * TAU).abs() < 1e-9);
    assert!((measured.torque - 3.21).abs() < 1e-9);
    assert_eq!((measured.temperature, drive.state().watchdog), (35.0, Watchdog::Unreadable));
    let current =
        |drive: &mut dyn Drive, value: f64| cycle(drive, DriveCommand::On(torque(value))).concat();
    assert_eq!(current(&mut *drive, 2.5), "00000168#000009C4");
    assert_eq!(current(&mut *drive, -7.1234), "00000168#FFFFE42D", "towards zero");
    assert_eq!(current(&mut *drive, 99.0), "00000168#00002710", "no more than the limit");
    assert_eq!(drive.state().power, Power::Starting);
    (0..2).for_each(|_| {
        receive(&mut *drive, STATE);
    });
    assert_eq!(drive.state().power, Power::On);
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["00000168#00000000"]);
    let mut queue = FrameQueue::new(2);
    assert!(drive.set_zero(&mut queue));
    assert_eq!(queue.frames()[0].to_string(), "00000568#00");
}

#[test]
fn faults_and_the_ends_of_the_position_are_seen() {
    let mut drive = servo();
    receive(&mut *drive, "00002968#007BFFD301412301");
    assert_eq!(drive.state().fault, 1, "over-temperature");
    receive(&mut *drive, "00002968#7D00FFD301412300");
    assert_eq!(drive.state().fault, fault::OUT_OF_RANGE, "3200°");
    receive(&mut *drive, STATE);
    assert_eq!(drive.state().fault, 0);
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = servo();
    for text in ["00002969#007BFFD301412300", "00001068#007BFFD301412300", "168#000009C4"] {
        assert_eq!(receive(&mut *drive, text), Receipt::NotMine, "{text}");
    }
    for text in ["00000168#000009C4", "00000368#000009C4"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Foreign, "{text}");
    }
    assert_eq!(receive(&mut *drive, "00002968#007B"), Receipt::Malformed);
    survives_hostile_frames(&mut *drive, 14);
    let yaml = YAML.replace("id: 104", "id: 104, upload: 1");
    let report = try_drive("ak_servo", &yaml, COMMON, "").unwrap_err();
    assert!(report.contains("which is a command"), "{report}");
}
