//! The log of a fault brings the same fault in a new bridge, on each protocol and after any past:
//! mechanisms that had power, lost it and were armed again, others that failed meanwhile.

use std::f64::consts::PI;

use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::fault_log::{After, FaultLog};
use sarrus_can_core::log::{Line, What};
use sarrus_proto::actuators::{MechanismState, Operation, Reason};

use crate::attack_table::{drives, has_whole_logs, recorded, swing};
use crate::world::{Encoder, Record, World};

/// A fault: its time `[ns]`, mechanism and reason.
type Fault = (u64, usize, Reason);

/// The faults of a bridge that is given these lines, each with the log that would be written.
fn faults(text: &str, lines: &[Line]) -> Vec<(Fault, Vec<Line>)> {
    let mut bridge = World::read(text.to_owned()).bridge;
    let mut log = FaultLog::default();
    let configuration = bridge.configuration().without_motors();
    let mut found = Vec::new();
    for line in lines {
        // as from a file
        let line = Line::read(&line.text(&configuration), &configuration).unwrap();
        let (before, _) = bridge.faults();
        line.apply(&mut bridge);
        let t = line.t;
        let is_cycle = line.what == What::Cycle;
        log.push(line);
        if is_cycle {
            log.after(After::cycle_of(&bridge));
        }
        if let (now, Some((mechanism, reason))) = bridge.faults()
            && now != before
        {
            found.push(((t, mechanism, reason), log.lines().collect()));
        }
    }
    found
}

/// All faults of a world that was recorded, each of whose logs must bring its own as the last one.
fn checked(name: &str, text: &str, world: &World) -> Vec<Fault> {
    let record = world.record.as_ref().unwrap();
    let all = faults(text, &record.lines);
    for (fault, log) in &all {
        let again: Vec<Fault> = faults(text, log).into_iter().map(|(fault, _)| fault).collect();
        assert_eq!(again.last(), Some(fault), "{name}: {again:?}");
        // earlier faults may be there too, and nothing else
        let is_known = |(_, of, why): &Fault| {
            all.iter().any(|((_, known, reason), _)| (known, reason) == (of, why))
        };
        assert!(again.iter().all(is_known), "{name}: {again:?}");
    }
    all.into_iter().map(|(fault, _)| fault).collect()
}

fn armed_again(world: &mut World, name: &str) {
    world.operate(Operation::Reset);
    world.give(Setpoint { stiffness: 5.0, damping: 0.3, ..Setpoint::default() });
    for place in 0..world.shafts.len() {
        if world.state(world.shafts[place].actuator).0 != MechanismState::Enabled {
            let shaft = &mut world.shafts[place];
            (shaft.position, shaft.velocity) = (0.0, 0.0);
        }
    }
    world.cycles(50);
    world.operate(Operation::Confirm);
    world.operate(Operation::Arm);
    world.cycles(125);
    assert!(world.is_enabled(), "{name}: {:?}", world.state(0));
}

#[test]
fn a_fault_log_of_a_motor_that_is_armed_a_second_time_brings_its_fault() {
    for (name, drive) in drives().into_iter().filter(|(_, drive)| has_whole_logs(drive)) {
        for attack in ["silence", "jump"] {
            let text = World::text(&drive, "");
            let mut world = recorded(&drive);
            swing(&mut world, PI);
            world.operate(Operation::Disarm);
            world.cycles(1000);
            // once soon after power, once long after it
            for seconds in [0.5 * PI, 2.0 * PI] {
                armed_again(&mut world, name);
                swing(&mut world, seconds);
                match attack {
                    "silence" => world.shafts[0].motor.silence(true),
                    _ => world.shafts[0].encoder = Encoder::Off(0.5),
                }
                world.cycles(300);
                assert_eq!(world.state(0).0, MechanismState::Fault, "{name} {attack}");
                world.shafts[0].motor.silence(false);
                world.shafts[0].encoder = Encoder::True;
            }
            assert_eq!(checked(name, &text, &world).len(), 2, "{name} {attack}");
        }
    }
}

const TWO: &str = "rate_hz: 250\nramp_ms: 100\nbuses:\n- {name: left, interface: none, channel: a}\n\
    - {name: right, interface: none, channel: b}\nmotors:\n\
    - {actuator: shoulder, bus: left, offset: 0, limits: {position: [-9, 9], effort: 2, \
    velocity: 5}, watchdog_ms: 50, damping: 0.1, drive: {protocol: cybergear, id: 10, position_range: 12.5}}\n\
    - {actuator: elbow, bus: right, offset: 0, limits: {position: [-9, 9], effort: 2, \
    velocity: 5}, watchdog_ms: 50, damping: 0.1, \
    drive: {protocol: mit, variant: damiao, id: 4, reply_id: 20, \
    position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: 500, \
    damping_range: 5}}\n";

#[test]
fn a_fault_log_brings_its_fault_where_others_failed_and_were_armed_again_before() {
    let record = Some(Record::default());
    let mut world = World { record, ..World::read(TWO.to_owned()) };
    assert!(world.arm().is_some());
    world.give(Setpoint { stiffness: 5.0, damping: 0.1, ..Setpoint::default() });
    world.cycles(50);
    // the first fails four times, while the second one has power all the time
    for pause in [30, 700, 1500, 200] {
        swing(&mut world, PI);
        world.shafts[0].motor.silence(true);
        world.cycles(pause as usize);
        assert_eq!(world.state(0).0, MechanismState::Fault);
        world.shafts[0].motor.silence(false);
        world.cycles(20);
        armed_again(&mut world, "two");
    }
    swing(&mut world, PI);
    world.shafts[1].motor.silence(true);
    world.cycles(100);
    let faults = checked("two", TWO, &world);
    assert_eq!(faults.iter().map(|(_, of, _)| *of).collect::<Vec<_>>(), [0, 0, 0, 0, 1]);
}
