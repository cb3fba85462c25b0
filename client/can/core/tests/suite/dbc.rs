//! Motors that a DBC file describes.

use crate::support::{COMMON, Random, is_toward_zero, survives_hostile_frames, try_drive};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Setpoint};
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_core::protocol::{Common, fault};

const FILE: &str = r#"VERSION ""
BU_: Host Motor
BO_ 257 Command: 8 Host
 SG_ Mux M : 0|4@1+ (1,0) [0|15] "" Motor
 SG_ Enable m1 : 4|1@1+ (1,0) [0|1] "" Motor
 SG_ Kind m1 : 5|3@1+ (1,0) [0|7] "" Motor
 SG_ Torque m1 : 15|16@0- (0.01,0) [-327|327] "Nm" Motor
 SG_ Velocity m2 : 8|24@1- (0.001,0) [0|0] "rad/s" Motor
BO_ 2147484673 State: 8 Motor
 SG_ Position : 7|20@0- (0.01,5) [0|0] "deg" Host
 SG_ Speed : 32|16@1- (0.1,0) [0|0] "deg/s" Host
 SG_ On : 48|1@1+ (1,0) [0|1] "" Host
 SG_ Fault : 56|8@1+ (1,0) [0|255] "" Host
"#;
const YAML: &str = "{file: motor.dbc, enable: Command.Enable, torque: Command.Torque, velocity: \
    Command.Velocity, \
    constants: Command.Kind=5, measured_position: State.Position, measured_velocity: State.Speed, \
    fault: State.Fault, enabled: State.On, \
    position_unit: 0.017453292519943295, velocity_unit: 0.017453292519943295}";

fn dbc(mode: Mode) -> Box<dyn Drive> {
    try_drive("dbc", YAML, Common { mode, ..COMMON }, FILE)
        .unwrap_or_else(|report| panic!("{report}"))
}

fn frames(drive: &mut dyn Drive, command: DriveCommand) -> Vec<Frame> {
    let mut queue = FrameQueue::new(8);
    drive.cycle(0, command, &mut queue);
    queue.frames().to_vec()
}

fn receive(drive: &mut dyn Drive, text: &str) -> Receipt {
    crate::support::receive(drive, text)
}

#[test]
fn a_measurement_without_a_step_of_its_counter_is_none() {
    let count = " SG_ Count : 52|4@1+ (1,0) [0|15] \"\" Host\n SG_ Fault";
    let file = FILE.replace(" SG_ Fault", count);
    let yaml = YAML.replace("enabled: State.On", "enabled: State.On, counter: State.Count");
    let mut drive = try_drive("dbc", &yaml, Common { mode: Mode::Torque, ..COMMON }, &file)
        .unwrap_or_else(|report| panic!("{report}"));
    assert!(drive.counts() && !dbc(Mode::Torque).counts());
    let mut measured = |byte: &str| {
        let receipt = receive(&mut *drive, &format!("00000401#000000000000{byte}00"));
        matches!(receipt, Receipt::Measured(_))
    };
    assert_eq!(
        ["10", "10", "20", "20", "20", "10"].map(&mut measured),
        [true, false, true, false, false, true]
    );
}

