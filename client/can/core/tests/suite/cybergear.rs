//! CyberGear and RobStride's private protocol.

use crate::support::{
    COMMON, Random, cycle, drive, is_toward_zero, last, receive, survives_hostile_frames, try_drive,
};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Setpoint, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, fault};

const STOPPED: &str = "02000AFD#7FFF7FFF7FFF012C";
const RUNS: &str = "02800AFD#7FFF7FFF7FFF012C";

fn cybergear(common: Common) -> Box<dyn Drive> {
    drive("cybergear", "{id: 10, position_range: 12.5}", common)
}

/// A drive whose motor said that it runs.
fn enabled(common: Common) -> Box<dyn Drive> {
    let mut drive = cybergear(Common { watchdog_ms: 50, ..common });
    let mut sent = Vec::new();
    for _ in 0..9 {
        for frame in cycle(&mut *drive, DriveCommand::Off) {
            match frame.as_str() {
                "1100FD0A#0570000000000000" => receive(&mut *drive, "11000AFD#0570000000000000"),
                "1100FD0A#0C20000000000000" => receive(&mut *drive, "11000AFD#0C200000E8030000"),
                _ => receive(&mut *drive, STOPPED),
            };
            sent.push(frame);
        }
    }
    sent.retain(|frame| frame != "0400FD0A#0000000000000000");
    let expected = [
        "1200FD0A#0570000000000000",
        "1100FD0A#0570000000000000",
        "1200FD0A#0C200000E8030000",
        "1100FD0A#0C20000000000000",
    ];
    assert_eq!(sent, expected);
    assert_eq!((drive.state().watchdog, drive.state().power), (Watchdog::Set(50), Power::Off));
    let setpoint = Setpoint { torque: 12.0, ..Setpoint::default() };
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(setpoint)),
        ["017FFF0A#7FFF7FFF00000000"],
        "nothing is asked before power"
    );
    receive(&mut *drive, STOPPED);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["0300FD0A#0000000000000000"]);
    receive(&mut *drive, STOPPED);
    assert_eq!(drive.state().power, Power::Starting, "feedback says whether it runs");
    receive(&mut *drive, RUNS);
    assert_eq!(drive.state().power, Power::On);
    drive
}

#[test]
fn known_frames_come_out() {
    let mut drive = enabled(COMMON);
    let setpoint =
        Setpoint { position: 12.5, velocity: -30.0, torque: 12.0, stiffness: 500.0, damping: 0.0 };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["01FFFF0A#FFFF0000FFFF0000"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["0400FD0A#0000000000000000"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Reset), ["0400FD0A#0100000000000000"]);
}

#[test]
fn random_values_are_the_nearest_and_no_torque_or_gain_grows() {
    let mut random = Random(8);
    let mut drive = enabled(COMMON);
    let steps = [25.0, 60.0, 24.0, 500.0, 5.0].map(|span| span / 65535.0);
    for _ in 0..100_000 {
        let setpoint = Setpoint {
            position: random.between(-12.5, 12.5),
            velocity: random.between(-30.0, 30.0),
            torque: random.between(-12.0, 12.0),
            // from the first code on
            stiffness: random.between(0.01, 500.0),
            damping: random.between(0.0001, 5.0),
        };
        let frame = last(&mut *drive, DriveCommand::On(setpoint));
        let code = |i: usize| f64::from(frame.data()[i]) * 256.0 + f64::from(frame.data()[i + 1]);
        let torque = f64::from(frame.id.number() >> 8 & 0xFFFF);
        assert_eq!(frame.id.number() & 0xFF00_00FF, 0x0100_000A);
        let sent = [
            code(0) * steps[0] - 12.5,
            code(2) * steps[1] - 30.0,
            torque * steps[2] - 12.0,
            code(4) * steps[3],
            code(6) * steps[4],
        ];
        let setpoint = [
            setpoint.position,
            setpoint.velocity,
            setpoint.torque,
            setpoint.stiffness,
            setpoint.damping,
        ];
        for i in 0..5 {
            let sent = sent[i];
            let desired = setpoint[i];
            let is_right = match i {
                0 | 1 => (sent - desired).abs() <= 0.5 * steps[i] * (1.0 + 1e-9),
                _ => is_toward_zero(sent, desired, steps[i]),
            };
            assert!(is_right, "{i}: {sent} {desired}");
        }
        let code = |value: f64, half: f64| ((value + half) / (2.0 * half) * 65535.0).round() as u16;
        let p = code(setpoint[0], 12.5);
        let v = code(setpoint[1], 30.0);
        let t = code(setpoint[2], 12.0);
        let mut fresh = cybergear(COMMON);
        let Receipt::Measured(measured) =
            receive(&mut *fresh, &format!("02800AFD#{p:04X}{v:04X}{t:04X}012C"))
        else {
            panic!()
        };
        let read = [measured.position, measured.velocity, measured.torque];
        for i in 0..3 {
            assert!((read[i] - setpoint[i]).abs() <= 0.5 * steps[i] * (1.0 + 1e-9));
        }
        assert_eq!(measured.temperature, 30.0);
    }
}

