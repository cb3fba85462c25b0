//! Late commands, and stops from state to state.

use super::bench::Bench;
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
fn a_request_to_disarm_that_is_repeated_at_once_is_no_second_one() {
    let mut bench = Bench::armed();
    let disarm = |bench: &mut Bench| {
        let request = OperatorRequest {
            stamp_ns: bench.now_ns,
            operation: Operation::Disarm as u32,
            actuator: 0,
        };
        bench.bridge.request(bench.now_ns, &request)
    };
    assert_eq!(disarm(&mut bench), Some(Operation::Disarm));
    bench.steps(50);
    assert_eq!(disarm(&mut bench), None);
    bench.steps(2);
    assert_eq!(bench.states(), [MechanismState::Stopping; 3]);
    bench.steps(150);
    assert_eq!(disarm(&mut bench), Some(Operation::Disarm));
    bench.step();
    assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
}

#[test]
fn disarming_once_does_not_cut_a_stop_for_another_reason_short() {
    let mut bench = Bench::armed();
    bench.bridge.fail_mechanism(0, Reason::FollowingError);
    bench.steps(50);
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.steps(50);
    assert_eq!(bench.states(), [MechanismState::Stopping; 3]);
    assert_eq!((bench.reason(0), bench.reason(2)), (Reason::FollowingError, Reason::Disarmed));
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.step();
    let disabled = MechanismState::Disabled;
    let fault = MechanismState::Fault;
    assert_eq!(bench.states(), [fault, fault, disabled]);
}

#[test]
fn a_bridge_that_was_stopped_during_a_stop_for_a_fault_is_in_fault() {
    let mut bench = Bench::armed();
    bench.bridge.fail_mechanism(0, Reason::FollowingError);
    bench.steps(50);
    bench.now_ns += 2_000 * MS;
    bench.step();
    assert_eq!((bench.states()[0], bench.last(0)), (MechanismState::Fault, DriveCommand::Off));
    assert_eq!(bench.reason(0), Reason::FollowingError);
}

#[test]
fn a_motor_that_fails_while_it_is_stopped_takes_the_torque_off_at_once() {
    let mut bench = Bench::armed();
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.steps(50);
    bench.fault[1] = 4;
    bench.steps(2);
    let stopping = MechanismState::Stopping;
    let fault = MechanismState::Fault;
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
