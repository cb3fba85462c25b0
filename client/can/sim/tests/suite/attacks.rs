//! Attacks on the core: none leaves a mechanism that follows commands. The table is printed; that
//! of both frontends is a test of the whole.

use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, Id};
use sarrus_proto::actuators::{MechanismState, Operation, Reason, flag};

use crate::attack_table::{
    ATTACKS, Outcome, always, armed, bound, drives, is_possible, swing, watch,
};
use crate::world::{Encoder, MS, World};

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

/// A bridge over the same motor, started anew with the positions that the last one knew.
fn started_again(world: World, drive: &str) -> World {
    let mut again = World::one(drive, "");
    for (actuator, position) in world.bridge.positions().collect::<Vec<_>>() {
        again.bridge.remember(actuator, position);
    }
    again.shafts[0].encoder = world.shafts[0].encoder;
    again.shafts[0].position = world.shafts[0].position;
    again
}

#[test]
fn a_zero_that_moves_without_power_is_not_armed_before_it_is_confirmed() {
    for (name, drive) in drives() {
        for silent_ms in [0, 500, u64::MAX] {
            let mut world = armed(&drive);
            world.operate(Operation::Disarm);
            world.cycles(500);
            let moved = |world: &mut World| world.shafts[0].encoder = Encoder::Off(1.2);
            match silent_ms {
                // with the bridge, after a silence, and over a new start of the bridge
                0 => moved(&mut world),
                u64::MAX => {
                    moved(&mut world);
                    world = started_again(world, &drive);
                }
                ms => {
                    world.loss = 1.0;
                    world.cycles(ms as usize / 4);
                    world.loss = 0.0;
                    moved(&mut world);
                }
            }
            world.cycles(250);
            let flags = world.bridge.state().flags[0];
            assert_ne!(flags & flag::POSITION_CHANGED, 0, "{name} {silent_ms}");
            world.operate(Operation::Reset);
            assert_eq!(world.arm(), None, "{name} {silent_ms}");
            assert_eq!(world.state(0).1, Reason::PositionChanged, "{name} {silent_ms}");
            world.operate(Operation::Confirm);
            assert!(world.arm().is_some(), "{name} {silent_ms}: {:?}", world.state(0));
        }
        // a motor that is where it was needs no operator
        let mut world = armed(&drive);
        world.operate(Operation::Disarm);
        world.cycles(500);
        let mut world = started_again(world, &drive);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
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
        for _ in 0..125 {
            world.cycle();
            assert_ne!(world.state(0).0, MechanismState::Enabled, "{name}");
        }
        assert_eq!(world.state(0).1, Reason::Moving, "{name}");
        (world.shafts[0].velocity, world.shafts[0].inertia) = (0.0, 0.011);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
    }
}

#[test]
fn a_limit_is_not_passed_however_fast_it_is_approached() {
    for (name, drive) in drives().into_iter().filter(|(_, drive)| !drive.contains("mode: position"))
    {
        for inertia in [0.011, 0.05, 0.15] {
            for speed in [1.0, 3.0, 4.5] {
                let mut world = World::one(&drive, "");
                (world.shafts[0].inertia, world.shafts[0].friction) = (inertia, 0.0);
                assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
                let mut farthest = 0_f64;
                for _ in 0..1500 {
                    // gently up to the speed, and then on without an end
                    let velocity = world.shafts[0].velocity;
                    let torque = (0.5 * (speed - velocity)).clamp(-0.3, 0.3);
                    world.give(Setpoint { torque, ..Setpoint::default() });
                    world.cycle();
                    farthest = farthest.max(world.shafts[0].position);
                }
                println!("{name:20} {inertia} kg m² {speed} rad/s: {farthest:.3} rad");
                assert!(farthest < 3.0 + 0.06, "{name} {inertia} {speed}: {farthest}");
                assert_eq!(world.state(0), (MechanismState::Fault, Reason::PositionLimit));
            }
        }
    }
}

#[test]
fn a_motion_to_a_limit_slows_down_before_it() {
    for (name, drive) in drives() {
        let mut world = armed(&drive);
        for step in 0..1500 {
            let position = (0.012 * f64::from(step)).min(3.0);
            let velocity = if position < 3.0 { 3.0 } else { 0.0 };
            world.give(Setpoint { position, velocity, torque: 0.0, stiffness: 5.0, damping: 0.4 });
            world.cycle();
        }
        let (state, reason) = world.state(0);
        assert_eq!(state, MechanismState::Enabled, "{name}: {reason:?}");
        let position = world.shafts[0].position;
        if !drive.contains("mode: torque") && !name.contains("torque") {
            assert!((position - 3.0).abs() < 0.05, "{name}: {position}");
        }
    }
}

