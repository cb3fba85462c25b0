//! Late commands and stops of shafts that turn, in every mode.

use super::super::monitors::position;
use super::bench::{self, Bench, Shaft};
use super::*;
use crate::config::{MechanismStop, StopFunction};

const MODES: [Mode; 4] = [Mode::Impedance, Mode::Position, Mode::Velocity, Mode::Torque];

/// A bench whose shafts hold still in one mode.
fn turning(mode: Mode, inertia: f64) -> Bench {
    stopping(mode, inertia, MechanismStop::default())
}

/// As [`turning`], with a stop.
fn stopping(mode: Mode, inertia: f64, stop: MechanismStop) -> Bench {
    let mut bench = Bench::new(|configuration| {
        configuration.stops = vec![stop; 2];
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
        bench.bridge.operate(bench.now_ns, Operation::Disarm);
        bench.steps(450);
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
fn a_load_that_was_carried_in_peace_is_carried_on_when_it_is_disarmed() {
    for mode in MODES {
        let mut bench = turning(mode, 0.02);
        bench.target.torque = 1.0;
        bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.load = -1.5);
        bench.steps(500);
        bench.bridge.operate(bench.now_ns, Operation::Disarm);
        let before = bench.shaft().position;
        bench.steps(500);
        let drop = bench.shaft().position - before;
        // a drive's own controller has the rest of the load, and gives way to it
        let allowed = match mode {
            Mode::Velocity => 0.1,
            Mode::Position => 4e-3,
            _ => 2e-3,
        };
        assert!(drop.abs() < allowed, "{mode:?}: {drop}");
        bench.step();
        assert_eq!(bench.last(0), DriveCommand::Off);
    }
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

/// Steps until the mechanism has no power; how many.
fn steps_to_the_end(bench: &mut Bench) -> usize {
    (0..20_000)
        .find(|_| {
            bench.step();
            bench.last(0) == DriveCommand::Off
        })
        .expect("an end")
}

#[test]
fn a_motor_without_torque_at_once_is_given_none() {
    let stop = MechanismStop { function: StopFunction::Sto, ..MechanismStop::default() };
    let mut bench = stopping(Mode::Impedance, 0.01, stop);
    bench.bridge.operate(bench.now_ns, Operation::Disarm);
    bench.step();
    assert_eq!((bench.states()[0], bench.last(0)), (MechanismState::Disabled, DriveCommand::Off));
}

#[test]
fn a_motor_that_is_held_is_held_for_its_time() {
    let function = StopFunction::Ss2;
    let stop = MechanismStop { function, hold_ns: 700 * MS, ..MechanismStop::default() };
    for mode in MODES {
        let mut bench = stopping(mode, 0.01, stop);
        bench.target.torque = 1.0;
        bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.load = -1.0);
        bench.bridge.motors.iter_mut().for_each(|motor| motor.gravity = 1.0);
        bench.steps(300);
        bench.bridge.operate(bench.now_ns, Operation::Disarm);
        let before = bench.shaft().position;
        bench.steps(1200);
        assert_eq!(bench.states()[0], MechanismState::Stopping);
        assert!((bench.shaft().position - before).abs() < 1e-3, "{mode:?}");
        bench.step();
        assert_eq!(bench.last(0), DriveCommand::Off);
    }
}

#[test]
fn a_load_is_lowered_at_its_speed_until_it_lies() {
    let stop = MechanismStop {
        function: StopFunction::Lower,
        stop_ns: 200 * MS,
        hold_ns: 3000 * MS,
        lower_velocity: 0.5,
    };
    for mode in MODES {
        for floor in [-0.4, f64::NEG_INFINITY] {
            let mut bench = stopping(mode, 0.01, stop);
            bench.target.torque = 1.5;
            for shaft in bench.shafts.iter_mut().flatten() {
                (shaft.load, shaft.floor) = (-1.5, floor);
            }
            bench.bridge.motors.iter_mut().for_each(|motor| motor.gravity = 1.5);
            bench.steps(300);
            bench.bridge.operate(bench.now_ns, Operation::Disarm);
            bench.steps(200);
            assert!(bench.shaft().position > -0.05, "{mode:?}: {:?}", bench.shaft());
            bench.steps(500);
            let velocity = bench.shaft().velocity;
            assert!((velocity + 0.5).abs() < 0.06, "{mode:?}: {velocity}");
            let steps = steps_to_the_end(&mut bench);
            if floor.is_finite() {
                assert!(steps < 700, "{mode:?}: {steps}");
            } else {
                // to the limit of the position, where nothing lowers it any more
                let position = bench.shaft().position;
                assert!((-1.5..-0.9).contains(&position), "{mode:?}: {position}");
            }
        }
    }
}

#[test]
fn a_motor_that_is_accelerated_by_its_stop_loses_its_torque() {
    let mut bench = turning(Mode::Torque, 0.01);
    let shaft = bench.shaft();
    (shaft.sensor, shaft.velocity) = (-1.0, 3.0);
    bench.bridge.fail_mechanism(0, Reason::FollowingError);
    assert!(steps_to_the_end(&mut bench) < 30);
    assert!(bench.shaft().velocity < 10.0, "{:?}", bench.shaft());
    assert_eq!(
        (bench.states()[0], bench.reason(0)),
        (MechanismState::Fault, Reason::FollowingError)
    );
}

#[test]
fn a_weak_damper_stops_a_motor_within_the_braking_distance_before_a_limit() {
    for (inertia, speed) in [(0.04, 3.0), (0.2, 1.0), (0.2, 3.0), (0.6, 2.0)] {
        let mut bench = turning(Mode::Torque, inertia);
        let motor = &mut bench.bridge.motors[0];
        motor.stop_damping = 0.25 * motor.config.limits.damping();
        motor.braking = [motor.config.braking(), position::delay(bench::MS)];
        let way = position::way(speed, motor.braking);
        let shaft = bench.shaft();
        (shaft.velocity, shaft.position) = (speed, 1.0 - way);
        bench.step();
        bench.bridge.fail_mechanism(0, Reason::PositionLimit);
        let mut most: f64 = 0.0;
        for _ in 0..450 {
            bench.step();
            most = most.max(bench.shaft().position);
        }
        assert!(most < 1.02, "{inertia} at {speed}: {most}");
    }
}

#[test]
fn a_rotor_too_light_for_the_damper_of_the_bridge_is_stopped_by_a_weaker_one() {
    // d dt / J from 0.2 to 2; beyond, the greatest effort turns the motor round in one cycle
    for inertia in [0.01, 0.005, 0.002, 0.001] {
        let mut bench = turning(Mode::Torque, 0.01);
        bench.shafts.iter_mut().flatten().for_each(|shaft| shaft.inertia = inertia);
        bench.shaft().velocity = 4.0;
        bench.step();
        bench.bridge.fail_mechanism(0, Reason::FollowingError);
        bench.steps(450);
        let mut most: f64 = 0.0;
        for _ in 0..50 {
            bench.step();
            most = most.max(bench.shaft().velocity.abs());
        }
        assert!(most < 0.05, "{inertia}: {most}");
    }
}

#[test]
fn while_it_is_stopped_efforts_and_positions_stay_within_their_limits() {
    let mut seed = 7_u64;
    let mut random = |least: f64, most: f64| {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        least + (most - least) * (seed >> 11) as f64 / (1_u64 << 53) as f64
    };
    for _ in 0..200 {
        let mode = MODES[random(0.0, 4.0) as usize];
        let function =
            [StopFunction::Ss1, StopFunction::Ss2, StopFunction::Lower][random(0.0, 3.0) as usize];
        let stop =
            MechanismStop { function, stop_ns: 300 * MS, hold_ns: 300 * MS, lower_velocity: 0.5 };
        let mut bench = stopping(mode, 10_f64.powf(random(-3.5, 0.5)), stop);
        let load = random(-8.0, 8.0);
        let velocity = random(-9.0, 9.0);
        let position = random(-1.2, 1.2);
        for shaft in bench.shafts.iter_mut().flatten() {
            (shaft.load, shaft.velocity, shaft.position) = (load, velocity, position);
        }
        bench.step();
        let known = random(-1.0, 1.0).max(0.0) * -load;
        bench.bridge.motors.iter_mut().for_each(|motor| motor.gravity = known);
        bench.bridge.fail_mechanism(0, Reason::FollowingError);
        loop {
            let measured = bench.shaft().position;
            let speed = bench.shaft().velocity;
            bench.step();
            let DriveCommand::On(given) = bench.last(0) else { break };
            assert!((-1.0..=1.0).contains(&given.position), "{mode:?}: {given:?}");
            let total = match mode {
                Mode::Impedance | Mode::Torque => {
                    given.torque
                        + given.stiffness * (given.position - measured)
                        + given.damping * (given.velocity - speed)
                }
                Mode::Position | Mode::Velocity => given.torque,
            };
            assert!(total.abs() <= 10.0 + 1e-3, "{mode:?}: {given:?}");
        }
    }
}
