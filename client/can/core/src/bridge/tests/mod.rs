mod bench;
mod braking;
mod fault_log;
mod limits;
mod malformed;
mod mechanisms;
mod model;
mod monitors;
mod robot;
mod stops;

use std::sync::atomic::Ordering;

use bench::{AT_REST, Bench, MS, Shaft};
use sarrus_models::LoadError;

use super::*;
use crate::config::{Commissioning, Limits, Stop, Surroundings};
use crate::drive::{Mode, Setpoint};
use crate::frame::Id;
use sarrus_proto::actuators::{MechanismState, Operation, OperatorRequest, flag};

#[test]
fn nothing_has_power_before_it_is_armed() {
    let mut bench = Bench::new(|_| {});
    bench.steps(50);
    assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
    assert!(
        bench.given.iter().all(|given| given
            .lock()
            .unwrap()
            .iter()
            .all(|command| *command == DriveCommand::Off))
    );
}

#[test]
fn the_first_setpoint_is_the_measured_position_and_gains_grow() {
    let mut bench = Bench::new(|_| {});
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(120);
    let given = bench.given[0].lock().unwrap().clone();
    let setpoints: Vec<Setpoint> = given
        .iter()
        .filter_map(
            |command| if let DriveCommand::On(setpoint) = command { Some(*setpoint) } else { None },
        )
        .collect();
    assert_eq!(setpoints[0], Setpoint { position: 0.2, ..Setpoint::default() });
    // from 0.2 to 0.5 in 100 ms, no step larger than its share
    for pair in setpoints.windows(2) {
        assert!(pair[1].position - pair[0].position <= 0.3 / 100.0 + 1e-12, "{pair:?}");
        assert!(
            pair[1].stiffness >= pair[0].stiffness
                && pair[1].stiffness - pair[0].stiffness <= 2.0 / 100.0 + 1e-12
        );
    }
    let last = setpoints.last().unwrap();
    assert_eq!((last.position, last.torque, last.stiffness), (0.5, 1.0, 2.0));
}

#[test]
fn arming_waits_for_every_motor_the_buses_and_a_command() {
    let wait = |prepare: &dyn Fn(&mut Bench), reason: Reason| {
        let mut bench = Bench::new(|_| {});
        prepare(&mut bench);
        bench.steps(AT_REST);
        bench.bridge.operate(bench.now_ns, Operation::Arm);
        bench.steps(5);
        assert_eq!(bench.bridge.state().state, MechanismState::Arming as u32, "{reason:?}");
        assert_eq!(bench.reason(0), reason);
        // not for ever
        bench.steps(600);
        assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
        assert_eq!(bench.reason(0), reason);
        assert!(bench.given.iter().all(|given| {
            given.lock().unwrap().iter().all(|command| *command == DriveCommand::Off)
        }));
    };
    wait(&|bench| bench.answers = [false; 3], Reason::FeedbackStale);
    wait(&|bench| bench.fault = [0, 9, 9], Reason::MotorFault);
    wait(&|bench| bench.commands = false, Reason::NoCommand);
    wait(&|bench| bench.each_bus(BusEvent::ErrorPassive), Reason::BusPassive);
    wait(&|bench| bench.each_bus(BusEvent::BusOff), Reason::BusOff);
    wait(&|bench| bench.each_bus(BusEvent::Backlog(3)), Reason::Backlog);
}

#[test]
fn nothing_is_armed_in_motion() {
    for velocity in [0.2, -3.0] {
        let mut bench = Bench::new(|configuration| {
            configuration.motors.iter_mut().for_each(|motor| motor.limits.velocity = 5.0);
        });
        bench.shafts = Some([Shaft::default(); 3]);
        bench.steps(AT_REST);
        bench.shafts.as_mut().unwrap()[2].velocity = velocity;
        bench.steps(20);
        bench.bridge.operate(bench.now_ns, Operation::Arm);
        bench.steps(5);
        assert_eq!(bench.states()[..2], [MechanismState::Enabled; 2]);
        assert_eq!((bench.states()[2], bench.reason(2)), (MechanismState::Arming, Reason::Moving));
        bench.shafts.as_mut().unwrap()[2].velocity = 0.0;
        bench.steps(AT_REST);
        assert_eq!(bench.states()[2], MechanismState::Enabled);
    }
}

#[test]
fn a_motor_that_is_not_calibrated_is_never_armed() {
    let mut bench = Bench::new(|configuration| configuration.motors[2].is_calibrated = false);
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.step();
    assert_eq!(bench.states()[2], MechanismState::Disabled);
    assert_eq!(bench.reason(2), Reason::NotCalibrated);
    bench.steps(5);
    assert_eq!(bench.states()[..2], [MechanismState::Enabled; 2]);
}

