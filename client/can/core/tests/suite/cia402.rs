//! CANopen drives of the profile CiA 402.

use std::f64::consts::TAU;

use crate::support::{
    COMMON, Random, cycle, drive, is_toward_zero, receive, survives_hostile_frames, torque,
    try_drive,
};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Setpoint, Watchdog};
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_core::protocol::{Common, fault};

const YAML: &str = "{node: 5, rated_torque: 2.0, counts_per_turn: 65536, torque_offset: true}";
/// Assessed settings: heartbeat of node 127 after 50 ms, no voltage without it, 2000 mN m.
const HEARTBEAT_OF: &str = "585#4316100132007F00";
const WITHOUT_IT: &str = "585#4B07600002000000";
const RATED: &str = "585#43766000D0070000";

fn cia402(mode: Mode) -> Box<dyn Drive> {
    let common = Common { torque_limit: 4.0, period_ns: 2_000_000, ..COMMON };
    drive("cia402", YAML, Common { mode, watchdog_ms: 50, ..common })
}

/// Answers requests as a drive with nothing to complain would; gives the requests.
fn set_up(drive: &mut dyn Drive, mode: u8) -> Vec<String> {
    set_up_but(drive, mode, "585#0000000000000000")
}

/// As [`set_up`], with one answer in the place of that for its object.
fn set_up_but(drive: &mut dyn Drive, mode: u8, other: &str) -> Vec<String> {
    let mut requests = Vec::new();
    for _ in 0..60 {
        for frame in cycle(drive, DriveCommand::Off) {
            let Some(request) = frame.strip_prefix("605#") else {
                if frame.starts_with("000#") {
                    requests.push(frame);
                }
                continue;
            };
            let object = &request[2..8];
            let is_other = other[6..].starts_with(object)
                && (&other[4..6] == "80" || (&other[4..6] == "60") != (&request[..2] == "40"));
            match (&request[..2], object) {
                _ if is_other => receive(drive, other),
                ("40", "161001") => receive(drive, HEARTBEAT_OF),
                ("40", "076000") => receive(drive, WITHOUT_IT),
                ("40", "766000") => receive(drive, RATED),
                ("40", _) => receive(drive, &format!("585#4F{object}{mode:02X}000000")),
                _ => receive(drive, &format!("585#60{object}00000000")),
            };
            requests.push(frame);
        }
    }
    requests
}

/// A drive in the state operation enabled, by the steps of the state machine.
fn enabled(mode: Mode, number: u8) -> Box<dyn Drive> {
    let mut drive = cia402(mode);
    set_up(&mut *drive, number);
    let mut control = |status: &str, expected: &str| {
        receive(&mut *drive, &format!("185#{status}000000000000"));
        receive(&mut *drive, "285#00000000");
        let sent = cycle(&mut *drive, DriveCommand::On(Setpoint::default()));
        assert_eq!(sent.len(), 1);
        assert_eq!(sent[0][..8], format!("205#{expected}"), "{status}");
        drive.state().power
    };
    assert_eq!(control("5002", "0600"), Power::Starting);
    assert_eq!(control("3102", "0700"), Power::Starting);
    assert_eq!(control("3302", "0F00"), Power::Starting);
    assert_eq!(control("3702", "0F00"), Power::On);
    assert_eq!(drive.state().fault, 0);
    drive
}