#[test]
fn faults_and_frames_of_others_are_told_apart() {
    let mut drive = enabled(COMMON);
    for text in ["02800BFD#7FFF7FFF7FFF012C", "02800AFE#7FFF7FFF7FFF012C", "2FD#7FFF7FFF7FFF012C"] {
        assert_eq!(receive(&mut *drive, text), Receipt::NotMine, "{text}");
    }
    assert_eq!(receive(&mut *drive, "02800AFD#7FFF7FFF7FFF01"), Receipt::Malformed);
    receive(&mut *drive, "02840AFD#7FFF7FFF7FFF012C");
    assert_eq!(drive.state().fault, 4, "over-temperature");
    receive(&mut *drive, RUNS);
    assert_eq!(drive.state().fault, 0);
    receive(&mut *drive, "15000AFD#0100000000000000");
    assert_eq!(drive.state().fault, 1);
    receive(&mut *drive, STOPPED);
    assert_eq!(
        (drive.state().power, drive.state().fault),
        (Power::Off, 1),
        "feedback has no room for this one"
    );
    receive(&mut *drive, "15000AFD#0000000000000000");
    assert_eq!((drive.state().power, drive.state().fault), (Power::Off, fault::POWER_LOST));
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(Setpoint::default())),
        ["0400FD0A#0000000000000000"]
    );
}

#[test]
fn the_largest_torque_is_set_and_read_back_before_power() {
    let yaml = "{id: 10, position_range: 12.5, watchdog_index: 0}";
    let mut drive = drive("cybergear", yaml, Common { torque_limit: 2.0, ..COMMON });
    let mut sent = Vec::new();
    for _ in 0..3 {
        sent.extend(cycle(&mut *drive, DriveCommand::Off));
        sent.extend(cycle(&mut *drive, DriveCommand::Off));
        receive(&mut *drive, "11000AFD#0570000000000000");
    }
    // limit_torque 2.0
    assert!(sent.contains(&"1200FD0A#0B70000000000040".to_owned()), "{sent:?}");
    let is_ready = |drive: &mut dyn Drive| {
        receive(drive, STOPPED);
        cycle(drive, DriveCommand::On(Setpoint::default()))[0].starts_with("01")
    };
    assert!(!is_ready(&mut *drive), "it was not read");
    cycle(&mut *drive, DriveCommand::Off);
    receive(&mut *drive, "11000AFD#0B70000000004041");
    assert_eq!(drive.state().fault, fault::LIMIT_REFUSED, "12 N m");
    (0..4).for_each(|_| {
        cycle(&mut *drive, DriveCommand::Off);
    });
    receive(&mut *drive, "11000AFD#0B70000000000040");
    assert_eq!(drive.state().fault, 0);
    assert!(is_ready(&mut *drive));
}

