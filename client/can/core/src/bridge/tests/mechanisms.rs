//! Operations of one mechanism of several.

use super::bench::{AT_REST, Bench};
use super::*;

#[test]
fn one_mechanism_is_armed_disarmed_and_reset_alone() {
    use MechanismState::{Disabled, Enabled, Fault, Stopping};
    let mut bench = Bench::new(|_| {});
    bench.steps(AT_REST);
    bench.bridge.operate_mechanism(bench.now_ns, Operation::Arm, Some(2));
    bench.steps(5);
    assert_eq!(bench.states(), [Disabled, Disabled, Enabled]);
    // the other one, by either of its actuators
    bench.bridge.operate_mechanism(bench.now_ns, Operation::Arm, Some(1));
    bench.steps(5);
    assert_eq!(bench.states(), [Enabled; 3]);
    bench.bridge.operate_mechanism(bench.now_ns, Operation::Disarm, Some(0));
    bench.step();
    assert_eq!(bench.states(), [Stopping, Stopping, Enabled]);
    bench.steps(700);
    assert_eq!(bench.states(), [Disabled, Disabled, Enabled]);
    // a reset of one leaves the other's fault
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(5);
    bench.fault = [3, 0, 3];
    bench.steps(5);
    assert_eq!(bench.states(), [Fault; 3]);
    bench.fault = [0; 3];
    bench.bridge.operate_mechanism(bench.now_ns, Operation::Reset, Some(2));
    bench.steps(5);
    assert_eq!(bench.states(), [Fault, Fault, Disabled]);
    // an actuator that is not there
    bench.bridge.operate_mechanism(bench.now_ns, Operation::Reset, Some(3));
    bench.steps(5);
    assert_eq!(bench.states(), [Fault, Fault, Disabled]);
}

#[test]
fn a_request_names_the_actuator_that_it_means_from_one_on() {
    let mut bench = Bench::new(|_| {});
    bench.steps(AT_REST);
    let request = |stamp_ns, operation: Operation, actuator| OperatorRequest {
        stamp_ns,
        operation: operation as u32,
        actuator,
    };
    let now_ns = bench.now_ns;
    assert_eq!(bench.bridge.request(now_ns, &request(now_ns, Operation::Arm, 4)), None);
    let arm = request(now_ns, Operation::Arm, 3);
    assert_eq!(bench.bridge.request(now_ns, &arm), Some(Operation::Arm));
    bench.steps(5);
    assert_eq!(bench.states()[2], MechanismState::Enabled);
    assert_eq!(bench.states()[0], MechanismState::Disabled);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(5);
    // one mechanism, and at once the whole robot: that is no repetition
    let now_ns = bench.now_ns;
    bench.bridge.request(now_ns, &request(now_ns, Operation::Disarm, 3));
    bench.bridge.request(now_ns, &request(now_ns, Operation::Disarm, 0));
    bench.step();
    assert_ne!(bench.states()[0], MechanismState::Enabled);
}

#[test]
fn one_missing_motor_keeps_only_its_own_mechanism_from_arming() {
    let mut bench = Bench::new(|_| {});
    bench.answers[2] = false;
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(5);
    let [first, second, third] = bench.states();
    assert_eq!((first, second), (MechanismState::Enabled, MechanismState::Enabled));
    assert_eq!((third, bench.reason(2)), (MechanismState::Arming, Reason::FeedbackStale));
}

#[test]
fn a_robot_that_stops_as_a_whole_is_armed_as_a_whole() {
    let mut bench = Bench::new(|configuration| configuration.stop = Stop::Robot);
    bench.answers[2] = false;
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(5);
    assert_eq!(bench.states(), [MechanismState::Arming; 3]);
}