#[test]
fn a_drive_is_set_up_by_sdo_and_then_started() {
    let mut drive = cia402(Mode::Position);
    let requests = set_up(&mut *drive, 8);
    let expected = [
        "000#8005",
        "605#2B40600000000000",
        // the set-points' PDO: off, with SYNC, control word, position, torque, on
        "605#2300140105020080",
        "605#2F00140201000000",
        "605#2F00160000000000",
        "605#2300160110004060",
        "605#2300160220007A60",
        "605#230016031000B260",
        "605#2F00160003000000",
        "605#2300140105020000",
        // status word, position, torque
        "605#2300180185010080",
        "605#2F00180201000000",
        "605#2F001A0000000000",
        "605#23001A0110004160",
        "605#23001A0220006460",
        "605#23001A0310007760",
        "605#2F001A0003000000",
        "605#2300180185010000",
        // velocity
        "605#2301180185020080",
        "605#2F01180201000000",
        "605#2F011A0000000000",
        "605#23011A0120006C60",
        "605#2F011A0001000000",
        "605#2301180185020000",
        // mode, 2 ms between set-points, 2000 thousandths, no voltage when node 127 is not heard
        // for 50 ms
        "605#2F60600008000000",
        "605#2FC26002FD000000",
        "605#2FC2600102000000",
        "605#2B726000D0070000",
        "605#2B07600002000000",
        "605#2316100132007F00",
        "605#4072600000000000",
        "605#4016100100000000",
        "605#4007600000000000",
        "605#4076600000000000",
        "605#4061600000000000",
        "000#0105",
    ];
    assert_eq!(requests, expected);
    assert_eq!((drive.state().watchdog, drive.state().fault), (Watchdog::Set(50), 0));
}

#[test]
fn a_drive_with_another_rated_torque_or_mode_or_without_them_gets_no_power() {
    for (answer, fault) in [
        ("585#43766000B80B0000", fault::RANGES_DIFFER),
        ("585#8076600000000206", fault::SETTING_REFUSED),
        ("585#8061600000000206", fault::SETTING_REFUSED),
        ("585#8060600000000206", fault::SETTING_REFUSED),
    ] {
        let mut drive = cia402(Mode::Torque);
        let requests = set_up_but(&mut *drive, 10, answer);
        assert_eq!(drive.state().fault, fault, "{answer}");
        assert!(!requests.contains(&"000#0105".to_owned()), "{answer}");
        receive(&mut *drive, "185#5002000000000000");
        let sent = cycle(&mut *drive, DriveCommand::On(torque(1.0)));
        assert_eq!(sent, ["205#00000000"]);
    }
}

#[test]
fn a_drive_that_shows_its_mode_later_is_asked_again() {
    // the mode that it shows first, and until when; from 2 s on it is to have power, and has it
    let shown = |first: &str, since_ms: u64| {
        let mut drive = cia402(Mode::Torque);
        let mut started_ms = None;
        let mut seen = Vec::new();
        for now_ms in (0..4_000).step_by(2) {
            let mut queue = FrameQueue::new(8);
            let command = if now_ms < 2_000 {
                DriveCommand::Off
            } else {
                DriveCommand::On(Setpoint::default())
            };
            drive.cycle(now_ms * 1_000_000, command, &mut queue);
            for frame in queue.frames() {
                let text = frame.to_string();
                if text == "000#0105" {
                    started_ms = Some(now_ms);
                }
                let Some(request) = text.strip_prefix("605#") else { continue };
                let object = &request[2..8];
                let mode = if now_ms < since_ms { first } else { "0A" };
                let answer = match (&request[..2], object) {
                    ("40", "161001") => HEARTBEAT_OF.to_owned(),
                    ("40", "076000") => WITHOUT_IT.to_owned(),
                    ("40", "766000") => RATED.to_owned(),
                    ("40", _) => format!("585#4F{object}{mode}000000"),
                    _ => format!("585#60{object}00000000"),
                };
                drive.receive(now_ms * 1_000_000, &crate::support::frame(&answer));
            }
            if started_ms.is_some() {
                let status = if now_ms < 2_100 { "5002" } else { "3702" };
                let status = crate::support::frame(&format!("185#{status}000000000000"));
                drive.receive(now_ms * 1_000_000, &status);
            }
            if [1_998, 2_500, 3_998].contains(&now_ms) {
                seen.push((drive.state().fault, drive.state().power));
            }
        }
        assert!(started_ms.is_some());
        seen
    };
    let off = (0, Power::Off);
    let on = (0, Power::On);
    assert_eq!(shown("00", 0), [off, on, on]);
    assert_eq!(shown("01", 200), [off, on, on], "before the start");
    assert_eq!(shown("01", 1_000), [off, on, on], "once it is operational");
    let [before, starts, late] = shown("00", 2_800)[..] else { panic!() };
    assert_eq!((before, starts.1, late), (off, Power::Starting, on), "with power");
    assert_eq!(shown("00", 100_000)[2].0, fault::MODE_REFUSED, "not even with power");
    assert_eq!(shown("01", 100_000)[0].0, fault::MODE_REFUSED, "no power in another mode");
}

