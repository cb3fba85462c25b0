//! ODrive CANSimple.

use std::f64::consts::TAU;

use crate::support::{
    COMMON, Random, cycle, drive, is_toward_zero, last, receive, survives_hostile_frames, torque,
    try_drive,
};
use sarrus_can_core::drive::{Drive, DriveCommand, Mode, Power, Receipt, Setpoint, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::{Common, fault};

const IDLE: &str = "061#0000000001000000";
const CLOSED: &str = "061#0000000008000000";
const STILL: &str = "069#0000000000000000";

fn odrive(mode: Mode) -> Box<dyn Drive> {
    drive("odrive", "{node: 3}", Common { mode, ..COMMON })
}

/// A drive whose motor said that it runs.
fn enabled(mode: Mode) -> Box<dyn Drive> {
    let mut drive = odrive(mode);
    receive(&mut *drive, IDLE);
    receive(&mut *drive, STILL);
    let sent: Vec<String> = (0..3).flat_map(|_| cycle(&mut *drive, DriveCommand::Off)).collect();
    let (neutral, control) = match mode {
        Mode::Position => ("06C#0000000000000000", "06B#0300000001000000"),
        Mode::Velocity => ("06D#0000000000000000", "06B#0200000001000000"),
        _ => ("06E#00000000", "06B#0100000001000000"),
    };
    assert_eq!(sent, ["067#01000000", neutral, control]);
    let again: Vec<String> = (0..3).flat_map(|_| cycle(&mut *drive, DriveCommand::Off)).collect();
    assert_eq!(again, sent, "nothing answers the mode, so it is said again and again");
    assert_eq!(
        cycle(&mut *drive, DriveCommand::On(Setpoint::default())),
        [control, neutral],
        "mode and set-point before power"
    );
    assert_eq!(cycle(&mut *drive, DriveCommand::On(Setpoint::default())), ["067#08000000"]);
    assert_eq!(drive.state().power, Power::Starting);
    receive(&mut *drive, CLOSED);
    assert_eq!((drive.state().power, drive.state().fault), (Power::On, 0));
    drive
}

fn singles(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks(4).map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()))).collect()
}

#[test]
fn known_frames_come_out() {
    // one turn, 2 turns/s and -1.5 N m: 1.0 and 2000 and -1500 thousandths
    let mut drive = enabled(Mode::Position);
    let setpoint =
        Setpoint { position: TAU, velocity: 2.0 * TAU, torque: -1.5, ..Setpoint::default() };
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["06C#0000803FD00724FA"]);
    let mut drive = enabled(Mode::Velocity);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["06D#000000400000C0BF"]);
    let mut drive = enabled(Mode::Torque);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(setpoint)), ["06E#0000C0BF"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Reset), ["06E#00000000", "078#00"]);
    assert_eq!(cycle(&mut *drive, DriveCommand::Off), ["067#01000000"]);
}

#[test]
fn random_set_points_are_within_half_a_step() {
    let mut random = Random(7);
    let (mut position, mut velocity, mut torque_drive) =
        (enabled(Mode::Position), enabled(Mode::Velocity), enabled(Mode::Torque));
    for _ in 0..100_000 {
        let setpoint = Setpoint {
            position: random.between(-100.0, 100.0),
            velocity: random.between(-200.0, 200.0),
            torque: random.between(-32.0, 32.0),
            ..Setpoint::default()
        };
        let near = |sent: f64, setpoint: f64| {
            assert!(
                (sent - setpoint).abs() <= setpoint.abs() * f64::powi(2.0, -24),
                "{sent} {setpoint}"
            )
        };
        let sent = last(&mut *position, DriveCommand::On(setpoint));
        let bytes = sent.data();
        near(singles(&bytes[..4])[0], setpoint.position / TAU);
        let step = |i: usize| f64::from(i16::from_le_bytes([bytes[i], bytes[i + 1]])) * 1e-3;
        assert!((step(4) - setpoint.velocity / TAU).abs() <= 0.5001e-3);
        assert!(is_toward_zero(step(6), setpoint.torque, 1e-3));
        let sent = singles(last(&mut *velocity, DriveCommand::On(setpoint)).data());
        near(sent[0], setpoint.velocity / TAU);
        near(sent[1], setpoint.torque);
        near(
            singles(last(&mut *torque_drive, DriveCommand::On(setpoint)).data())[0],
            setpoint.torque,
        );
        let p = (setpoint.position / TAU) as f32;
        let v = (setpoint.velocity / TAU) as f32;
        let text: String = p
            .to_le_bytes()
            .into_iter()
            .chain(v.to_le_bytes())
            .map(|byte| format!("{byte:02X}"))
            .collect();
        let Receipt::Measured(measured) = receive(&mut *velocity, &format!("069#{text}")) else {
            panic!()
        };
        assert_eq!(
            (measured.position, measured.velocity),
            (f64::from(p) * TAU, f64::from(v) * TAU)
        );
    }
}

#[test]
fn velocity_and_torque_beside_a_position_saturate() {
    let mut position = enabled(Mode::Position);
    let setpoint =
        Setpoint { position: 1e300, velocity: 33.0 * TAU, torque: -33.0, ..Setpoint::default() };
    assert_eq!(
        cycle(&mut *position, DriveCommand::On(setpoint)),
        ["06C#FFFF7F7FFF7F0180"],
        "32.767 and not -32.5"
    );
    let limited =
        drive("odrive", "{node: 3}", Common { mode: Mode::Torque, torque_limit: 2.0, ..COMMON });
    let mut queue = FrameQueue::new(1);
    limited.encode(&torque(-9.0), &mut queue);
    assert_eq!(singles(queue.frames()[0].data()), [-2.0]);
}