#[test]
fn a_robot_without_a_record_is_not_armed_unless_that_is_waived_which_the_state_shows() {
    let armed = |commissioning: &Commissioning| {
        let mut bench =
            Bench::new(|configuration| configuration.commissioning = commissioning.clone());
        bench.steps(AT_REST);
        bench.bridge.operate(bench.now_ns, Operation::Arm);
        bench.steps(5);
        (bench.states()[0], bench.reason(0), bench.bridge.state().flags[0] & flag::UNCOMMISSIONED)
    };
    use MechanismState::{Disabled, Enabled};
    let missing = Commissioning::Missing("absent".into());
    assert_eq!(armed(&missing), (Disabled, Reason::NotCommissioned, 0));
    assert_eq!(armed(&Commissioning::Done), (Enabled, Reason::None, 0));
    assert_eq!(armed(&Commissioning::Waived), (Enabled, Reason::None, flag::UNCOMMISSIONED));
}

#[test]
fn one_number_that_is_none_rejects_the_whole_command() {
    let mut bench = Bench::armed();
    let position = bench.setpoint(0).position;
    bench.commands = false;
    for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e61] {
        for field in 0..5 {
            bench.sequence += 1;
            let mut command = bench.command();
            let fields = [
                &mut command.position,
                &mut command.velocity,
                &mut command.effort,
                &mut command.stiffness,
                &mut command.damping,
            ];
            fields[field][2] = number;
            assert_eq!(bench.bridge.command(bench.now_ns, &command), CommandVerdict::NotFinite);
        }
    }
    assert_eq!(bench.bridge.counters().commands.not_finite, 20);
    bench.steps(120);
    assert_eq!(bench.reason(0), Reason::CommandLost, "commands that are not taken feed no deadman");
    assert!(position.is_finite());
}

#[test]
fn commands_of_the_past_the_future_and_other_robots_are_not_taken() {
    let mut bench = Bench::armed();
    let good = ActuatorCommand {
        sequence: bench.sequence + 1,
        stamp_ns: bench.now_ns + 1,
        ..bench.command()
    };
    let last = bench.sequence;
    let now_ns = bench.now_ns;
    let assessed =
        |bench: &mut Bench, command: ActuatorCommand| bench.bridge.command(now_ns + 1, &command);
    assert_eq!(
        assessed(&mut bench, ActuatorCommand { sequence: last, ..good }),
        CommandVerdict::Old
    );
    assert_eq!(assessed(&mut bench, ActuatorCommand { stamp_ns: 5, ..good }), CommandVerdict::Old);
    assert_eq!(
        assessed(&mut bench, ActuatorCommand { stamp_ns: now_ns + 10 * MS, ..good }),
        CommandVerdict::Ahead
    );
    assert_eq!(
        assessed(&mut bench, ActuatorCommand { fingerprint: 8, ..good }),
        CommandVerdict::WrongModel
    );
    assert_eq!(assessed(&mut bench, ActuatorCommand { n_u: 2, ..good }), CommandVerdict::WrongSize);
    let mut negative = good;
    negative.stiffness[1] = -1.0;
    assert_eq!(assessed(&mut bench, negative), CommandVerdict::Negative);
    assert_eq!(assessed(&mut bench, good), CommandVerdict::Accepted);
}

#[test]
fn a_motor_that_fails_stops_its_closed_mechanism_and_no_other() {
    for (prepare, reason) in [
        ((|bench: &mut Bench| bench.fault[1] = 4) as fn(&mut Bench), Reason::MotorFault),
        (|bench| bench.answers[1] = false, Reason::FeedbackStale),
    ] {
        let mut bench = Bench::armed();
        prepare(&mut bench);
        bench.steps(30);
        assert_eq!(
            bench.states(),
            [MechanismState::Fault, MechanismState::Fault, MechanismState::Enabled]
        );
        assert_eq!(
            (bench.last(0), bench.last(1), bench.reason(0)),
            (DriveCommand::Off, DriveCommand::Off, reason)
        );
        assert!(matches!(bench.last(2), DriveCommand::On(_)));
    }
}