#[test]
fn its_own_loops_are_limited_or_get_no_power() {
    for (mode, number, answer, expected) in [
        (Mode::Position, 8, "585#8072600000000206", fault::LIMIT_REFUSED),
        (Mode::Velocity, 9, "585#4B726000B80B0000", fault::LIMIT_REFUSED),
        (Mode::Velocity, 9, "585#4B726000D0070000", 0),
        (Mode::Torque, 10, "585#8072600000000206", 0),
    ] {
        let mut drive = cia402(mode);
        let requests = set_up_but(&mut *drive, number, answer);
        assert_eq!(drive.state().fault, expected, "{answer}");
        assert_eq!(requests.contains(&"000#0105".to_owned()), expected == 0, "{answer}");
    }
}

#[test]
fn a_watchdog_counts_if_the_drive_says_what_it_does() {
    for (answer, watchdog) in [
        ("585#4B07600001000000", Watchdog::Set(50)),
        ("585#4B07600000000000", Watchdog::Off),
        ("585#4B076000FFFF0000", Watchdog::Unreadable),
        ("585#8007600000000206", Watchdog::Unreadable),
        ("585#8016100100000206", Watchdog::Unreadable),
        ("585#4316100100007F00", Watchdog::Off),
    ] {
        let mut drive = cia402(Mode::Torque);
        set_up_but(&mut *drive, 10, answer);
        let is_refused = answer.starts_with("585#8016");
        // a drive must take the heartbeat; that it can be read is another matter
        assert_eq!(
            drive.state().watchdog,
            if is_refused { Watchdog::Unknown } else { watchdog },
            "{answer}"
        );
    }
}

#[test]
fn the_time_between_set_points_is_told_in_a_unit_that_holds_it() {
    let offers = |period_ns: u64, mode: Mode, number: u8, other: &str| {
        let common = Common { torque_limit: 4.0, period_ns, ..COMMON };
        let mut drive = drive("cia402", YAML, Common { mode, watchdog_ms: 50, ..common });
        let requests = set_up_but(&mut *drive, number, other);
        requests
            .into_iter()
            .filter(|request| request[6..].starts_with("C260"))
            .map(|request| request[10..14].to_owned())
            .collect::<Vec<_>>()
    };
    const TAKEN: &str = "585#0000000000000000";
    assert_eq!(offers(1_000_000, Mode::Velocity, 9, TAKEN), ["02FD", "0101"]);
    assert_eq!(
        offers(2_500_000, Mode::Position, 8, TAKEN),
        ["02FC", "0119"],
        "25 of 100 microseconds"
    );
    assert_eq!(offers(250_000, Mode::Position, 8, TAKEN), ["02FB", "0119"]);
    assert_eq!(offers(1_000_000_000, Mode::Position, 8, TAKEN), ["02FE", "0164"]);
    assert_eq!(offers(3_333_333, Mode::Position, 8, TAKEN), ["02FC", "0121"], "the nearest");
    assert!(offers(1_000_000, Mode::Torque, 10, TAKEN).is_empty());
    const REFUSED: &str = "585#80C2600200000206";
    assert_eq!(
        offers(2_000_000, Mode::Position, 8, REFUSED),
        ["02FD", "0102"],
        "milliseconds are the default"
    );
    assert_eq!(offers(2_500_000, Mode::Position, 8, REFUSED), ["02FC"], "25 would be milliseconds");
}

