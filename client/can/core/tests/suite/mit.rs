//! MIT mode in its four variants.

use crate::support::{
    COMMON, Random, cycle, drive, frame, is_toward_zero, last, receive, survives_hostile_frames,
    torque, try_drive,
};
use sarrus_can_core::drive::{Drive, DriveCommand, Measurement, Mode, Power, Receipt, Setpoint};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, fault};

pub(crate) const RANGES: &str = "position_range: 12.5, velocity_range: 45, torque_range: 18, \
    stiffness_range: 500, damping_range: 5";
const ZERO: Setpoint =
    Setpoint { position: 0.0, velocity: 0.0, torque: 0.0, stiffness: 0.0, damping: 0.0 };
pub(crate) const MOST: Setpoint =
    Setpoint { position: 12.5, velocity: 45.0, torque: 18.0, stiffness: 500.0, damping: 5.0 };

pub(crate) fn mit(variant: &str, common: Common) -> Box<dyn Drive> {
    drive("mit", &format!("{{variant: {variant}, id: 1, reply_id: 0x11, {RANGES}}}"), common)
}

/// A drive that follows set-points: enabled by the answers that its motor would give.
pub(crate) fn enabled(variant: &str, common: Common) -> Box<dyn Drive> {
    let mut drive = mit(variant, common);
    let (off, on) = match variant {
        "mini_cheetah" => ("011#0180007FF7FF", "011#0180007FF7FF"),
        "damiao" => ("011#0180007FF7FF1E1E", "011#1180007FF7FF1E1E"),
        _ => ("011#0180007FF7FF0000", "011#0180007FF7FF0000"),
    };
    for _ in 0..16 {
        for request in cycle(&mut *drive, DriveCommand::Off) {
            match request.strip_prefix("7FF#0100") {
                Some("33150000000000") | Some("331500000000") => {
                    receive(&mut *drive, "011#0100331500004841")
                }
                Some("331600000000") => receive(&mut *drive, "011#0100331600003442"),
                Some("331700000000") => receive(&mut *drive, "011#0100331700009041"),
                Some("330900000000") => receive(&mut *drive, "011#01003309E8030000"),
                Some("330A00000000") => receive(&mut *drive, "011#0100330A01000000"),
                Some(written) => receive(&mut *drive, &format!("011#0100{written}")),
                None => receive(&mut *drive, off),
            };
        }
    }
    assert_eq!(drive.state().power, Power::Off);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(MOST)),
        ["001#7FFF7FF0000007FF"],
        "nothing is asked before power"
    );
    receive(&mut *drive, off);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFC"]);
    assert_eq!(drive.state().power, Power::Starting);
    // a motor that does not report its state may still answer earlier commands
    for _ in 1..if variant == "damiao" { 1 } else { 4 } {
        receive(&mut *drive, on);
        assert_eq!(drive.state().power, Power::Starting, "{variant}");
        assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFC"]);
    }
    receive(&mut *drive, on);
    assert_eq!(drive.state().power, Power::On, "{variant}");
    drive
}

/// Takes a set-point apart bit by bit, without the crate's own arithmetic.
fn decode(bytes: &[u8]) -> [f64; 5] {
    let bits = bytes.iter().fold(0_u64, |bits, byte| bits << 8 | u64::from(*byte));
    let field = |shift: u32, width: u32, low: f64, high: f64| {
        let code = (bits >> shift) & ((1 << width) - 1);
        low + code as f64 * ((high - low) / ((1_u64 << width) - 1) as f64)
    };
    [
        field(48, 16, -12.5, 12.5),
        field(36, 12, -45.0, 45.0),
        field(24, 12, 0.0, 500.0),
        field(12, 12, 0.0, 5.0),
        field(0, 12, -18.0, 18.0),
    ]
}

#[test]
fn known_frames_come_out() {
    // the neutral command and the special ones as the mini cheetah's documentation has them
    let mut drive = enabled("mini_cheetah", COMMON);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(ZERO)),
        ["001#8000800000000800"],
        "the codes above zero in their turn"
    );
    assert_eq!(cycle(&mut *drive, DriveCommand::On(ZERO)), ["001#7FFF7FF0000007FF"]);
    let setpoint =
        Setpoint { position: 12.5, velocity: -45.0, torque: 18.0, stiffness: 250.1, damping: 1.0 };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["001#FFFF000800333FFF"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["001#FFFFFFFFFFFFFFFD"]);
    let mut queue = FrameQueue::new(4);
    drive.disable(&mut queue);
    assert!(drive.set_zero(&mut queue));
    drive.probe(&mut queue);
    let frames: Vec<String> = queue.frames().iter().map(ToString::to_string).collect();
    assert_eq!(frames, ["001#FFFFFFFFFFFFFFFD", "001#FFFFFFFFFFFFFFFE", "001#FFFFFFFFFFFFFFFD"]);
}