#[test]
fn its_own_loops_are_limited_or_refused() {
    let common = Common { mode: Mode::Position, torque_limit: 0.5, ..COMMON };
    for (yaml, velocity_limit) in
        [("{node: 3}", 10.0), ("{node: 3, motor_torque_constant: 0.25}", f64::INFINITY)]
    {
        let common = Common { velocity_limit, ..common };
        let report = try_drive("odrive", yaml, common, "").unwrap_err();
        assert!(report.contains("nothing limits the torque of the ODrive's mode position"));
    }
    let common = Common { velocity_limit: TAU, ..common };
    let mut drive = drive("odrive", "{node: 3, motor_torque_constant: 0.25}", common);
    receive(&mut *drive, IDLE);
    receive(&mut *drive, STILL);
    let mut sent: Vec<String> =
        (0..6).flat_map(|_| cycle(&mut *drive, DriveCommand::Off)).collect();
    // ODrive's DBC, Set_Limits: velocity 1 turn/s and current 2 A as singles
    const LIMITS: &str = "06F#0000803F00000040";
    sent.retain(|frame| frame == LIMITS);
    assert_eq!(sent.len(), 1);
    assert_eq!(cycle(&mut *drive, DriveCommand::On(Setpoint::default()))[0], LIMITS);
}

#[test]
fn what_only_a_host_sends_is_foreign() {
    let mut drive = odrive(Mode::Torque);
    for text in ["06E#0000803F", "067#08000000", "06F#0000803F00000040", "078#00"] {
        assert_eq!(receive(&mut *drive, text), Receipt::Foreign, "{text}");
    }
    assert_eq!(receive(&mut *drive, "08E#0000803F"), Receipt::NotMine);
}

#[test]
fn the_watchdog_is_set_and_read_back_where_its_endpoints_are_known() {
    let yaml = "{node: 3, watchdog_timeout_endpoint: 0x0123, enable_watchdog_endpoint: 0x0124}";
    let mut drive = drive("odrive", yaml, Common { mode: Mode::Torque, watchdog_ms: 50, ..COMMON });
    receive(&mut *drive, IDLE);
    receive(&mut *drive, STILL);
    let mut sent: Vec<String> =
        (0..15).flat_map(|_| cycle(&mut *drive, DriveCommand::Off)).collect();
    sent.retain(|frame| frame.starts_with("064"));
    assert_eq!(sent.len(), 5, "the last one is asked until it answers");
    sent.dedup();
    assert_eq!(sent, ["064#01230100CDCC4C3D", "064#0124010001", "064#00230100"]);
    assert_eq!(drive.state().watchdog, Watchdog::Unknown);
    assert!(cycle(&mut *drive, DriveCommand::On(torque(1.0)))[0] != "067#08000000");
    receive(&mut *drive, "065#00230100CDCC4C3D");
    assert_eq!(receive(&mut *drive, "065#0024010001"), Receipt::Parameter(1, 1.0));
    assert_eq!(drive.state().watchdog, Watchdog::Set(50));
    let report =
        try_drive("odrive", "{node: 3, watchdog_timeout_endpoint: 5}", COMMON, "").unwrap_err();
    assert!(report.contains("one of the watchdog's two endpoints"), "{report}");
}

#[test]
fn a_fall_out_of_closed_loop_is_a_fault_and_stays_off() {
    let mut drive = enabled(Mode::Torque);
    receive(&mut *drive, IDLE);
    assert_eq!((drive.state().power, drive.state().fault), (Power::Off, fault::POWER_LOST));
    (0..5).for_each(|_| {
        assert_eq!(cycle(&mut *drive, DriveCommand::On(torque(1.0))), ["067#01000000"])
    });
    // measurements alone do not tell that it has power
    let mut drive = enabled(Mode::Torque);
    for now_ns in [400_000_000, 501_000_000] {
        receive(&mut *drive, STILL);
        drive.cycle(now_ns, DriveCommand::On(torque(1.0)), &mut FrameQueue::new(2));
    }
    assert_eq!((drive.state().power, drive.state().fault), (Power::Unknown, fault::POWER_LOST));
    let mut drive = enabled(Mode::Torque);
    receive(&mut *drive, "061#0000000101000000");
    assert_eq!(drive.state().fault, 0x0100_0000, "the ODrive's own code");
    assert_eq!(receive(&mut *drive, "061#0000"), Receipt::Malformed);
}

#[test]
fn numbers_that_are_not_finite_are_no_measurement() {
    let mut drive = odrive(Mode::Torque);
    assert_eq!(receive(&mut *drive, "069#0000C07F00000000"), Receipt::Malformed);
    assert_eq!(drive.state().fault, fault::NOT_FINITE);
    assert_eq!(receive(&mut *drive, "089#0000000000000000"), Receipt::NotMine);
    assert_eq!(receive(&mut *drive, "069#00000000000000"), Receipt::Malformed);
    receive(&mut *drive, "07C#0000803F0000003F");
    receive(&mut *drive, "075#0000F04100000C42");
    let Receipt::Measured(measured) = receive(&mut *drive, "069#0000803E0000003F") else {
        panic!()
    };
    assert_eq!(
        [measured.position, measured.velocity, measured.torque, measured.temperature],
        [TAU / 4.0, TAU / 2.0, 0.5, 35.0]
    );
    survives_hostile_frames(&mut *drive, 1);
}