#[test]
fn random_values_are_within_half_a_step_both_ways() {
    let mut random = Random(10);
    let (mut position, mut velocity, mut torque_drive) =
        (enabled(Mode::Position, 8), enabled(Mode::Velocity, 9), enabled(Mode::Torque, 10));
    let count = TAU / 65536.0;
    for _ in 0..100_000 {
        let setpoint = Setpoint {
            position: random.between(-2000.0, 2000.0),
            velocity: random.between(-300.0, 300.0),
            torque: random.between(-4.0, 4.0),
            ..Setpoint::default()
        };
        let number = |frame: &Frame| i32::from_le_bytes(frame.data()[2..6].try_into().unwrap());
        let last_two = |frame: &Frame| {
            i16::from_le_bytes(frame.data()[frame.data().len() - 2..].try_into().unwrap())
        };
        let encode = |drive: &mut dyn Drive| {
            let mut queue = FrameQueue::new(1);
            drive.encode(&setpoint, &mut queue);
            queue.frames()[0]
        };
        let half = |sent: f64, setpoint: f64, step: f64| {
            assert!((sent - setpoint).abs() <= step / 2.0 * (1.0 + 1e-9), "{sent} {setpoint}")
        };
        let sent = encode(&mut *position);
        half(f64::from(number(&sent)) * count, setpoint.position, count);
        half(f64::from(number(&encode(&mut *velocity))) * count, setpoint.velocity, count);
        for sent in [sent, encode(&mut *torque_drive)] {
            assert!(is_toward_zero(f64::from(last_two(&sent)) * 0.002, setpoint.torque, 0.002));
        }

        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
        let p = (setpoint.position / count).round() as i32;
        let (v, t) =
            ((setpoint.velocity / count).round() as i32, (setpoint.torque / 0.002).round() as i16);
        receive(
            &mut *position,
            &format!("185#3702{}{}", hex(&p.to_le_bytes()), hex(&t.to_le_bytes())),
        );
        let Receipt::Measured(measured) =
            receive(&mut *position, &format!("285#{}", hex(&v.to_le_bytes())))
        else {
            panic!()
        };
        half(measured.position, setpoint.position, count);
        half(measured.velocity, setpoint.velocity, count);
        half(measured.torque, setpoint.torque, 0.002);
    }
}

#[test]
fn a_position_goes_on_where_its_32_bits_begin_again() {
    let mut drive = cia402(Mode::Torque);
    set_up(&mut *drive, 10);
    receive(&mut *drive, "185#5002FFFFFF7F0000");
    let Receipt::Measured(before) = receive(&mut *drive, "285#00000000") else { panic!() };
    receive(&mut *drive, "185#5002010000800000");
    let Receipt::Measured(after) = receive(&mut *drive, "285#00000000") else { panic!() };
    assert!((after.position - before.position - 2.0 * TAU / 65536.0).abs() < 1e-6);
    assert_eq!(drive.state().fault, 0, "a torque can be said anywhere");
}

#[test]
fn beyond_its_32_bits_no_position_can_be_commanded() {
    let mut drive = enabled(Mode::Position, 8);
    receive(&mut *drive, "185#3702FFFFFF7F0000");
    assert_eq!(drive.state().fault, 0);
    receive(&mut *drive, "185#3702000000800000");
    assert_eq!((drive.state().fault, drive.state().power), (fault::OUT_OF_RANGE, Power::On));
    receive(&mut *drive, "185#3702FFFFFF7F0000");
    assert_eq!(drive.state().fault, 0);
    // the other end
    receive(&mut *drive, "185#3702000000000000");
    receive(&mut *drive, "185#3702000000800000");
    assert_eq!(drive.state().fault, 0);
    receive(&mut *drive, "185#3702FFFFFF7F0000");
    assert_eq!(drive.state().fault, fault::OUT_OF_RANGE);
}

#[test]
fn a_velocity_without_its_position_is_no_measurement() {
    let mut drive = enabled(Mode::Torque, 10);
    receive(&mut *drive, "185#3702010000000000");
    assert!(matches!(receive(&mut *drive, "285#00000000"), Receipt::Measured(_)));
    assert_eq!(
        receive(&mut *drive, "285#00000000"),
        Receipt::Noted,
        "the position is that of the cycle before"
    );
    receive(&mut *drive, "185#3702010000000000");
    assert!(matches!(receive(&mut *drive, "285#00000000"), Receipt::Measured(_)));
}

#[test]
fn what_a_pdo_holds_is_not_known_before_it_was_set_up() {
    let mut drive = cia402(Mode::Torque);
    for text in ["185#3702FFFFFF7F0000", "285#00000000"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Noted, "{text}");
    }
    assert_eq!(drive.state().power, Power::Unknown);
}