#[test]
fn a_hot_motor_holds_its_load_until_it_is_stopped() {
    for (name, drive) in drives().into_iter().filter(|(_, drive)| !drive.contains("cia402")) {
        let mut world = World::one(&drive, "");
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
        world.give(Setpoint { stiffness: 20.0, damping: 0.3, ..Setpoint::default() });
        world.cycles(250);
        world.shafts[0].load = -1.5;
        world.cycles(500);
        let held = world.shafts[0].position;
        // up to the drive's own cut-off, in a minute
        let mut warned = false;
        for step in 0..15_000 {
            world.shafts[0].temperature = 80.0 + 32.0 * f64::from(step) / 15_000.0;
            world.cycle();
            let (state, reason) = world.state(0);
            if state != MechanismState::Enabled {
                assert_eq!((state, reason), (MechanismState::Stopping, Reason::OverTemperature));
                break;
            }
            warned |= world.bridge.state().flags[0] & flag::DERATED != 0;
            let sunk = (world.shafts[0].position - held).abs();
            assert!(sunk < 0.02, "{name}: {sunk} at {} °C", world.shafts[0].temperature);
        }
        assert!(warned, "{name}");
        assert_eq!(world.state(0).0, MechanismState::Stopping, "{name}");
        // the stop has all of the effort
        world.cycles(100);
        let torque = world.shafts[0].torque;
        assert!(torque > 1.2, "{name}: {torque}");
    }
}

#[test]
fn a_hot_motor_goes_to_its_rest_pose_before_it_lets_go() {
    let drive = &drives()[0].1;
    let mut world = World::one(drive, "  rest: -0.8\n");
    assert!(world.arm().is_some(), "{:?}", world.state(0));
    for step in 0..500 {
        let position = 1e-3 * f64::from(step);
        world.give(Setpoint { position, stiffness: 20.0, damping: 0.3, ..Setpoint::default() });
        world.cycle();
    }
    world.shafts[0].load = -0.5;
    world.cycles(250);
    world.shafts[0].temperature = 120.0;
    world.cycles(200);
    assert_eq!(world.state(0), (MechanismState::Stopping, Reason::OverTemperature));
    let mut fastest = 0_f64;
    while world.state(0).0 == MechanismState::Stopping && world.now_ns < 60_000 * MS {
        world.cycle();
        fastest = fastest.max(world.shafts[0].velocity.abs());
    }
    assert_eq!(world.state(0), (MechanismState::Fault, Reason::OverTemperature));
    let position = world.shafts[0].position;
    assert!((position + 0.8).abs() < 0.1 && fastest < 0.6, "{position} {fastest}");
}

/// Time until a code that freezes under a constant effort is found, within ten seconds `[ms]`.
fn frozen_while_holding(drive: &str, noise: f64, more: &str) -> (Option<u64>, Reason, u32) {
    let mut world = World { noise, ..World::one(drive, more) };
    assert!(world.arm().is_some(), "{drive}: {:?}", world.state(0));
    world.shafts[0].load = -1.0;
    world.give(Setpoint { stiffness: 5.0, damping: 0.1, torque: 1.0, ..Setpoint::default() });
    world.cycles(2500);
    assert_eq!(world.state(0).0, MechanismState::Enabled, "{drive}: {:?}", world.state(0));
    let flags = world.bridge.state().flags[0];
    let position = world.shafts[0].position;
    world.shafts[0].encoder = Encoder::Frozen { position, velocity_too: true };
    let begin_ns = world.now_ns;
    while world.now_ns < begin_ns + 10_000 * MS && world.state(0).0 == MechanismState::Enabled {
        world.cycle();
    }
    let (state, reason) = world.state(0);
    let ms = (world.now_ns - begin_ns) / MS;
    ((state != MechanismState::Enabled).then_some(ms), reason, flags & flag::FROZEN_UNDETECTABLE)
}

#[test]
fn an_encoder_that_freezes_while_a_load_is_held_is_found_by_noise_or_a_dither() {
    for (name, drive) in drives() {
        let dither = if drive.contains("mode: position") { 0.01 } else { 0.15 };
        let dither = format!("  dither: {dither}\n");
        for (noise, more) in [(2.0, ""), (0.0, dither.as_str()), (2.0, dither.as_str())] {
            // this world gives exact numbers no noise
            let is_exact = name.contains("moteus") || name.contains("odrive");
            if more.is_empty() && is_exact {
                continue;
            }
            let (ms, reason, blind) = frozen_while_holding(&drive, noise, more);
            println!("{name:20} noise {noise} {more:18?} {ms:?} {}", reason.name());
            assert_eq!((reason, blind), (Reason::FeedbackFrozen, 0), "{name} {noise} {more:?}");
            assert!(ms.is_some_and(|ms| ms < 400), "{name} {noise} {more:?}: {ms:?}");
        }
        let (ms, reason, blind) = frozen_while_holding(&drive, 0.0, "");
        assert_eq!((ms, reason), (None, Reason::None), "{name}");
        assert_ne!(blind, 0, "{name}: the state says that nothing would tell");
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
