//! Limits, ramps and rates of set-points.

use super::bench::Bench;
use super::*;

#[test]
fn limits_are_kept_and_reported() {
    let mut bench = Bench::armed();
    bench.steps(150);
    bench.send(|command| {
        command.position[0] = 40.0;
        command.effort[1] = -50.0;
        command.stiffness[1] = 0.0;
        command.velocity[2] = 1e6;
        command.stiffness[2] = 0.0;
    });
    bench.steps(10);
    assert_eq!(bench.setpoint(0).position, 1.0);
    assert_eq!(bench.setpoint(1).torque, -10.0);
    assert_eq!(bench.setpoint(2).velocity, 100.0);
    let flags = bench.bridge.state().flags;
    assert_ne!(flags[0] & flag::POSITION_LIMITED, 0);
    assert_ne!(flags[1] & flag::EFFORT_LIMITED, 0);
    assert_ne!(flags[2] & flag::VELOCITY_LIMITED, 0);
}

#[test]
fn spring_and_effort_together_stay_within_the_effort() {
    for most_stiffness in [1000.0, 1e60] {
        let mut bench = Bench::armed();
        bench.steps(150);
        bench.send(|command| command.stiffness[0] = most_stiffness);
        bench.step();
        let Setpoint { position, torque, stiffness, .. } = bench.setpoint(0);
        assert!((stiffness * (position - 0.2) + torque - 10.0).abs() < 1e-9);
        // neither is large against the other: a motor that saturates one of them is not left with
        // the rest
        assert!(
            (0.0..=10.0).contains(&torque) && (0.0..=10.0 / 0.3 + 1e-9).contains(&stiffness),
            "{torque} {stiffness}"
        );
        assert_ne!(bench.bridge.state().flags[0] & flag::EFFORT_LIMITED, 0);
    }
}

#[test]
fn a_motor_that_follows_torques_gets_the_sum_no_faster_than_it_may_change() {
    let mut bench = Bench::new(|configuration| {
        configuration.motors[0].common.mode = Mode::Torque;
        configuration.motors[0].limits.effort_rate = 1000.0;
    });
    bench.arm();
    bench.steps(150);
    // 1 + 2 (0.5 - 0.2)
    assert_eq!(bench.setpoint(0), Setpoint { position: 0.5, torque: 1.6, ..Setpoint::default() });
    bench.send(|command| command.stiffness[0] = 20.0);
    let torques: Vec<f64> = (0..10)
        .map(|_| {
            bench.step();
            bench.setpoint(0).torque
        })
        .collect();
    let expected = [2.6, 3.6, 4.6, 5.6, 6.6, 7.0, 7.0, 7.0, 7.0, 7.0];
    assert!(
        torques.iter().zip(expected).all(|(torque, expected)| (torque - expected).abs() < 1e-5),
        "{torques:?}"
    );
}