/// A drive with its simulated motor, set up.
#[test]
fn a_drive_that_is_not_operational_any_more_is_set_up_anew() {
    let at = |drive: &mut dyn Drive, now_ms: u64, text: &str| {
        drive.receive(now_ms * 1_000_000, &crate::support::frame(text))
    };
    let mut drive = cia402(Mode::Torque);
    set_up(&mut *drive, 10);
    at(&mut *drive, 10, "185#5002000000000000");
    at(&mut *drive, 50, "705#7F");
    assert_eq!(drive.state().watchdog, Watchdog::Set(50), "it may have been sent before the start");
    at(&mut *drive, 200, "705#05");
    assert_eq!(drive.state().watchdog, Watchdog::Set(50));
    at(&mut *drive, 201, "705#7F");
    assert_eq!((drive.state().power, drive.state().watchdog), (Power::Unknown, Watchdog::Unknown));
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["205#00000000", "000#8005"]);
}

#[test]
fn faults_boots_and_losses_of_power_are_seen() {
    let mut drive = enabled(Mode::Torque, 10);
    receive(&mut *drive, "085#3081100000000000");
    assert_eq!(drive.state().fault, 0x8130, "the heartbeat was late");
    receive(&mut *drive, "185#1802000000000000");
    assert_eq!(drive.state().power, Power::Off);
    let mut drive = enabled(Mode::Torque, 10);
    receive(&mut *drive, "185#3302000000000000");
    assert_eq!(drive.state().fault, fault::POWER_LOST);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(torque(1.0)))[0],
        "205#00000000",
        "no power again by itself"
    );
    cycle(&mut *drive, DriveCommand::Off);
    assert_eq!(drive.state().fault, 0);
    assert_eq!(cycle(&mut *drive, DriveCommand::Reset), ["205#80000000"]);
    let mut drive = enabled(Mode::Torque, 10);
    receive(&mut *drive, "705#00");
    assert_eq!((drive.state().power, drive.state().watchdog), (Power::Unknown, Watchdog::Unknown));
    assert!(drive.state().fault != 0, "it booted while it followed");
}

#[test]
fn frames_that_take_power_away_work_with_and_without_sync() {
    let drive = cia402(Mode::Torque);
    let mut queue = FrameQueue::new(4);
    drive.disable(&mut queue);
    let frames: Vec<String> = queue.frames().iter().map(Frame::to_string).collect();
    assert_eq!(frames, ["205#00000000", "080#", "605#2B40600000000000"]);
    assert_eq!(drive.sync().unwrap().to_string(), "080#");
}

#[test]
fn the_heartbeat_goes_out_eight_times_in_its_time() {
    let mut drive = cia402(Mode::Torque);
    let mut beats = 0;
    for now_ms in 0..1000_u64 {
        let mut queue = FrameQueue::new(8);
        drive.cycle(now_ms * 1_000_000, DriveCommand::Off, &mut queue);
        beats += queue.frames().iter().filter(|frame| frame.to_string() == "77F#05").count();
    }
    assert_eq!(beats, 143, "every 7 ms");
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = cia402(Mode::Torque);
    for text in ["186#5002000000000000", "00000185#5002000000000000", "206#0000", "080#"] {
        assert_eq!(receive(&mut *drive, text), Receipt::NotMine, "{text}");
    }
    for text in ["205#0F000000", "605#4061600000000000", "000#0105", "000#8200", "77F#05"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Foreign, "{text}");
    }
    assert_eq!(receive(&mut *drive, "000#0106"), Receipt::NotMine);
    for text in ["185#5002", "085#00", "585#00", "705#", "285#0000"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Malformed, "{text}");
    }
    assert_eq!(drive.state().power, Power::Unknown);
    survives_hostile_frames(&mut *drive, 4);
    let report =
        try_drive("cia402", "{node: 127, rated_torque: 1, counts_per_turn: 10}", COMMON, "")
            .unwrap_err();
    assert!(report.contains("1 to 126"), "{report}");
}
