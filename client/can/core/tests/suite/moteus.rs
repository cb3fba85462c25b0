//! moteus on CAN FD.

use std::f64::consts::TAU;

use crate::support::{
    COMMON, Random, cycle, drive, is_toward_zero, last, receive, survives_hostile_frames, torque,
    try_drive,
};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Setpoint, Watchdog};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::protocol::{Common, fault};

const STOPPED: &str = "100##12C040000000000000000000000000000000000230D181400212705";
const RUNS: &str = "100##12C040000002041000000000000000000000000230D181400";

/// Stopped, with a watchdog of 50 ms, asked for all and filled up to 16 bytes.
const STOP: [&str; 1] = ["00008001##101000001270511271C0400130D505050"];

fn moteus(mode: Mode) -> Box<dyn Drive> {
    drive("moteus", "{id: 1, kp: 4.0, kd: 0.05}", Common { mode, watchdog_ms: 50, ..COMMON })
}

/// The frame of an answer, filled up to a length that FD has.
fn answer(drive: &mut dyn Drive, text: &str) -> Receipt {
    let (id, data) = text.split_once("##1").unwrap();
    let lens = [0, 2, 4, 6, 8, 10, 12, 14, 16, 24, 32, 40, 48, 64, 96, 128];
    let len = lens.into_iter().find(|len| *len >= data.len()).unwrap();
    receive(drive, &format!("{id}##1{data}{}", "50".repeat((len - data.len()) / 2)))
}

/// An answer with a mode, a velocity and a fault.
fn answer_of(mode: &str, velocity: &str, fault: &str) -> String {
    format!("100##12C0400{mode}00000000{velocity}00000000230D1814{fault}")
}

/// A drive whose motor said that it follows positions.
fn enabled(mode: Mode) -> Box<dyn Drive> {
    let mut drive = moteus(mode);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(1.0))), STOP);
    assert!(matches!(answer(&mut *drive, STOPPED), Receipt::Measured(_)));
    assert_eq!((drive.state().power, drive.state().watchdog), (Power::Off, Watchdog::Set(50)));
    cycle(&mut *drive, DriveCommand::On(torque(0.0)));
    assert_eq!(drive.state().power, Power::Starting);
    answer(&mut *drive, RUNS);
    assert_eq!((drive.state().power, drive.state().fault), (Power::On, 0));
    drive
}

/// The registers of a set-point: position, velocity, torque, scales and largest torque, in their
/// units.
fn decode(frame: &Frame) -> [f64; 6] {
    let (mode, mut bytes) = frame.data().split_at(3);
    let [mut position, mut velocity] = [f64::NAN; 2];
    if let [0x0E, 0x20, values @ ..] = bytes {
        let single = |i: usize| f64::from(f32::from_le_bytes(values[i..i + 4].try_into().unwrap()));
        (position, velocity, bytes) = (single(0), single(4), &values[8..]);
    }
    assert_eq!((mode, &bytes[..3]), (&[1, 0, 10][..], &[4, 4, 0x22][..]));
    // 50 ms, neither a limit of velocity nor one of acceleration, and no integrator
    assert_eq!(&bytes[11..24], [3, 0x27, 5, 0xFF, 0xFF, 1, 0x2B, 0, 0x1C, 4, 0, 0x13, 0x0D]);
    assert!(bytes[24..].iter().all(|byte| *byte == 0x50));
    let whole =
        |i: usize, unit: f64| f64::from(i16::from_le_bytes([bytes[i], bytes[i + 1]])) * unit;
    [
        position,
        velocity,
        whole(3, 0.01),
        whole(5, 1.0 / 32767.0),
        whole(7, 1.0 / 32767.0),
        whole(9, 0.01),
    ]
}

#[test]
fn a_watchdog_that_eight_bits_cannot_say_is_refused() {
    let made = |watchdog_ms| {
        try_drive("moteus", "{id: 1}", Common { mode: Mode::Torque, watchdog_ms, ..COMMON }, "")
            .map(|_| ())
    };
    assert_eq!(made(1270), Ok(()));
    assert!(made(1271).unwrap_err().contains("at most 1270 with moteus"));
}

#[test]
fn random_set_points_are_within_half_a_step() {
    let mut random = Random(9);
    let mut drive = enabled(Mode::Impedance);
    for _ in 0..100_000 {
        let stiffness = random.between(0.0, 4.0 / TAU);
        let setpoint = Setpoint {
            position: random.between(-50.0, 50.0),
            velocity: random.between(-100.0, 100.0),
            torque: random.between(-300.0, 300.0),
            stiffness,
            damping: random.between(0.0, 0.05 / TAU * stiffness * TAU / 4.0),
        };
        let sent = decode(&last(&mut *drive, DriveCommand::On(setpoint)));
        let near = |sent: f64, setpoint: f64| {
            assert!(
                (sent - setpoint).abs() <= setpoint.abs() * f64::powi(2.0, -24),
                "{sent} {setpoint}"
            )
        };
        near(sent[0], setpoint.position / TAU);
        near(sent[1], setpoint.velocity / TAU);
        assert!(is_toward_zero(sent[2], setpoint.torque, 0.01));
        assert!(is_toward_zero(sent[3], setpoint.stiffness * TAU / 4.0, 1.0 / 32767.0));
        assert!(is_toward_zero(sent[4], setpoint.damping * TAU / 0.05, 1.0 / 32767.0));
        assert_eq!(sent[5], -327.68, "without a limit it is the controller's own");
    }
}

