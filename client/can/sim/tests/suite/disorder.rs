//! Disorder around motors that are all right: strangers on the bus, operators in a hurry, clocks
//! that jump, configurations at the ends of their ranges; and a motor with its neighbour's name.

use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, Id};
use sarrus_proto::actuators::{MechanismState, Operation, Reason};

use crate::attack_table::{armed, drives, swing};
use crate::world::{Chance, Encoder, MS, World};

const SOFT: Setpoint =
    Setpoint { position: 1.0, velocity: 0.0, torque: 0.0, stiffness: 1.0, damping: 0.2 };

/// The drives of the table, and those that it leaves out.
fn all_drives() -> Vec<(&'static str, String)> {
    let torque = "id: 3, motor_torque_constant: 0.1, pole_pairs: 7";
    let more = [
        ("rmd torque", "{protocol: rmd, id: 3, motor_torque_constant: 1}".to_owned()),
        ("vesc torque", format!("{{protocol: vesc, {torque}}}")),
        ("ak_servo torque", format!("{{protocol: ak_servo, {torque}, reduction: 9}}")),
    ];
    drives().into_iter().chain(more).collect()
}

#[test]
fn frames_of_strangers_at_the_full_rate_of_a_bus_change_nothing() {
    for (name, drive) in all_drives() {
        let mut world = armed(&drive);
        for k in 0..500_u32 {
            world.cycle();
            for j in 0..40 {
                let ids =
                    [Id::standard(0x400 + (k * 40 + j) % 0x100), Id::extended(0x1F00_0000 + k)];
                for id in ids.into_iter().flatten() {
                    let frame = Frame::classic(id, &[k as u8; 8]).unwrap();
                    world.bridge.receive(world.now_ns, 0, &frame);
                }
            }
        }
        assert_eq!(world.state(0).0, MechanismState::Enabled, "{name}: {:?}", world.state(0));
        assert!(world.bridge.bus_counters(0).unwrap().1.counts.unknown > 30_000, "{name}");
    }
}

#[test]
fn operators_in_a_hurry_get_neither_speed_nor_a_bridge_that_cannot_be_armed() {
    for (name, drive) in all_drives() {
        let mut world = World::one(&drive, "");
        let mut chance = Chance(7);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
        world.give(SOFT);
        let operations = [Operation::Arm, Operation::Disarm, Operation::Reset, Operation::Return];
        for _ in 0..3000 {
            if chance.bits().is_multiple_of(7) {
                world.operate(operations[(chance.bits() % 6) as usize % 4]);
            }
            world.cycle();
            let velocity = world.shafts[0].velocity.abs();
            assert!(velocity < 1.05 * 5.0, "{name}: {velocity}");
            assert_ne!(world.state(0).0, MechanismState::Fault, "{name}: {:?}", world.state(0));
        }
        // nothing is armed before its shaft has come to rest
        world.shafts[0].friction = 0.2;
        for operation in [Operation::Disarm, Operation::Reset, Operation::Arm] {
            world.operate(operation);
            world.cycles(250);
        }
        assert_eq!(world.state(0).0, MechanismState::Enabled, "{name}: {:?}", world.state(0));
    }
}

#[test]
fn a_clock_that_jumps_takes_the_power_away() {
    for (name, drive) in all_drives() {
        for jump_ns in [-500, 150, 3_600_000_i64].map(|ms| ms * MS as i64) {
            let mut world = armed(&drive);
            world.bridge.cycle(world.now_ns.saturating_add_signed(jump_ns));
            world.bridge.cycle(world.now_ns.saturating_add_signed(jump_ns.max(0)));
            let (state, reason) = world.state(0);
            assert_ne!(state, MechanismState::Enabled, "{name} {jump_ns}");
            println!("{name:20} {:>9} ms {}", jump_ns / MS as i64, reason.name());
        }
    }
}

#[test]
fn a_limit_on_one_side_holds_and_the_other_side_is_free() {
    let limited =
        |drive: &str| World::read(World::text(drive, "").replace("[-3, 3]", "[-1000, 1]"));
    for (name, drive) in all_drives().iter().filter(|(name, _)| !name.contains("position")) {
        for side in [1.0, -1.0] {
            let mut world = limited(drive);
            assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
            // slow enough for the limit of the speed
            for shaft in &mut world.shafts {
                shaft.friction = 0.2;
            }
            world.give(Setpoint {
                torque: side * 0.6,
                position: side * 50.0,
                ..Setpoint::default()
            });
            world.cycles(500);
            let position = world.shafts[0].position;
            let state = world.state(0);
            match side > 0.0 {
                // efforts outwards end there, or it is stopped
                true => assert!(position < 1.3, "{name}: {position} {state:?}"),
                false => {
                    assert_eq!(state.0, MechanismState::Enabled, "{name}: {position} {state:?}");
                    assert!(position < -3.5, "{name}: {position}");
                }
            }
        }
    }
}

const TWO: &str = "rate_hz: 250\nramp_ms: 100\nbuses:\n- {name: bench, interface: none, channel: a}\n\
    motors:\n- {actuator: first, bus: bench, offset: 0, limits: {position: [-9, 9], effort: 2, velocity: 5}, \
    watchdog_ms: 50, damping: 0.1, drive: {protocol: mit, variant: damiao, id: 1, reply_id: 17, \
    position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: 500, \
    damping_range: 5}}\n\
    - {actuator: second, bus: bench, offset: 0, limits: {position: [-9, 9], effort: 2, velocity: 5}, \
    watchdog_ms: 50, damping: 0.1, drive: {protocol: cybergear, id: 10, position_range: 12.5}}\n\
    - {actuator: third, bus: bench, offset: 0, limits: {position: [-9, 9], effort: 2, velocity: 5}, watchdog_ms: 50, \
    damping: 0.1, drive: {protocol: mit, variant: damiao, id: 2, reply_id: 18, \
    position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: 500, \
    damping_range: 5}}\n";

#[test]
fn mechanisms_of_several_protocols_share_a_bus_and_fail_one_by_one() {
    let mut world = World::read(TWO.to_owned());
    assert!(world.arm().is_some(), "{:?}", world.state(0));
    swing(&mut world, 3.0);
    assert!(world.is_enabled());
    world.shafts[1].encoder = Encoder::Off(1.0);
    world.cycles(10);
    let states = [0, 1, 2].map(|actuator| world.state(actuator));
    assert_eq!(states[1], (MechanismState::Fault, Reason::FeedbackJump));
    assert_eq!(states[0].0, MechanismState::Enabled);
    assert_eq!(states[2].0, MechanismState::Enabled);
}

#[test]
fn a_motor_that_answers_with_its_neighbours_name_stops_both() {
    let mut world = World::read(TWO.to_owned());
    assert!(world.arm().is_some(), "{:?}", world.state(0));
    swing(&mut world, 3.0);
    // the third says that it is the first
    world.shafts[2].poses_as = Some((Id::Standard(17), 0x01));
    world.cycles(10);
    let states = [0, 1, 2].map(|actuator| world.state(actuator));
    println!("{states:?}");
    assert_eq!(states[0].0, MechanismState::Fault);
    assert_eq!(states[1].0, MechanismState::Enabled);
    assert_eq!(states[2], (MechanismState::Fault, Reason::FeedbackStale));
}