#[test]
fn random_set_points_are_the_nearest_and_no_torque_or_gain_grows() {
    let mut drive = enabled("mini_cheetah", COMMON);
    let mut random = Random(5);
    let steps = [25.0 / 65535.0, 90.0 / 4095.0, 500.0 / 4095.0, 5.0 / 4095.0, 36.0 / 4095.0];
    for _ in 0..100_000 {
        let setpoint = Setpoint {
            position: random.between(-12.5, 12.5),
            velocity: random.between(-45.0, 45.0),
            torque: random.between(-18.0, 18.0),
            // from the first code on
            stiffness: random.between(0.13, 500.0),
            damping: random.between(0.0013, 5.0),
        };
        let sent = decode(last(&mut *drive, DriveCommand::On(setpoint)).data());
        let setpoint = [
            setpoint.position,
            setpoint.velocity,
            setpoint.stiffness,
            setpoint.damping,
            setpoint.torque,
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
    }
}

#[test]
fn random_replies_are_within_half_a_step() {
    let mut random = Random(6);
    for variant in ["mini_cheetah", "t_motor", "damiao", "robstride"] {
        for _ in 0..25_000 {
            let mut drive = mit(variant, COMMON);
            let p = random.between(-12.5, 12.5);
            let v = random.between(-45.0, 45.0);
            let t = random.between(-18.0, 18.0);
            // the firmware's own way: truncated, not rounded
            let code =
                |value: f64, half: f64, most: f64| ((value + half) * most / (2.0 * half)) as u64;
            let bits = 1_u64 << 40
                | code(p, 12.5, 65535.0) << 24
                | code(v, 45.0, 4095.0) << 12
                | code(t, 18.0, 4095.0);
            let tail = if variant == "mini_cheetah" { "" } else { "0100" };
            let Receipt::Measured(measured) =
                receive(&mut *drive, &format!("011#{bits:012X}{tail}"))
            else {
                panic!("{variant}")
            };
            assert!((measured.position - p).abs() <= 25.0 / 65535.0);
            assert!((measured.velocity - v).abs() <= 90.0 / 4095.0);
            assert!((measured.torque - t).abs() <= 36.0 / 4095.0);
            let whole = |value: f64, half: f64, most: f64| {
                ((value + half) / (2.0 * half) * most).round() as u64
            };
            let back = 1_u64 << 40
                | whole(measured.position, 12.5, 65535.0) << 24
                | whole(measured.velocity, 45.0, 4095.0) << 12
                | whole(measured.torque, 18.0, 4095.0);
            assert_eq!(back, bits, "the codes themselves are exact");
        }
    }
}

#[test]
fn no_set_point_is_a_special_command() {
    let special = |variant: &str, bytes: &[u8]| match variant {
        // a RobStride looks at the first six bytes and the last
        "robstride" => bytes[..6].iter().all(|byte| *byte == 0xFF),
        _ => bytes[..7].iter().all(|byte| *byte == 0xFF) && (0xFB..=0xFE).contains(&bytes[7]),
    };
    for variant in ["mini_cheetah", "t_motor", "damiao", "robstride"] {
        let mut drive = enabled(variant, COMMON);
        for code in 0..=4095 {
            let torque = -18.0 + 36.0 * f64::from(code) / 4095.0;
            for damping in [5.0, 4.99] {
                let bytes =
                    last(&mut *drive, DriveCommand::On(Setpoint { torque, damping, ..MOST }));
                assert!(!special(variant, bytes.data()), "{variant}: {bytes}");
                let sent = decode(bytes.data());
                assert!((sent[4] - torque).abs() <= 4.1 * 36.0 / 4095.0);
                assert!((sent[0] - 12.5).abs() <= 1.1 * 25.0 / 65535.0);
            }
        }
    }
    let torque = -18.0 + 36.0 * f64::from(0xFFD) / 4095.0;
    let mut drive = enabled("damiao", COMMON);
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(Setpoint { torque, ..MOST })),
        ["001#FFFFFFFFFFFFFFFA"]
    );
    assert_eq!(cycle(&mut *drive, DriveCommand::On(MOST)), ["001#FFFFFFFFFFFFFFFF"]);
}

