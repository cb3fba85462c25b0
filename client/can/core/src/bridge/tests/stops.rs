//! Late commands, and stops from state to state and of shafts that turn.

use super::bench::{Bench, Shaft};
use super::*;

#[test]
fn late_commands_bring_damping_and_lost_ones_a_stop() {
    let mut bench = Bench::armed();
    bench.commands = false;
    bench.steps(20);
    assert!(bench.setpoint(0).stiffness > 0.0);
    bench.steps(2);
    assert_eq!(bench.setpoint(0), Setpoint { position: 0.2, damping: 3.0, ..Setpoint::default() });
    assert_ne!(bench.bridge.state().flags[0] & flag::DAMPED, 0);
    bench.steps(80);
    assert_eq!(bench.states(), [MechanismState::Stopping; 3]);
    assert_eq!(bench.bridge.state().state, MechanismState::Stopping as u32);
    assert_eq!(bench.reason(0), Reason::CommandLost);
    assert_ne!(bench.bridge.state().flags[0] & flag::STOPPING, 0);
    // commands that come back are not followed and do not arm
    bench.commands = true;
    bench.steps(300);
    assert_eq!((bench.setpoint(0).position, bench.setpoint(0).torque), (0.2, 0.0));
    bench.steps(200);
    assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
    assert_eq!((bench.last(0), bench.reason(0)), (DriveCommand::Off, Reason::CommandLost));
    bench.steps(200);
    assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
}

#[test]
fn commands_that_come_back_in_time_act_at_once() {
    let mut bench = Bench::armed();
    bench.steps(200);
    let before = bench.setpoint(0);
    bench.commands = false;
    bench.steps(30);
    assert_ne!(bench.bridge.state().flags[0] & flag::DAMPED, 0);
    bench.commands = true;
    bench.step();
    assert_eq!(bench.states(), [MechanismState::Enabled; 3]);
    assert_eq!(bench.setpoint(0), before);
}

#[test]
fn the_way_back_of_the_position_begins_where_the_actuator_is() {
    let mut bench = Bench::armed();
    bench.steps(200);
    bench.commands = false;
    bench.steps(30);
    bench.position = 90;
    bench.step();
    bench.commands = true;
    bench.step();
    // from 0.9 to 0.5 by 100 rad/s
    let first = bench.setpoint(0);
    assert!((first.position - 0.8).abs() < 1e-9, "{first:?}");
    assert_eq!((first.stiffness, first.torque), (2.0, 1.0));
}

#[test]
fn disarming_stops_and_disarming_again_takes_the_torque_off() {
    let mut bench = Bench::armed();
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.steps(400);
    assert_eq!(bench.states(), [MechanismState::Stopping; 3]);
    assert_eq!(bench.reason(0), Reason::Disarmed);
    assert!(matches!(bench.last(0), DriveCommand::On(_)));
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.step();
    assert_eq!((bench.states()[0], bench.last(0)), (MechanismState::Disabled, DriveCommand::Off));
    assert_eq!(bench.reason(0), Reason::Disarmed);
}

#[test]
fn a_motor_that_fails_while_it_is_stopped_takes_the_torque_off_at_once() {
    let mut bench = Bench::armed();
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.steps(50);
    bench.fault[1] = 4;
    bench.steps(2);
    let (stopping, fault) = (MechanismState::Stopping, MechanismState::Fault);
    assert_eq!(bench.states(), [fault, fault, stopping]);
    assert_eq!((bench.last(0), bench.reason(0)), (DriveCommand::Off, Reason::MotorFault));
}

#[test]
fn a_fault_that_leaves_the_motors_able_ends_in_a_fault_after_a_stop() {
    let mut bench = Bench::armed();
    bench.bridge.fail_mechanism(0, Reason::FollowingError);
    bench.steps(100);
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Stopping, Reason::FollowingError)
    );
    // it is stopped already
    bench.bridge.fail_mechanism(0, Reason::VelocityLimit);
    bench.steps(401);
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Fault, Reason::FollowingError)
    );
    assert_eq!(bench.states()[2], MechanismState::Enabled);
    assert_eq!(bench.last(0), DriveCommand::Off);
}