#[test]
fn every_value_of_the_switch_has_its_frame() {
    let mut drive = dbc(Mode::Torque);
    let setpoint = Setpoint { torque: -1.5, velocity: 2.0, ..Setpoint::default() };
    let text = |frames: Vec<Frame>| frames.iter().map(Frame::to_string).collect::<Vec<_>>();
    assert_eq!(
        text(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["101#A100000000000000", "101#0200000000000000"],
        "no power before a word of it"
    );
    receive(&mut *drive, "00000401#0000000000000000");
    assert_eq!(drive.state().power, Power::Off);
    // -150 hundredths are FF6A, 114592 thousandths of a degree a second are 01BFA0: first all of it
    // without power, then power with the last
    assert_eq!(
        text(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["101#A1FF6A0000000000", "101#02A0BF0100000000"]
    );
    assert_eq!(
        text(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["101#02A0BF0100000000", "101#B1FF6A0000000000"]
    );
    assert_eq!(drive.state().power, Power::Starting);
    receive(&mut *drive, "00000401#0000000000000100");
    assert_eq!(drive.state().power, Power::On);
    receive(&mut *drive, "00000401#0000000000000000");
    assert_eq!(drive.state().fault, fault::POWER_LOST);
    assert_eq!(
        text(frames(&mut *drive, DriveCommand::On(setpoint)))[0],
        "101#A100000000000000",
        "no power again by itself"
    );
    frames(&mut *drive, DriveCommand::Off);
    receive(&mut *drive, "00000401#0000000000000007");
    assert_eq!(drive.state().fault, 7);
}

#[test]
fn random_values_are_within_half_a_step_both_ways() {
    let mut random = Random(11);
    let mut drive = dbc(Mode::Torque);
    for _ in 0..100_000 {
        let setpoint = Setpoint {
            torque: random.between(-327.0, 327.0),
            velocity: random.between(-100.0, 100.0),
            ..Setpoint::default()
        };
        let mut queue = FrameQueue::new(2);
        drive.encode(&setpoint, &mut queue);
        let [velocity, torque] = queue.frames() else { panic!() };
        let sent = f64::from(i16::from_be_bytes([torque.data()[1], torque.data()[2]])) * 0.01;
        assert!(is_toward_zero(sent, setpoint.torque, 0.01));
        let bytes = velocity.data();
        // the file's unit is degrees a second
        let unit = 1_f64.to_radians();
        let sent =
            f64::from(i32::from_le_bytes([0, bytes[1], bytes[2], bytes[3]]) >> 8) * 0.001 * unit;
        assert!(
            (sent - setpoint.velocity).abs() <= 0.0005 * unit * (1.0 + 1e-9),
            "{sent} {}",
            setpoint.velocity
        );

        let position = random.between(-5000.0, 5000.0);
        let speed = random.between(-3000.0, 3000.0);
        let raw = ((position - 5.0) / 0.01_f64).round() as i32;
        let speed_raw = (speed / 0.1_f64).round() as i16;
        let top = (raw as u32) << 12;
        let [a, b, c, _] = top.to_be_bytes();
        let [e, f] = speed_raw.to_le_bytes();
        let text = format!("00000401#{a:02X}{b:02X}{c:02X}00{e:02X}{f:02X}0000");
        let Receipt::Measured(measured) = receive(&mut *drive, &text) else { panic!() };
        assert!((measured.position / unit - position).abs() <= 0.005 * (1.0 + 1e-9));
        assert!((measured.velocity / unit - speed).abs() <= 0.05 * (1.0 + 1e-9));
    }
}

#[test]
fn settings_and_files_that_cannot_be_are_told() {
    let report = |yaml: &str, file: &str, mode: Mode| {
        try_drive("dbc", yaml, Common { mode, ..COMMON }, file).unwrap_err()
    };
    let found = report(&YAML.replace("State.Speed", "State.Spede"), FILE, Mode::Torque);
    assert!(found.contains("`measured_velocity` names `State.Spede`"), "{found}");
    let found = report(YAML, FILE, Mode::Impedance);
    assert_eq!(found.lines().count(), 3, "position, stiffness and damping: {found}");
    let found = report(YAML, &FILE.replace("7|20@0-", "7|80@0-"), Mode::Torque);
    assert!(found.contains("line 10 of the DBC file"), "{found}");
    let found = report(&YAML.replace("Kind=5", "Kind=five"), FILE, Mode::Torque);
    assert!(found.contains("is no constant"), "{found}");
}

#[test]
fn frames_of_others_and_malformed_ones_are_told_apart() {
    let mut drive = dbc(Mode::Torque);
    for text in ["401#0000000000000100", "00000402#0000000000000100"] {
        assert_eq!(receive(&mut *drive, text), Receipt::NotMine);
    }
    assert_eq!(receive(&mut *drive, "00000401#00000000000001"), Receipt::Malformed);
    survives_hostile_frames(&mut *drive, 5);
}

#[test]
fn its_own_loops_are_limited_by_a_signal_or_refused() {
    let common = Common { mode: Mode::Velocity, torque_limit: 2.005, ..COMMON };
    let report = try_drive("dbc", YAML, common, FILE).unwrap_err();
    assert!(report.contains("nothing limits the torque of the motor in the mode velocity"));
    let file = FILE.replace(
        " SG_ Velocity m2 ",
        " SG_ Most m1 : 24|16@1+ (0.01,0) [0|0] \"Nm\" Motor\n SG_ Velocity m2 ",
    );
    let yaml = YAML.replace("constants:", "torque_limit: Command.Most, constants:");
    let drive = try_drive("dbc", &yaml, common, &file).unwrap_or_else(|report| panic!("{report}"));
    let mut queue = FrameQueue::new(4);
    drive.encode(&Setpoint::default(), &mut queue);
    // 200 hundredths, not 201
    assert!(queue.frames().iter().any(|frame| frame.data()[3..5] == [0xC8, 0x00]));
}

#[test]
fn what_only_a_host_sends_is_foreign() {
    let mut drive = dbc(Mode::Torque);
    assert_eq!(receive(&mut *drive, "101#A1FF6A0000000000"), Receipt::Foreign);
}

/// Power and set-point in messages of their own, as many drives have them; measurements are in
/// three messages.
const APART: &str = r#"VERSION ""
BO_ 16 Power: 1 Host
 SG_ Enable : 0|8@1+ (1,0) [0|1] "" Motor
BO_ 17 Target: 4 Host
 SG_ Position : 0|32@1- (1,0) [0|0] "rad" Motor
SIG_VALTYPE_ 17 Position : 1;
BO_ 33 Encoder: 4 Motor
 SG_ Position : 0|32@1- (1,0) [0|0] "rad" Host
SIG_VALTYPE_ 33 Position : 1;
BO_ 34 Status: 2 Motor
 SG_ On : 0|8@1+ (1,0) [0|1] "" Host
 SG_ Fault : 8|8@1+ (1,0) [0|255] "" Host
BO_ 35 Motion: 8 Motor
 SG_ Velocity : 0|32@1- (1,0) [0|0] "rad/s" Host
 SG_ Torque : 32|32@1- (1,0) [0|0] "Nm" Host
SIG_VALTYPE_ 35 Velocity : 1;
SIG_VALTYPE_ 35 Torque : 1;
"#;
const APART_YAML: &str = "{file: motor.dbc, enable: Power.Enable, position: Target.Position, \
    measured_position: Encoder.Position, \
    measured_velocity: Motion.Velocity, measured_torque: Motion.Torque, enabled: Status.On, \
    fault: Status.Fault, stale_ms: 100}";
/// 1.5 and 2.5 as singles.
const PLACE: &str = "0000C03F";
const TARGET: &str = "00002040";

fn apart() -> Box<dyn Drive> {
    try_drive("dbc", APART_YAML, Common { mode: Mode::Position, ..COMMON }, APART)
        .unwrap_or_else(|report| panic!("{report}"))
}

#[test]
fn power_comes_after_the_set_point_and_goes_before_it() {
    let mut drive = apart();
    let setpoint = Setpoint { position: 2.5, ..Setpoint::default() };
    let texts = |frames: Vec<Frame>| frames.iter().map(Frame::to_string).collect::<Vec<_>>();
    receive(&mut *drive, "022#0000");
    assert_eq!(
        texts(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["010#00", "011#00000000"],
        "nobody knows where it is"
    );
    receive(&mut *drive, &format!("021#{PLACE}"));
    let stays = format!("011#{PLACE}");
    let follows = format!("011#{TARGET}");
    assert_eq!(
        texts(frames(&mut *drive, DriveCommand::Off)),
        ["010#00", &stays],
        "without power it is told to stay"
    );
    assert_eq!(
        texts(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["010#00", &follows],
        "the set-point is there a cycle before power"
    );
    assert_eq!(drive.state().power, Power::Starting);
    assert_eq!(texts(frames(&mut *drive, DriveCommand::On(setpoint))), [&follows, "010#01"]);
    receive(&mut *drive, "022#0100");
    assert_eq!(drive.state().power, Power::On);
    let mut queue = FrameQueue::new(4);
    drive.disable(&mut queue);
    assert_eq!(texts(queue.frames().to_vec()), ["010#00", &stays]);
    assert_eq!(texts(frames(&mut *drive, DriveCommand::Off)), ["010#00", &stays]);
}

#[test]
fn what_is_in_a_message_whatever_its_switch_says_is_in_all_of_its_frames() {
    let file = FILE.replace("Enable m1 :", "Enable :").replace("Kind m1 :", "Kind :");
    let mut drive = try_drive("dbc", YAML, Common { mode: Mode::Torque, ..COMMON }, &file)
        .unwrap_or_else(|report| panic!("{report}"));
    receive(&mut *drive, "00000401#0000000000000000");
    let setpoint = Setpoint { torque: -1.5, velocity: 2.0, ..Setpoint::default() };
    let texts = |frames: Vec<Frame>| frames.iter().map(Frame::to_string).collect::<Vec<_>>();
    assert_eq!(
        texts(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["101#A2A0BF0100000000", "101#A1FF6A0000000000"]
    );
    assert_eq!(
        texts(frames(&mut *drive, DriveCommand::On(setpoint))),
        ["101#B2A0BF0100000000", "101#B1FF6A0000000000"]
    );
    let yaml = YAML.replace("Command.Kind=5", "Command.Mux=2");
    let report =
        try_drive("dbc", &yaml, Common { mode: Mode::Torque, ..COMMON }, &file).unwrap_err();
    assert!(report.contains("`Mux` is the switch of its message"), "{report}");
}

#[test]
fn what_was_told_long_ago_is_not_believed() {
    let at = |drive: &mut dyn Drive, now_ms: u64, text: &str| {
        drive.receive(now_ms * 1_000_000, &crate::support::frame(text))
    };
    let place = format!("021#{PLACE}");
    let mut drive = apart();
    let measured = |drive: &mut dyn Drive, now_ms: u64| {
        let Receipt::Measured(measured) = at(drive, now_ms, &place) else { panic!() };
        (measured.velocity, measured.torque)
    };
    assert!(measured(&mut *drive, 0).0.is_nan());
    assert_eq!(drive.state().power, Power::Unknown, "it has not reported whether it has power");
    at(&mut *drive, 0, &format!("023#{PLACE}{TARGET}"));
    at(&mut *drive, 0, "022#0100");
    assert_eq!(measured(&mut *drive, 100), (1.5, 2.5));
    assert_eq!((drive.state().power, drive.state().fault), (Power::On, 0));
    let (velocity, torque) = measured(&mut *drive, 101);
    assert!(velocity.is_nan() && torque.is_nan());
    assert_eq!((drive.state().power, drive.state().fault), (Power::Unknown, fault::SILENT));
    at(&mut *drive, 110, "022#0100");
    assert_eq!((drive.state().power, drive.state().fault), (Power::On, 0));
    // the cycle sees it too, where nothing comes any more
    drive.cycle(211_000_000, DriveCommand::Off, &mut FrameQueue::new(4));
    assert_eq!(drive.state().fault, fault::SILENT);
    // a number that is none is not the one before
    at(&mut *drive, 220, &format!("023#{PLACE}{TARGET}"));
    at(&mut *drive, 221, &format!("023#0000C07F{TARGET}"));
    let (velocity, torque) = measured(&mut *drive, 222);
    assert!(velocity.is_nan() && torque == 2.5);
}
