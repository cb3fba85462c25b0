//! Attacks on the core: none leaves a mechanism that follows commands. The table is printed; that
//! of both frontends is a test of the whole.

use sarrus_can_core::frame::{Frame, Id};
use sarrus_proto::actuators::{MechanismState, Operation, Reason, flag};

use crate::attack_table::{
    ATTACKS, Outcome, always, armed, bound, drives, is_possible, swing, watch,
};
use crate::world::{MS, World};

#[test]
fn no_attack_leaves_a_mechanism_enabled() {
    let mut late = Vec::new();
    for (attack, run) in ATTACKS {
        println!("\n{attack}");
        for (name, drive) in drives() {
            if !is_possible(attack, name) {
                println!("  {name:20} cannot be seen");
                continue;
            }
            let mut world = armed(&drive);
            let Outcome { ms, safe_ms, reason, position, velocity, torque } = run(&mut world);
            let time = ms.map_or("never".to_owned(), |ms| format!("{ms:.0} ms"));
            println!(
                "  {name:20} {time:>8}, {:>8} {:18} {position:6.3} rad {velocity:6.2} rad/s \
                    {torque:6.2} N m",
                safe_ms.map_or("never".to_owned(), |ms| format!("{ms:.0} ms")),
                reason.name()
            );
            if ms.is_none_or(|ms| ms > bound(attack)) || safe_ms.is_none() {
                late.push(format!("{attack}: {name} {time}"));
            }
        }
    }
    assert!(late.is_empty(), "{late:#?}");
}

#[test]
fn nothing_is_armed_whose_feedback_is_old_from_the_beginning() {
    for (name, drive) in drives() {
        let mut world = World::one(&drive, "");
        world.shafts[0].delay_ns = 200 * MS;
        let armed = world.arm();
        println!("{name:20} {armed:?} {}", world.state(0).1.name());
        // measurements that come unasked cannot be paired without a question that is answered, but
        // contradict the commanded motion
        if drive.contains("odrive") && !drive.contains("endpoint") {
            swing(&mut world, 2.0);
            println!("{name:20} in motion: {}", world.state(0).1.name());
            assert_ne!(world.state(0).0, MechanismState::Enabled, "{name}");
            continue;
        }
        assert_eq!(armed, None, "{name}");
    }
}

#[test]
fn nothing_is_armed_by_old_feedback_while_its_settings_are_read() {
    for (name, drive) in drives() {
        if drive.contains("odrive") && !drive.contains("endpoint") {
            continue;
        }
        for delay in [30, 60, 120, 200] {
            for ms in [0, 20, 60, 100] {
                let mut world = World::one(&drive, "");
                world.shafts[0].delay_ns = delay * MS;
                world.cycles(ms / 4);
                world.operate(Operation::Arm);
                for _ in 0..750 {
                    world.cycle();
                    let powered = world.bridge.state().flags[0] & flag::POWERED;
                    assert_eq!(powered, 0, "{name} {delay} {ms}");
                }
            }
        }
    }
}

#[test]
fn nothing_is_armed_in_motion() {
    for (name, drive) in drives() {
        let mut world = World::one(&drive, "");
        (world.shafts[0].position, world.shafts[0].velocity) = (-2.0, 1.0);
        (world.shafts[0].friction, world.shafts[0].inertia) = (0.0, 1.0);
        world.cycles(125);
        world.operate(Operation::Arm);
        for _ in 0..250 {
            world.cycle();
            assert_ne!(world.state(0).0, MechanismState::Enabled, "{name}");
        }
        assert_eq!(world.state(0).1, Reason::Moving, "{name}");
        (world.shafts[0].velocity, world.shafts[0].position) = (0.0, 0.0);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
    }
}

#[test]
fn a_motor_in_time_is_armed_with_loss_jitter_and_noise() {
    for (name, drive) in drives() {
        let mut world = World::one(&drive, "");
        (world.loss, world.noise, world.jitter_ns) = (0.01, 2.0, [MS / 2, 2 * MS]);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
        swing(&mut world, 5.0);
        assert_eq!(world.state(0).0, MechanismState::Enabled, "{name}: {:?}", world.state(0));
    }
}

#[test]
fn nothing_is_armed_outside_its_limits() {
    for (name, drive) in drives() {
        let mut world = World::one(&drive, "");
        world.shafts[0].position = 5.0;
        assert_eq!(world.arm(), None, "{name}");
        assert_eq!(world.state(0), (MechanismState::Disabled, Reason::OutsideLimits), "{name}");
    }
}

#[test]
fn a_second_master_is_found_by_one_frame() {
    let mut world = armed(&drives()[0].1);
    world.intruder = Frame::classic(Id::Standard(4), &[0x7F, 0xFF, 0x7F, 0xF0, 0, 0, 0x0F, 0xFF]);
    let outcome = watch(&mut world, 1.0, always);
    println!("{:?} {:?} {:.2} N m", outcome.ms, outcome.reason, world.shafts[0].torque);
    assert!(outcome.ms.is_some_and(|ms| ms <= 20.0));
    assert_eq!(outcome.reason, Reason::SecondMaster);
}

#[test]
fn a_joint_in_balance_is_no_fault() {
    for (name, drive) in drives() {
        let mut world = armed(&drive);
        // against gravity, then at a hard stop, with constant efforts and without noise
        for step in 0..500 {
            world.shafts[0].load = -f64::from(step.min(250)) / 250.0;
            world.cycle();
        }
        world.cycles(250 * 20);
        assert_eq!(world.state(0).0, MechanismState::Enabled, "{name}: {:?}", world.state(0));
        world.shafts[0].is_blocked = true;
        world.cycles(250 * 20);
        assert_eq!(world.state(0).0, MechanismState::Enabled, "{name}: {:?}", world.state(0));
    }
}
