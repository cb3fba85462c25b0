//! The log of a fault brings the same frames and the same fault at the same cycle in a new bridge,
//! on each protocol, with every kind of fault, in motion, and after any past: mechanisms that had
//! power, lost it and were armed again, others that failed meanwhile.

use std::f64::consts::PI;

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::fault_log::FaultLog;
use sarrus_can_core::log::{Line, What, sent};
use sarrus_proto::actuators::{MechanismState, Operation, Reason};

use crate::attack_table::{drives, prepared, recorded, swing};
use crate::closed_loop::DBC_FILE;
use crate::soak::all_drives;
use crate::world::{Encoder, MS, Record, World, keep};

/// A fault: its time `[ns]`, mechanism and reason.
type Fault = (u64, usize, Reason);

/// Frames of a bridge with their times, and its faults, each with its log.
struct Made {
    frames: Vec<(u64, String)>,
    faults: Vec<(Fault, Vec<Line>)>,
}

fn made(text: &str, lines: &[Line]) -> Made {
    let mut bridge = World::read_beside(text.to_owned(), DBC_FILE).bridge;
    let mut log = FaultLog::default();
    let mut since_ns = lines[0].t;
    let configuration = bridge.configuration().without_motors();
    let mut made = Made { frames: Vec::new(), faults: Vec::new() };
    for line in lines {
        // as from a file
        let line = Line::read(&line.text(&configuration), &configuration).unwrap();
        let t = line.t;
        let is_cycle = line.what == What::Cycle;
        let (before, _) = bridge.faults();
        keep(&mut bridge, &mut log, &mut since_ns, line);
        if is_cycle {
            made.frames.extend(sent(&bridge, t).map(|frame| (t, frame)));
        }
        if let (now, Some((mechanism, reason))) = bridge.faults()
            && now != before
        {
            made.faults.push(((t, mechanism, reason), log.lines().collect()));
        }
    }
    made
}

/// All faults of a world that was recorded, each of whose logs must bring it, with the same frames.
fn checked(name: &str, text: &str, world: &World) -> Vec<Fault> {
    let record = world.record.as_ref().unwrap();
    let all = made(text, &record.lines);
    for (fault, log) in &all.faults {
        let begin = log[0].t;
        let again = made(text, log);
        let of_run = all.faults.iter().map(|(fault, _)| fault);
        let expected: Vec<&Fault> = of_run.filter(|(t, ..)| *t > begin && *t <= fault.0).collect();
        let found: Vec<&Fault> = again.faults.iter().map(|(fault, _)| fault).collect();
        assert_eq!(found, expected, "{name}");
        let until = |made: &Made| -> Vec<(u64, String)> {
            made.frames.iter().filter(|(t, _)| *t <= fault.0).cloned().collect()
        };
        let of_run = until(&all);
        let of_log = until(&again);
        assert!(of_log.len() > 100 && of_run.ends_with(&of_log), "{name}: {fault:?}");
        assert!(fault.0 - begin <= 3_100 * MS, "{name}");
    }
    all.faults.into_iter().map(|(fault, _)| fault).collect()
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

/// Kinds of faults, for every protocol.
const KINDS: &[(&str, fn(&mut World))] = &[
    ("silence", |world| world.shafts[0].motor.silence(true)),
    ("a jump", |world| world.shafts[0].encoder = Encoder::Off(0.5)),
    ("a turned encoder", |world| world.shafts[0].encoder = Encoder::Reversed),
    ("a fault of the motor", |world| world.shafts[0].motor.fault(1)),
    ("a bus that is passive", |world| world.event(0, BusEvent::ErrorPassive)),
    ("a bus that is off", |world| world.event(0, BusEvent::BusOff)),
    ("a late bridge", |world| world.now_ns += 60 * MS),
    ("a speed", |world| world.shafts[0].velocity = 12.0),
];

#[test]
fn every_fault_in_motion_replays_at_its_cycle_one_to_ten_seconds_after_arming() {
    for (place, (name, drive)) in all_drives().into_iter().enumerate() {
        for (number, (kind, begin)) in KINDS.iter().enumerate() {
            let text = World::text(&drive, "");
            let record = Some(Record::default());
            let world = World { record, ..World::read_beside(text.clone(), DBC_FILE) };
            let mut world = prepared(world, &drive);
            (world.loss, world.noise, world.jitter_ns) = (0.005, 1.0, [MS / 2, MS]);
            swing(&mut world, [0.9, 2.3, 3.7, 9.6][(place + number) % 4]);
            let before_ns = world.now_ns;
            begin(&mut world);
            swing(&mut world, 1.0);
            let faults = checked(&format!("{name}, {kind}"), &text, &world);
            let of_it = faults.iter().filter(|(t, ..)| *t >= before_ns).count();
            assert!(of_it > 0, "{name}, {kind}: {:?}", world.state(0));
        }
    }
}

#[test]
fn a_fault_log_of_a_motor_that_is_armed_a_second_time_brings_its_fault() {
    for (name, drive) in drives() {
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

#[test]
fn a_frozen_encoder_that_noise_or_a_dither_shows_is_found_again_at_its_cycle() {
    for (name, drive) in drives() {
        let dither = if drive.contains("mode: position") { 0.01 } else { 0.15 };
        let dither = format!("  dither: {dither}\n");
        for (noise, more) in [(2.0, ""), (0.0, dither.as_str())] {
            // this world gives exact numbers no noise
            if more.is_empty() && (name.contains("moteus") || name.contains("odrive")) {
                continue;
            }
            let text = World::text(&drive, more);
            let record = Some(Record::default());
            let world = World { record, noise, ..World::read(text.clone()) };
            let mut world = prepared(world, &drive);
            // learned longer ago than the log is long
            world.cycles(1000);
            let position = world.shafts[0].position;
            world.shafts[0].encoder = Encoder::Frozen { position, velocity_too: true };
            world.cycles(200);
            let faults = checked(name, &text, &world);
            let reasons: Vec<Reason> = faults.iter().map(|(_, _, reason)| *reason).collect();
            assert_eq!(reasons, [Reason::FeedbackFrozen], "{name} {noise} {more:?}");
        }
    }
}

#[test]
fn a_motor_that_came_back_elsewhere_before_a_fault_log_begins_is_elsewhere_in_it() {
    let record = Some(Record::default());
    let mut world = World { record, ..World::read(TWO.to_owned()) };
    assert!(world.arm().is_some());
    world.give(Setpoint { stiffness: 5.0, damping: 0.1, ..Setpoint::default() });
    world.operate(Operation::Disarm);
    world.cycles(500);
    world.shafts[0].position += 1.0;
    world.cycles(1000);
    world.operate(Operation::Arm);
    world.cycles(125);
    assert_eq!(world.state(0), (MechanismState::Disabled, Reason::PositionChanged));
    assert_eq!(world.state(1).0, MechanismState::Enabled, "{:?}", world.state(1));
    world.shafts[1].motor.silence(true);
    world.cycles(100);
    let faults = checked("elsewhere", TWO, &world);
    assert_eq!(faults.iter().map(|(_, of, _)| *of).collect::<Vec<_>>(), [1]);
}