#[test]
fn a_robot_that_stops_as_a_whole_stops_as_a_whole() {
    let mut bench = Bench::new(|configuration| configuration.stop = Stop::Robot);
    bench.arm();
    bench.fault[2] = 1;
    bench.steps(3);
    let stopping = MechanismState::Stopping;
    let fault = MechanismState::Fault;
    assert_eq!(bench.states(), [stopping, stopping, fault]);
    assert_eq!((bench.reason(0), bench.reason(2)), (Reason::OtherMechanism, Reason::MotorFault));
    bench.steps(500);
    assert_eq!(bench.states(), [fault; 3]);
    assert_eq!((bench.reason(0), bench.last(0)), (Reason::OtherMechanism, DriveCommand::Off));
}

#[test]
fn requests_of_another_time_give_no_power_and_take_it_at_any_time() {
    let mut bench = Bench::new(|_| {});
    bench.steps(3000);
    let request = |stamp_ns, operation: Operation| OperatorRequest {
        stamp_ns,
        operation: operation as u32,
        actuator: 0,
    };
    let now_ns = bench.now_ns;
    assert_eq!(bench.bridge.request(now_ns, &request(now_ns - 1001 * MS, Operation::Arm)), None);
    assert_eq!(bench.bridge.request(now_ns, &request(now_ns + 1001 * MS, Operation::Arm)), None);
    assert_eq!(
        bench
            .bridge
            .request(now_ns, &OperatorRequest { stamp_ns: now_ns, operation: 99, actuator: 0 }),
        None
    );
    assert_eq!(
        bench.bridge.request(now_ns, &request(now_ns - 999 * MS, Operation::Arm)),
        Some(Operation::Arm)
    );
    assert_eq!(
        bench.bridge.request(now_ns, &request(now_ns - 2000 * MS, Operation::Disarm)),
        Some(Operation::Disarm)
    );
    bench.steps(5);
    assert_eq!(bench.states(), [MechanismState::Disabled; 3]);
    // a later disarm that came before an earlier arm
    let now_ns = bench.now_ns;
    bench.bridge.request(now_ns, &request(now_ns - 1, Operation::Disarm));
    assert_eq!(bench.bridge.request(now_ns, &request(now_ns - 2, Operation::Arm)), None);
    assert_eq!(
        bench.bridge.request(now_ns, &request(now_ns, Operation::Arm)),
        Some(Operation::Arm)
    );
}

#[test]
fn a_motor_whose_watchdog_is_not_as_configured_has_no_power() {
    for (ms, reason) in [(0, Reason::WatchdogOff), (61, Reason::WatchdogLong)] {
        let mut bench = Bench::armed();
        bench.watchdog_ms[1].store(ms, Ordering::Relaxed);
        bench.steps(3);
        assert_eq!(
            (bench.states()[0], bench.reason(0), bench.last(0)),
            (MechanismState::Fault, reason, DriveCommand::Off)
        );
        bench.bridge.operate(bench.now_ns, Operation::Reset);
        bench.steps(AT_REST);
        bench.bridge.operate(bench.now_ns, Operation::Arm);
        bench.steps(3);
        assert_eq!((bench.states()[0], bench.reason(0)), (MechanismState::Arming, reason));
        bench.watchdog_ms[1].store(50, Ordering::Relaxed);
        bench.steps(5);
        assert_eq!(bench.states(), [MechanismState::Enabled; 3]);
    }
}

#[test]
fn what_was_known_of_a_motor_that_fell_silent_is_forgotten() {
    let mut bench = Bench::armed();
    bench.answers[2] = false;
    bench.steps(20);
    assert_ne!(bench.bridge.state().flags[2] & flag::POWERED, 0);
    bench.steps(5);
    assert_eq!(bench.bridge.state().flags[2] & flag::POWERED, 0);
    assert_eq!(bench.reason(2), Reason::FeedbackStale);
}

#[test]
fn a_fault_stays_until_it_is_reset_and_a_reset_does_not_arm() {
    let mut bench = Bench::armed();
    bench.fault[2] = 4;
    bench.steps(5);
    bench.fault[2] = 0;
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(50);
    assert_eq!(bench.states()[2], MechanismState::Fault);
    bench.bridge.operate(bench.now_ns, Operation::Reset);
    bench.steps(AT_REST);
    assert_eq!(
        bench.states(),
        [MechanismState::Enabled, MechanismState::Enabled, MechanismState::Disabled]
    );
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    bench.steps(5);
    assert_eq!(bench.states(), [MechanismState::Enabled; 3]);
}

#[test]
fn a_bus_that_goes_off_stops_its_mechanisms() {
    let mut bench = Bench::armed();
    bench.bridge.bus_event(bench.now_ns, 0, BusEvent::BusOff);
    bench.step();
    assert_eq!(
        bench.states(),
        [MechanismState::Fault, MechanismState::Fault, MechanismState::Enabled]
    );
    assert_eq!(bench.reason(0), Reason::BusOff);
}