#[test]
fn what_only_a_host_sends_is_foreign() {
    let mut drive = enabled(COMMON);
    for text in ["017FFF0A#7FFF7FFF00000000", "0300FD0A#0000000000000000", "040001 0A#00"] {
        let text = text.replace(' ', "");
        assert_eq!(receive(&mut *drive, &text), Receipt::Foreign, "{text}");
    }
    assert_eq!(receive(&mut *drive, "0300FD0B#0000000000000000"), Receipt::NotMine);
}

#[test]
fn feedback_is_followed_over_the_ends_of_its_range() {
    let mut drive = enabled(COMMON);
    receive(&mut *drive, "02800AFD#C0007FFF7FFF012C");
    receive(&mut *drive, "02800AFD#FFF07FFF7FFF012C");
    let Receipt::Measured(measured) = receive(&mut *drive, "02800AFD#00107FFF7FFF012C") else {
        panic!()
    };
    assert!((measured.position - (12.5 + 17.0 * 25.0 / 65535.0)).abs() < 1e-9);
    assert_eq!(drive.state().fault, fault::OUT_OF_RANGE);
}

#[test]
fn a_robstride_has_its_own_ranges_and_another_watchdog() {
    let report =
        try_drive("cybergear", "{id: 1, model: robstride, position_range: 12.57}", COMMON, "")
            .unwrap_err();
    assert_eq!(report.lines().count(), 4, "{report}");
    let yaml = "{id: 1, model: robstride, position_range: 12.57, velocity_range: 20, \
        torque_range: 60, stiffness_range: 5000, damping_range: 100}";
    let mut drive =
        drive("cybergear", yaml, Common { mode: Mode::Torque, watchdog_ms: 1000, ..COMMON });
    let mut sent = Vec::new();
    for _ in 0..8 {
        sent.extend(cycle(&mut *drive, DriveCommand::Off));
        receive(&mut *drive, "110001FD#0570000000000000");
    }
    assert!(sent.contains(&"1200FD01#28700000204E0000".to_owned()), "20000 are a second: {sent:?}");
    receive(&mut *drive, "110001FD#2870000000000000");
    assert_eq!(drive.state().watchdog, Watchdog::Off);
    survives_hostile_frames(&mut *drive, 2);
}

/// The frames of a drive for a new identifier and for storing a zero.
fn renumbered(settings: &str, id: u32) -> (Vec<String>, Vec<String>) {
    let mut drive = drive("cybergear", settings, COMMON);
    let mut renumber = FrameQueue::new(8);
    let mut save = FrameQueue::new(8);
    drive.set_id(id, &mut renumber);
    drive.save_zero(&mut save);
    let text = |queue: FrameQueue| queue.frames().iter().map(ToString::to_string).collect();
    (text(renumber), text(save))
}

#[test]
fn an_identifier_and_a_zero_are_stored_by_the_frames_of_others() {
    // update_id(10, 23) of PyPI's robstride 0.1.0 with the host 0xFD; Set_CAN_ID and
    // MotorDataSave of the maker's sample program for RobStride say the same
    let robstride = "{id: 10, model: robstride, position_range: 12.57, velocity_range: 20, \
        torque_range: 60, stiffness_range: 5000, damping_range: 100}";
    let (renumber, save) = renumbered(robstride, 23);
    assert_eq!(renumber, ["0717FD0A#0000000000000000"]);
    assert_eq!(save, ["1600FD0A#0102030405060708"]);
    // the identifier is that of set_can_id(23) of PyPI's python-cybergear 0.1.2, which has no rule
    // for the data; nothing stores a CyberGear's zero
    let (renumber, save) = renumbered("{id: 10, position_range: 12.5}", 23);
    assert_eq!(renumber, ["0717FD0A#0000000000000000"]);
    assert!(save.is_empty());
}
