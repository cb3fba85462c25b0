//! Recorded input of a bridge with the robot's model gives the same frames and the same fault.

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::log::{Line, What, sent};
use sarrus_proto::actuators::{MechanismState, Operation, Reason};

use crate::swing::{upper_body, world};
use crate::world::{MS, Record};

/// The frames of a bridge that is given these lines, as text and back, and its last fault.
fn replay(lines: &[Line]) -> (Vec<String>, Option<(usize, Reason)>) {
    let mut bridge = Bridge::new(upper_body());
    let configuration = bridge.configuration().without_motors();
    let mut frames = Vec::new();
    for line in lines {
        let line = Line::read(&line.text(&configuration), &configuration).unwrap();
        line.apply(&mut bridge);
        if line.what == What::Cycle {
            frames.extend(sent(&bridge, line.t));
        }
    }
    (frames, bridge.faults().1)
}

#[test]
fn a_fault_that_the_model_found_replays_to_the_byte() {
    let mut world = world(upper_body());
    (world.loss, world.noise, world.jitter_ns) = (0.01, 1.0, [MS / 5, MS]);
    world.record = Some(Record::default());
    world.cycles(20);
    world.operate(Operation::Arm);
    world.cycles(80);
    assert!(world.is_enabled(), "{:?}", world.state(0));

    // both screws of the torso as far as their limits let them: no pose of the robot has that
    let of = |name: &str| {
        let actuators = &world.bridge.configuration().actuators;
        actuators.iter().position(|known| known == name).unwrap()
    };
    let left = of("BodyActL");
    let right = of("BodyActR");
    while world.state(left).1 == Reason::None {
        for actuator in [left, right] {
            world.command.position[actuator] += 0.045 * world.period_ns as f64 * 1e-9;
            world.command.velocity[actuator] = 0.045;
        }
        world.cycle();
        assert!(world.now_ns < 2_900 * MS, "{:?}", world.state(left));
    }
    world.cycles(20);
    let (state, reason) = world.state(left);
    assert_eq!(state, MechanismState::Stopping);
    assert!(matches!(reason, Reason::MechanismLimit | Reason::NearSingular), "{reason:?}");

    // all that it was given, twice
    let Record { lines, frames, .. } = world.record.take().unwrap();
    let fault = world.bridge.faults().1;
    for _ in 0..2 {
        let again = replay(&lines);
        assert_eq!(again.0.len(), frames.len());
        assert!(again.0.iter().zip(&frames).all(|(one, other)| one == other));
        assert_eq!(again.1, fault);
    }

    // and from its state in the middle on
    let middle = lines.len() / 2
        + lines[lines.len() / 2..].iter().position(|line| line.what == What::Cycle).unwrap();
    let (before, after) = lines.split_at(middle + 1);
    let mut bridge = Bridge::new(upper_body());
    before.iter().for_each(|line| assert!(line.apply(&mut bridge)));
    let mut words = bridge.room();
    assert!(bridge.save(&mut words));
    let state = Line { t: lines[middle].t, what: What::State(words.into()) };
    let (of_log, fault_of_log) = replay(&[&[state], after].concat());
    assert!(of_log.len() > 1000 && frames.ends_with(&of_log));
    assert_eq!(fault_of_log, fault);
}