#[test]
fn a_bridge_that_was_stopped_lets_go() {
    let mut bench = Bench::armed();
    bench.now_ns += 2_000 * MS;
    bench.step();
    assert_ne!(bench.states(), [MechanismState::Enabled; 3]);
    assert_eq!((bench.last(0), bench.reason(0)), (DriveCommand::Off, Reason::Stalled));
}

#[test]
fn a_mechanism_that_is_armed_does_not_disturb_another_that_follows() {
    let mut bench = Bench::new(|configuration| {
        configuration.motors.iter_mut().for_each(|motor| {
            motor.limits = Limits { velocity: 1.0, effort_rate: 100.0, ..motor.limits }
        });
    });
    bench.arm();
    bench.fault[2] = 4;
    bench.steps(1000);
    let before = bench.setpoint(0);
    bench.fault[2] = 0;
    bench.bridge.operate(bench.now_ns, Operation::Reset);
    bench.steps(AT_REST);
    bench.bridge.operate(bench.now_ns, Operation::Arm);
    for _ in 0..5 {
        bench.step();
        assert_eq!(bench.setpoint(0), before);
    }
    assert_eq!(bench.states(), [MechanismState::Enabled; 3]);
}

#[test]
fn every_way_out_has_a_frame_that_disables_each_motor() {
    let mut bench = Bench::armed();
    bench.bridge.shutdown();
    for i in 0..3_u16 {
        let frames = bench.bridge.frames(usize::from(i) / 2);
        assert!(
            frames.contains(&Frame::classic(Id::Standard(i), &[0]).unwrap()),
            "{i}: {frames:?}"
        );
        assert!(!frames.contains(&Frame::classic(Id::Standard(i), &[1]).unwrap()));
    }
}

#[test]
fn frames_of_strangers_and_malformed_ones_are_counted_and_not_used() {
    let mut bench = Bench::armed();
    let before = bench.bridge.state().position[0];
    bench.answers = [false; 3];
    bench.bridge.receive(bench.now_ns, 0, &Frame::classic(Id::Standard(99), &[1, 0, 90]).unwrap());
    bench.bridge.receive(bench.now_ns, 0, &Frame::classic(Id::Standard(16), &[1, 0]).unwrap());
    // the right identifier on another bus
    bench.bridge.receive(bench.now_ns, 1, &Frame::classic(Id::Standard(16), &[1, 0, 90]).unwrap());
    bench.step();
    let counters = |bus| bench.bridge.bus_counters(bus).unwrap().1.counts;
    assert_eq!((counters(0).unknown, counters(0).malformed, counters(1).unknown), (1, 1, 1));
    assert_eq!(bench.bridge.state().position[0], before);
}

#[test]
fn a_configuration_without_anything_is_told_what_it_lacks() {
    let surroundings = Surroundings {
        file: &|_| Err("absent".into()),
        robot: &|_| Err(LoadError::Open("robot".into(), "absent".into())),
    };
    let report = Configuration::read("empty.yml", b"{}".to_vec(), &surroundings).unwrap_err();
    let given: Vec<String> = report.errors.iter().map(|error| error.found.clone()).collect();
    for key in ["rate_hz", "buses", "motors"] {
        assert!(given.iter().any(|found| found.contains(key)), "{given:?}");
    }
}

#[test]
fn a_bridge_that_is_late_itself_names_itself_and_not_the_motors() {
    // the cycle was late, and nothing was asked meanwhile
    let mut bench = Bench::armed();
    bench.now_ns += 30 * MS;
    bench.step();
    assert_eq!((bench.states()[0], bench.reason(0)), (MechanismState::Fault, Reason::Stalled));
    // the thread of a bus was late, and nothing was heard
    let mut bench = Bench::armed();
    bench.answers = [false; 3];
    for _ in 0..25 {
        bench.bridge.bus_event(bench.now_ns, 0, BusEvent::Late);
        bench.step();
    }
    assert_eq!((bench.states()[0], bench.reason(0)), (MechanismState::Fault, Reason::Stalled));
    assert_eq!(
        (bench.states()[2], bench.reason(2)),
        (MechanismState::Fault, Reason::FeedbackStale)
    );
    // a motor that is silent most of the time is blamed
    let mut bench = Bench::armed();
    bench.answers[0] = false;
    bench.steps(5);
    bench.now_ns += 8 * MS;
    bench.steps(20);
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Fault, Reason::FeedbackStale)
    );
}
