//! Limits that hold inside the motors, where their own loops make the torque.

use crate::closed_loop::Bench;
use sarrus_can_core::drive::{DriveCommand, Mode, Setpoint};

#[test]
fn a_blocked_shaft_is_pushed_with_the_limit_and_no_more() {
    let odrive = "{node: 3, motor_torque_constant: 0.25, watchdog_timeout_endpoint: 300, \
        enable_watchdog_endpoint: 301}";
    let cia402 = "{node: 5, rated_torque: 2.0, counts_per_turn: 65536}";
    let vesc = "{id: 23, motor_torque_constant: 0.1, pole_pairs: 7}";
    let moteus = "{id: 1, kp: 40, kd: 1}";
    for (protocol, yaml, mode) in [
        ("odrive", odrive, Mode::Position),
        ("odrive", odrive, Mode::Velocity),
        ("cia402", cia402, Mode::Position),
        ("cia402", cia402, Mode::Velocity),
        ("vesc", vesc, Mode::Position),
        ("vesc", vesc, Mode::Velocity),
        ("moteus", moteus, Mode::Position),
        ("moteus", moteus, Mode::Impedance),
        ("cybergear", "{id: 10, position_range: 12.5}", Mode::Impedance),
    ] {
        println!("{protocol} {mode:?}");
        let mut bench = Bench::new(protocol, yaml, mode);
        bench.power_on(Setpoint::default());
        let far = Setpoint {
            position: 3.0,
            velocity: 20.0,
            stiffness: 50.0,
            damping: 1.0,
            ..Setpoint::default()
        };
        for n in 0..100 {
            bench.motor.plant.carry(0.0, 0.0);
            bench.cycle(DriveCommand::On(far));
            let torque = bench.motor.plant.torque;
            assert!(torque <= 5.0 + 1e-6, "{protocol} {mode:?}: {torque} N m");
            assert!(n < 10 || torque > 4.5, "{protocol} {mode:?} does not push: {torque} N m");
        }
    }
}
