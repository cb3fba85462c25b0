//! A moteus drive with its motor: positions, timeouts, boots.

use crate::closed_loop::Bench;
use crate::support::{frame, torque};
use sarrus_can_core::drive::{DriveCommand, Mode, Setpoint, Watchdog};
use sarrus_can_core::frame::FrameQueue;
use sarrus_can_core::protocol::fault;

#[test]
fn a_position_is_followed_at_once_whatever_limits_are_configured() {
    let hold = Setpoint { stiffness: 0.1, ..Setpoint::default() };
    let mut bench = Bench::new("moteus", "{id: 1, kp: 4.0, kd: 0.05}", Mode::Impedance);
    bench.power_on(hold);
    bench.cycle(DriveCommand::On(Setpoint { position: 1.0, ..hold }));
    let law = bench.motor.follows().unwrap();
    assert!((law.position - 1.0).abs() < 1e-6, "the motor has a way of its own: {law:?}");
}

/// Register 027 after a position command, from a host that is not ours.
fn commanded(bench: &mut Bench, timeout: u8) -> f64 {
    let mut sent = FrameQueue::new(1);
    sent.push(frame(&format!("00008001##101000A0127{timeout:02X}1D27")));
    let mut answers = FrameQueue::new(4);
    bench.motor.receive(0, &sent.frames()[0], &mut answers);
    let answer = answers.frames()[0];
    assert_eq!(answer.data()[..2], [0x2D, 0x27]);
    f64::from(f32::from_le_bytes(answer.data()[2..6].try_into().unwrap()))
}

#[test]
fn a_timeout_of_zero_is_the_motors_own_and_of_nan_is_none() {
    let mut bench = Bench::new("moteus", "{id: 1}", Mode::Torque);
    assert_eq!(commanded(&mut bench, 0), 0.0, "what was commanded is read, not what it stands for");
    assert_eq!(bench.motor.plant.watchdog_ns, 100_000_000);
    assert!(commanded(&mut bench, 0x80).is_nan());
    assert_eq!(bench.motor.plant.watchdog_ns, 0);
    assert!((commanded(&mut bench, 3) - 0.03).abs() < 1e-6);
    assert_eq!(bench.motor.plant.watchdog_ns, 30_000_000);
}

#[test]
fn a_motor_that_boots_while_it_follows_gets_no_power_again() {
    let mut bench = Bench::new("moteus", "{id: 1}", Mode::Torque);
    bench.power_on(torque(0.1));
    bench.motor.reboot();
    (0..10).for_each(|_| bench.cycle(DriveCommand::On(torque(0.1))));
    assert!(bench.motor.follows().is_none());
    assert_eq!(bench.drive.state().fault, fault::POWER_LOST);
    // nothing of it needs a set-up: the watchdog goes along in each frame
    (0..2).for_each(|_| bench.cycle(DriveCommand::Off));
    bench.power_on(torque(0.1));
    assert_eq!(
        (bench.motor.plant.watchdog_ns, bench.drive.state().watchdog),
        (50_000_000, Watchdog::Set(50))
    );
}