#[test]
fn zero_is_half_a_step_off_and_right_on_average() {
    let mut drive = enabled("mini_cheetah", COMMON);
    let mut sum = [0.0; 5];
    for _ in 0..100 {
        let sent = decode(last(&mut *drive, DriveCommand::On(ZERO)).data());
        assert!((sent[4].abs() - 18.0 / 4095.0).abs() < 1e-12);
        (0..5).for_each(|i| sum[i] += sent[i]);
    }
    assert!(sum.iter().all(|sum| sum.abs() < 1e-9), "{sum:?}");
}

#[test]
fn set_points_saturate() {
    let mut drive = enabled("mini_cheetah", COMMON);
    let beyond = Setpoint {
        position: -1e9,
        velocity: 1e9,
        torque: -f64::MAX,
        stiffness: f64::MAX,
        damping: -1.0,
    };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(beyond)), ["001#0000FFFFFF000000"]);
    let mut drive = enabled("mini_cheetah", Common { torque_limit: 9.0, ..COMMON });
    let sent = decode(last(&mut *drive, DriveCommand::On(torque(18.0))).data())[4];
    assert!(is_toward_zero(sent, 9.0, 36.0 / 4095.0), "{sent}");
    let mut drive = enabled("mini_cheetah", Common { mode: Mode::Torque, ..COMMON });
    let sent = decode(last(&mut *drive, DriveCommand::On(MOST)).data());
    assert_eq!((sent[2], sent[3], sent[4]), (0.0, 0.0, 18.0));
    assert!(sent[0].abs() < 1e-3, "a motor in torque mode gets no position");
}

#[test]
fn feedback_is_followed_over_the_ends_of_its_range() {
    let mut drive = mit("mini_cheetah", COMMON);
    let mut position = |code: u16| match receive(&mut *drive, &format!("011#01{code:04X}7FF7FF")) {
        Receipt::Measured(measured) => (measured.position, drive.state().fault),
        other => panic!("{other:?}"),
    };
    assert_eq!(position(0xF000).1, 0);
    let (last, _) = position(0xFFF0);
    let (next, fault) = position(0x0010);
    assert!((next - last - 32.0 * 25.0 / 65535.0).abs() < 1e-12, "{last} {next}");
    assert_eq!(fault, fault::OUT_OF_RANGE);
    assert!(position(0x4000).0 > 18.0);
    position(0x0010);
    assert_eq!(position(0xF000).1, 0, "back inside");
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    for variant in ["mini_cheetah", "t_motor", "damiao", "robstride"] {
        let mut drive = mit(variant, COMMON);
        for text in [
            "012#0180007FF7FF",
            "00000011#0180007FF7FF0000",
            "011#0280007FF7FF",
            "011#0280007FF7FF0000",
        ] {
            assert_eq!(receive(&mut *drive, text), Receipt::NotMine, "{variant} {text}");
        }
        for text in ["011#", "011#01", "011#0180007FF7", "011##10180007FF7FF0000"] {
            assert_eq!(receive(&mut *drive, text), Receipt::Malformed, "{variant} {text}");
        }
        assert_eq!(drive.state().power, Power::Unknown);
        for (len, known) in [
            (6, &["mini_cheetah", "t_motor"][..]),
            (7, &["mini_cheetah"]),
            (8, &["mini_cheetah", "t_motor", "damiao", "robstride"]),
        ] {
            let receipt = receive(&mut *drive, &"011#0180007FF7FF1E1E"[..4 + 2 * len]);
            match known.contains(&variant) {
                true => assert!(matches!(receipt, Receipt::Measured(_)), "{variant} {len}"),
                false => assert_eq!(receipt, Receipt::Malformed, "{variant} {len}"),
            }
        }
    }
}

#[test]
fn what_only_the_bridge_sends_is_foreign() {
    for variant in ["mini_cheetah", "t_motor", "damiao", "robstride"] {
        let mut drive = mit(variant, COMMON);
        for text in ["001#FFFFFFFFFFFFFFFC", "001#7FFF7FF0000007FF"] {
            assert_eq!(receive(&mut *drive, text), Receipt::Foreign, "{variant}");
        }
        let of_registers = [
            receive(&mut *drive, "7FF#0100330A00000000"),
            receive(&mut *drive, "7FF#0200330A00000000"),
        ];
        let has_registers = variant == "damiao";
        let first = if has_registers { Receipt::Foreign } else { Receipt::NotMine };
        assert_eq!(of_registers, [first, Receipt::NotMine], "{variant}");
    }
}