const MODES: [Mode; 4] = [Mode::Impedance, Mode::Position, Mode::Velocity, Mode::Torque];

/// A bench whose shafts hold still in one mode.
fn turning(mode: Mode, inertia: f64) -> Bench {
    let mut bench = Bench::new(|configuration| {
        for motor in &mut configuration.motors {
            motor.common.mode = mode;
            motor.limits = Limits { velocity: 5.0, ..motor.limits };
            motor.damping = motor.limits.damping();
        }
    });
    bench.shafts = Some([Shaft { mode, inertia, ..Shaft::default() }; 3]);
    bench.target = Setpoint { stiffness: 20.0, damping: 1.0, ..Setpoint::default() };
    bench.arm();
    bench.steps(150);
    bench
}

impl Bench {
    fn shaft(&mut self) -> &mut Shaft {
        &mut self.shafts.as_mut().unwrap()[0]
    }
}

#[test]
fn a_motor_stands_still_in_time_in_every_mode() {
    for mode in MODES {
        for inertia in [0.005, 0.01, 0.05] {
            let mut bench = turning(mode, inertia);
            bench.shaft().velocity = 4.0;
            bench.step();
            bench.bridge.operate(bench.now_ns, Operation::Disarm);
            let mut most: f64 = 0.0;
            for _ in 0..500 {
                bench.step();
                assert_eq!(bench.states()[0], MechanismState::Stopping);
                most = most.max(bench.shaft().torque.abs());
            }
            let shaft = *bench.shaft();
            assert!(shaft.velocity.abs() < 0.02, "{mode:?} {inertia} {shaft:?}");
            assert!(most <= 10.0 || matches!(mode, Mode::Position | Mode::Velocity), "{most}");
            bench.step();
            assert_eq!(
                (bench.states()[0], bench.last(0)),
                (MechanismState::Disabled, DriveCommand::Off)
            );
        }
    }
}

#[test]
fn a_load_that_is_known_is_held_while_its_motor_is_stopped() {
    for mode in MODES {
        let mut bench = turning(mode, 0.02);
        bench.target.torque = 1.5;
        bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.load = -1.5);
        bench.steps(300);
        bench.bridge.motors.iter_mut().for_each(|motor| motor.gravity = 1.5);
        let before = bench.shaft().position;
        bench.commands = false;
        bench.steps(600);
        assert_eq!(bench.states()[0], MechanismState::Stopping);
        let drop = bench.shaft().position - before;
        assert!(drop.abs() < 1e-3, "{mode:?}: {drop}");
    }
}

#[test]
fn a_load_that_is_not_known_is_held_by_the_spring() {
    let mut bench = turning(Mode::Impedance, 0.02);
    bench.target.torque = 1.5;
    bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.load = -1.5);
    bench.steps(300);
    bench.commands = false;
    bench.steps(600);
    // 80 ms of damping, 2 N m s/rad, and then the spring, 20 N m/rad
    let drop = bench.shaft().position;
    assert!((-0.06 - 0.075..-0.06).contains(&drop), "{drop}");
}

#[test]
fn a_command_late_once_lets_a_load_sink_for_the_time_of_its_lateness_alone() {
    for mode in [Mode::Impedance, Mode::Torque] {
        // half of the load is the spring's
        let mut bench = turning(mode, 0.0112);
        bench.target.torque = 0.75;
        bench.target.damping = 0.3;
        bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.load = -1.5);
        bench.steps(1000);
        let before = bench.shaft().position;
        assert!((before + 0.75 / 20.0).abs() < 1e-3, "{before}");
        bench.commands = false;
        bench.steps(22);
        bench.commands = true;
        let mut least: f64 = 0.0;
        for _ in 0..300 {
            bench.step();
            least = least.min(bench.shaft().position - before);
        }
        assert!(least > -0.005, "{mode:?}: {least}");
        assert_eq!(bench.states()[0], MechanismState::Enabled);
    }
}