#[test]
fn the_answer_of_the_documentation_is_read() {
    // rcv 100 2404000a005000000170ff230d181400: position 2.88 degrees, velocity 23.04 degrees/s,
    // -1.44 N m, 20 degrees Celsius
    let mut drive = moteus(Mode::Torque);
    let Receipt::Measured(measured) =
        receive(&mut *drive, "100##12404000A005000000170FF230D181400")
    else {
        panic!()
    };
    assert!((measured.position - 2.88_f64.to_radians()).abs() < 1e-12);
    assert!((measured.velocity - 23.04_f64.to_radians()).abs() < 1e-12);
    assert!((measured.torque + 1.44).abs() < 1e-12);
    assert_eq!((measured.temperature, drive.state().power), (20.0, Power::On));
    assert_eq!(
        receive(&mut *drive, "00000100##12404000A005000000170FF230D181400"),
        Receipt::Measured(measured),
        "extended or not"
    );
}

#[test]
fn damping_beyond_the_stiffness_becomes_torque() {
    let mut drive = enabled(Mode::Impedance);
    // the motor turns at one turn a second
    answer(&mut *drive, &answer_of("00002041", "0000803F", "00"));
    let damping = 0.02 / TAU;
    let sent = decode(&last(
        &mut *drive,
        DriveCommand::On(Setpoint { damping, torque: 1.0, ..Setpoint::default() }),
    ));
    assert_eq!((sent[3], sent[4]), (0.0, 0.0), "the motor has no damping without stiffness");
    assert!((sent[2] - (1.0 - 0.02)).abs() < 0.011, "{}", sent[2]);
}

#[test]
fn a_timeout_or_a_fault_ends_the_following() {
    let mut drive = enabled(Mode::Torque);
    answer(&mut *drive, &answer_of("00003041", "00000000", "00"));
    assert_eq!(
        (drive.state().power, drive.state().fault),
        (Power::Off, fault::POWER_LOST),
        "mode 11 is the timeout"
    );
    (0..3).for_each(|_| assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(1.0))), STOP));
    answer(&mut *drive, STOPPED);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(1.0))), STOP, "no power again by itself");
    cycle(&mut *drive, DriveCommand::Off);
    assert_eq!(drive.state().fault, 0);
    let mut drive = enabled(Mode::Torque);
    answer(&mut *drive, &answer_of("0000803F", "00000000", "27"));
    assert_eq!(drive.state().fault, 39, "outside its limits");
    let mut drive = enabled(Mode::Torque);
    answer(&mut *drive, &answer_of("00002041", "00000000", "60"));
    assert_eq!(drive.state().fault, 0, "codes from 96 on tell what limits it");
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = moteus(Mode::Torque);
    assert_eq!(answer(&mut *drive, "200##12C04000000803F"), Receipt::NotMine);
    for text in [
        "100##12C040000000000",
        "100##10100",
        "100##12F0100000000",
        "100##1209F9F9F9F9F9F00",
        "100##12CFFFFFFFF0F00",
    ] {
        assert_eq!(answer(&mut *drive, text), Receipt::Malformed, "{text}");
    }
    assert_eq!(drive.state().power, Power::Unknown, "nothing was taken");
    assert_eq!(
        answer(&mut *drive, "100##12C0400000000000000C07F0000000000000000"),
        Receipt::Malformed
    );
    assert_eq!(answer(&mut *drive, "100##1302005"), Receipt::Noted);
    survives_hostile_frames(&mut *drive, 3);
}

#[test]
fn the_largest_torque_goes_along_rounded_down() {
    let mut drive = drive(
        "moteus",
        "{id: 1}",
        Common { mode: Mode::Torque, watchdog_ms: 50, torque_limit: 1.239, ..COMMON },
    );
    answer(&mut *drive, STOPPED);
    let frame = last(&mut *drive, DriveCommand::On(torque(9.0)));
    let sent = decode(&frame);
    assert_eq!((sent[2], sent[5]), (1.23, 1.23));
    assert_eq!(frame.data().len(), 32, "a torque alone takes no position");
    assert_eq!(receive(&mut *drive, &frame.to_string()), Receipt::Foreign);
    let report = try_drive("moteus", "{id: 1}", COMMON, "").unwrap_err();
    assert!(report.contains("`kp` and `kd`"), "{report}");
}

#[test]
fn a_timeout_is_read_as_the_motor_tells_it() {
    // 0 is the motor's own, NaN is none
    for (value, watchdog) in
        [("80", Watchdog::Off), ("00", Watchdog::Unreadable), ("03", Watchdog::Set(30))]
    {
        let mut drive = moteus(Mode::Torque);
        answer(&mut *drive, &format!("{}{value}", &STOPPED[..STOPPED.len() - 2]));
        assert_eq!(drive.state().watchdog, watchdog, "{value}");
    }
}