#[test]
fn the_reply_of_the_mini_cheetahs_author_is_read() {
    // pack_reply of can.c in bgkatz/motorcontrol (2023-07-02), with the ranges P 12.5, V 65, T 18,
    // VB 0 … 40, compiled and called with id 1, 3.0 rad, -20.0 rad/s, 5.0 N m, 24.0 V
    let ranges = RANGES.replace("velocity_range: 45", "velocity_range: 65");
    let yaml = format!("{{variant: mini_cheetah, id: 1, reply_id: 0, {ranges}}}");
    let mut drive = drive("mit", &yaml, COMMON);
    let Receipt::Measured(measured) = receive(&mut *drive, "000#019EB7589A3899") else { panic!() };
    assert!((measured.position - 3.0).abs() < 4e-4, "{measured:?}");
    assert!((measured.velocity + 20.0).abs() < 0.032, "{measured:?}");
    assert!((measured.torque - 5.0).abs() < 0.009, "{measured:?}");
}

#[test]
fn a_robstride_is_asked_for_its_faults() {
    // RobStride 00 manual (2026-01), command 5: F_CMD other than FF reads; the answer is the
    // motor's id and 32 bits, of which bit 0 is over-temperature and bit 14 overload
    let at = |drive: &mut dyn Drive, now_ms: u64| {
        let mut queue = FrameQueue::new(4);
        drive.cycle(now_ms * 1_000_000, DriveCommand::Off, &mut queue);
        queue.frames().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    let mut drive = mit("robstride", COMMON);
    assert_eq!(at(&mut *drive, 0), ["001#FFFFFFFFFFFF00FB", "001#FFFFFFFFFFFFFFFD"]);
    assert!(matches!(receive(&mut *drive, "011#0180007FF7FF0131"), Receipt::Measured(_)));
    assert_eq!(receive(&mut *drive, "011#0100000000000000"), Receipt::Noted, "none");
    assert_eq!(drive.state().fault, 0);
    assert_eq!(at(&mut *drive, 10).len(), 1, "not yet");
    assert_eq!(at(&mut *drive, 20).len(), 2);
    assert_eq!(receive(&mut *drive, "011#0101400000000000"), Receipt::Noted);
    assert_eq!(drive.state().fault, 0x4001);
    receive(&mut *drive, "011#0180007FF7FF0131");
    assert_eq!(drive.state().fault, 0x4001, "feedback does not say that it is gone");
    at(&mut *drive, 40);
    let cold = receive(&mut *drive, "011#0180007FF8000000");
    assert!(matches!(cold, Receipt::Measured(_)), "a motor at 0.0 °C with no torque");
    cycle(&mut *drive, DriveCommand::Reset);
    assert_eq!(drive.state().fault, 0);
}

#[test]
fn temperatures_and_errors_are_read() {
    let of = |variant: &str, text: &str| {
        let mut drive = mit(variant, COMMON);
        match receive(&mut *drive, text) {
            Receipt::Measured(Measurement { temperature, .. }) => {
                (temperature, drive.state().fault)
            }
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(of("t_motor", "011#0180007FF7FF1E02"), (-10.0, 2));
    assert_eq!(of("damiao", "011#D180007FF7FF2A30"), (48.0, 0xD));
    assert_eq!(of("damiao", "011#1180007FF7FF2A30"), (48.0, 0));
    assert_eq!(of("robstride", "011#0180007FF7FF0131"), (30.5, 0));
    assert!(of("mini_cheetah", "011#0180007FF7FF").0.is_nan());
}

#[test]
fn hostile_frames_do_no_harm() {
    for (seed, variant) in
        ["mini_cheetah", "t_motor", "damiao", "robstride"].into_iter().enumerate()
    {
        survives_hostile_frames(&mut *mit(variant, COMMON), seed as u64);
    }
}

#[test]
fn a_motor_cannot_answer_on_its_own_identifier() {
    let report =
        try_drive("mit", &format!("{{variant: damiao, id: 1, reply_id: 1, {RANGES}}}"), COMMON, "")
            .unwrap_err();
    assert!(report.contains("drive.yml:1:"), "{report}");
    assert!(report.contains("`id` and `reply_id` are both 1"), "{report}");
    let report = try_drive("mit", "{variant: damiao, id: 1, reply_id: 2}", COMMON, "").unwrap_err();
    assert_eq!(report.lines().count(), 5, "every missing range is reported: {report}");
    assert_eq!(frame("7FF##1010203").to_string(), "7FF##1010203");
}
