//! Attacks by somebody who knows the documentation only: motors that answer for others, reboot or
//! repeat their past, wires and numbers that are mixed up, buses and clocks that come back, streams
//! that end, and configurations at the edge of numbers.

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::config::{Commissioning, Configuration, Surroundings};
use sarrus_can_core::drive::Setpoint;
use sarrus_models::LoadError;
use sarrus_proto::actuators::{MechanismState, Operation, Reason};
use sarrus_proto::counts::CommandVerdict;

use crate::attack_table::{armed, drives, swing};
use crate::closed_loop::DBC_FILE;
use crate::robots::{self, Drawn, MARGIN};
use crate::soak::all_drives;
use crate::world::{Chance, MS, World};

/// Two motors and their mechanisms on one bus.
fn two(second: &str) -> World {
    let mit = "position_range: 12.5, velocity_range: 30, torque_range: 10, stiffness_range: 500, \
        damping_range: 5";
    let motor = |name: &str, ids: &str| {
        format!(
            "- {{actuator: {name}, bus: bench, offset: 0, limits: {{position: [-9, 9], effort: 2, \
             velocity: 5}}, watchdog_ms: 50, watchdog: believed, damping: 0.1, drive: {{protocol: mit, variant: \
             {second}, {ids}, {mit}}}}}\n"
        )
    };
    let head = "rate_hz: 250\nramp_ms: 100\nbuses:\n- {name: bench, interface: none, channel: a}\nmotors:\n";
    let motors = motor("first", "id: 1, reply_id: 17") + &motor("second", "id: 2, reply_id: 18");
    World::read(format!("{head}{motors}"))
}

const PUSH: Setpoint =
    Setpoint { position: 0.0, velocity: 0.0, torque: 0.6, stiffness: 0.0, damping: 0.0 };

#[test]
fn a_motor_that_answers_for_a_dead_neighbour_gives_no_torque_unseen() {
    for variant in ["damiao", "t_motor", "robstride", "mini_cheetah"] {
        let mut world = two(variant);
        world.shafts[0].motor.silence(true);
        let id = sarrus_can_core::frame::Id::Standard(17);
        world.shafts[1].poses_as = Some((id, 0x01));
        world.arm();
        world.give(PUSH);
        world.cycles(250);
        for shaft in &world.shafts {
            let (state, reason) = world.state(shaft.actuator);
            assert_ne!(state, MechanismState::Enabled, "{variant} {}", reason.name());
            assert!(!shaft.motor.plant.power || shaft.torque == 0.0, "{variant}: {}", shaft.torque);
        }
    }
}

#[test]
fn a_drive_that_reboots_in_motion_and_loses_its_zero_is_stopped_and_not_armed_again() {
    for (name, drive) in all_drives() {
        let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
        swing(&mut world, 3.7);
        let shaft = &mut world.shafts[0];
        shaft.motor.reboot();
        // it reports 0 where it is
        shaft.encoder = crate::world::Encoder::Off(-shaft.position);
        assert!(shaft.position.abs() > 0.5, "{}", shaft.position);
        world.cycles(100);
        let (state, reason) = world.state(0);
        assert_ne!(state, MechanismState::Enabled, "{name}: {}", reason.name());
        let shaft = &mut world.shafts[0];
        (shaft.velocity, shaft.friction) = (0.0, 0.5);
        world.cycles(250);
        world.operate(Operation::Reset);
        world.cycle();
        world.operate(Operation::Arm);
        world.cycles(500);
        let (state, reason) = world.state(0);
        assert_eq!((state, reason), (MechanismState::Disabled, Reason::PositionChanged), "{name}");
    }
}

#[test]
fn a_motor_that_repeats_its_past_is_found_when_it_should_move() {
    for (name, drive) in drives() {
        for is_held in [true, false] {
            let mut world = armed(&drive);
            world.noise = 1.0;
            // half a second of the past, held or in motion
            let hold = Setpoint { stiffness: 5.0, damping: 0.1, ..Setpoint::default() };
            world.tape = Some((Vec::new(), None));
            match is_held {
                true => {
                    world.give(hold);
                    world.cycles(125);
                }
                false => swing(&mut world, 0.5),
            }
            let (_, next) = world.tape.as_mut().unwrap();
            *next = Some(0);
            world.give(Setpoint { position: 1.0, torque: 0.8, ..hold });
            let begin_ns = world.now_ns;
            while world.now_ns < begin_ns + 2_000 * MS && world.is_enabled() {
                world.cycle();
            }
            let (_, reason) = world.state(0);
            let ms = (world.now_ns - begin_ns) / MS;
            println!("{name:22} held {is_held:5} {:20} {ms} ms", reason.name());
            assert!(!world.is_enabled(), "{name} held {is_held}");
        }
    }
}

/// The lambda with an encoder on its elbow, moved in the box.
fn lambda(turn: impl Fn(&mut World)) -> World {
    let drives: Vec<_> = drives().into_iter().filter(|(name, _)| name.contains("damiao")).collect();
    let drawn = (0..1000)
        .map(|seed| robots::draw(&mut Chance(seed), &drives, 250))
        .find(|drawn: &Drawn| drawn.name == "lambda" && drawn.encoder.is_some())
        .unwrap();
    let text = drawn.text.replace(&format!("margin: {MARGIN}"), "margin: 0.03");
    let mut world = World::of_robot(&Drawn { text, ..drawn }).unwrap();
    turn(&mut world);
    world
}

#[test]
fn a_gear_that_is_wrong_by_a_tenth_contradicts_a_second_encoder() {
    // true gears beside one in the file that is a tenth larger or smaller
    for factor in [1.0, 0.9, 1.1] {
        let mut world = lambda(|world| world.shafts[0].mapping.gear *= factor);
        let mut numbers = Vec::new();
        let at = |world: &mut World, y: f64, numbers: &mut Vec<f64>| {
            let robot = world.robot.as_mut().unwrap();
            robot.efforts([&[y], &[0.0], &[0.0]], numbers);
            let limits = world.shafts[0].limits;
            world.command.position[0] = numbers[0];
            world.command.effort[0] = numbers[2];
            world.command.stiffness[0] = 20.0 * limits.effort / (limits.upper - limits.lower);
            world.command.damping[0] = 0.05 * world.command.stiffness[0];
        };
        at(&mut world, 0.0, &mut numbers);
        assert!(world.arm().is_some(), "{:?}", world.state(0));
        for k in 0..1000 {
            at(&mut world, 0.55 * (f64::from(k) / 1000.0), &mut numbers);
            world.cycle();
        }
        let (state, reason) = world.state(0);
        println!("{factor}: {} {}", state.name(), reason.name());
        match factor == 1.0 {
            true => assert_eq!(state, MechanismState::Enabled, "{}", reason.name()),
            false => assert_eq!((state, reason), (MechanismState::Fault, Reason::LoopResidual)),
        }
    }
}

#[test]
fn a_bus_that_comes_back_gives_no_power_by_itself() {
    for (name, drive) in all_drives() {
        let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
        assert!(world.arm().is_some(), "{name}");
        swing(&mut world, 0.6);
        world.event(0, BusEvent::BusOff);
        world.lost_until_ns = world.now_ns + 300 * MS;
        world.cycle();
        assert_eq!(world.state(0), (MechanismState::Fault, Reason::BusOff), "{name}");
        world.cycles(75);
        world.event(0, BusEvent::Restarted);
        world.shafts[0].friction = 0.5;
        for _ in 0..500 {
            world.cycle();
            assert_eq!(world.state(0).0, MechanismState::Fault, "{name}");
        }
        assert!(!world.shafts[0].motor.plant.power, "{name}");
        world.operate(Operation::Reset);
        // one that tells no speed is elsewhere than where it was
        world.operate(Operation::Confirm);
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
    }
}

#[test]
fn a_clock_that_steps_takes_the_power_away_and_can_be_armed_again() {
    for (name, drive) in all_drives() {
        for step_ms in [-1_000, 10_000_i64] {
            let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
            assert!(world.arm().is_some(), "{name}");
            swing(&mut world, 0.6);
            world.shafts[0].friction = 0.5;
            world.now_ns = world.now_ns.saturating_add_signed(step_ms * MS as i64);
            world.is_any_verdict = true;
            world.cycle();
            assert_ne!(world.state(0).0, MechanismState::Enabled, "{name} {step_ms}");
            world.cycles(500);
            assert!(!world.shafts[0].motor.plant.power, "{name} {step_ms}");
            world.is_any_verdict = false;
            world.operate(Operation::Reset);
            world.operate(Operation::Confirm);
            let [position, _] = world.shafts[0].at_actuator();
            let armed = world.arm();
            assert!(armed.is_some(), "{name} {step_ms} {position}: {:?}", world.state(0));
        }
    }
}

#[test]
fn a_stream_of_commands_that_ends_half_way_ends_without_power() {
    for (name, drive) in all_drives() {
        // while it gets power, while its gains grow, and in motion
        for cycles in [1, 12, 30, 400] {
            let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
            world.shafts[0].friction = 0.2;
            world.cycles(375);
            world.operate(Operation::Arm);
            // set-points that ran ahead of a motor without power would be passed too quickly
            if cycles == 400 {
                while !world.is_enabled() {
                    world.cycle();
                }
            }
            swing(&mut world, f64::from(cycles) * 4e-3);
            let begin_ns = world.now_ns;
            let mut fastest = 0.0_f64;
            while world.now_ns < begin_ns + 2_500 * MS {
                world.is_mute = true;
                world.cycle();
                fastest = fastest.max(world.shafts[0].velocity.abs());
            }
            let (state, reason) = world.state(0);
            let reason = reason.name();
            assert_eq!(state, MechanismState::Disabled, "{name} {cycles} {reason} {fastest}");
            assert!(!world.shafts[0].motor.plant.power, "{name} {cycles}");
            assert!(fastest < 5.0, "{name} {cycles}: {fastest}");
        }
    }
}

#[test]
fn commands_once_a_second_keep_nothing_armed() {
    for (name, drive) in all_drives() {
        let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
        assert!(world.arm().is_some(), "{name}");
        world.give(Setpoint { position: 2.0, stiffness: 5.0, damping: 0.1, ..PUSH });
        let mut fastest = 0.0_f64;
        for k in 1..1250 {
            world.is_mute = k % 250 != 0;
            world.cycle();
            fastest = fastest.max(world.shafts[0].velocity.abs());
            assert!(k < 250 || !world.is_enabled(), "{name} {k}");
        }
        assert!(fastest < 5.25, "{name}: {fastest}");
        assert_eq!(world.state(0), (MechanismState::Disabled, Reason::CommandLost), "{name}");
    }
}

#[test]
fn commands_from_the_future_are_refused_and_lock_nobody_out() {
    for (name, drive) in all_drives() {
        let mut world = World::read_beside(World::text(&drive, ""), DBC_FILE);
        assert!(world.arm().is_some(), "{name}");
        for ahead_ns in [2 * MS, 1_000 * MS, u64::MAX / 2] {
            let mut command = world.command;
            (command.sequence, command.stamp_ns) = (u64::MAX, world.now_ns + ahead_ns);
            let verdict = world.bridge.command(world.now_ns, &command);
            assert_eq!(verdict, CommandVerdict::Ahead, "{name}");
            world.cycle();
        }
        assert!(world.is_enabled(), "{name}");
        // the largest number of a sequence ends it, and the next controller may begin
        let mut command = world.command;
        (command.sequence, command.stamp_ns) = (u64::MAX, world.now_ns);
        assert_eq!(world.bridge.command(world.now_ns, &command), CommandVerdict::Accepted);
        world.is_any_verdict = true;
        world.shafts[0].friction = 0.5;
        world.cycles(250);
        assert_eq!(world.state(0), (MechanismState::Disabled, Reason::CommandLost), "{name}");
        world.is_any_verdict = false;
        assert!(world.arm().is_some(), "{name}: {:?}", world.state(0));
    }
}

fn read(text: String, record: Option<&str>) -> Result<Configuration, String> {
    let surroundings = Surroundings {
        file: &|_| record.map(str::to_owned).ok_or_else(|| "absent".to_owned()),
        robot: &|source| match source {
            sarrus_models::Source::Bundled(name) => robots::loaded(name),
            _ => Err(LoadError::Open("robot".into(), "absent".into())),
        },
    };
    Configuration::read("bench.yml", text.into_bytes(), &surroundings)
        .map_err(|report| report.to_string())
}

#[test]
fn limits_and_gears_that_are_no_numbers_are_refused() {
    let good = World::text(&drives()[1].1, "");
    assert!(read(good.clone(), None).is_ok());
    for (from, to) in [
        ("effort: 2", "effort: 0"),
        ("effort: 2", "effort: -1"),
        ("effort: 2", "effort: 1e-320"),
        ("effort: 2", "effort: .nan"),
        ("effort: 2", "effort: NaN"),
        ("effort: 2", "effort: inf"),
        ("velocity: 5,", "velocity: 0,"),
        ("velocity: 5,", "velocity: 5e-324,"),
        ("velocity: 5,", "velocity: nan,"),
        ("[-3, 3]", "[.nan, 3]"),
        ("[-3, 3]", "[-3, nan]"),
        ("[-3, 3]", "[-inf, 3]"),
        ("[-3, 3]", "[0, 5e-324]"),
        ("[-3, 3]", "[1, 1.000000000000001]"),
        ("[-3, 3]", "[-1e300, 1e300]"),
        ("offset: 0", "offset: nan"),
        ("offset: 0", "offset: 0\n  gear: 1e-320"),
        ("offset: 0", "offset: 0\n  gear: nan"),
        ("offset: 0", "offset: 0\n  torque_constant: 4.9e-324"),
        ("rate_hz: 250", "rate_hz: nan"),
        ("rate_hz: 250", "rate_hz: 1e-300"),
        ("ramp_ms: 100", "ramp_ms: nan"),
        ("damping: 0.1", "damping: nan"),
        ("position_range: 12.5", "position_range: 1e-320"),
        ("torque_range: 10", "torque_range: nan"),
    ] {
        assert!(good.contains(from), "{from}");
        assert!(read(good.replace(from, to), None).is_err(), "{to}");
    }
}

#[test]
fn a_record_of_another_robot_or_other_zeros_or_half_of_one_arms_nothing() {
    let drives: Vec<_> = drives().into_iter().filter(|(name, _)| name.contains("damiao")).collect();
    let robot = |name: &str| {
        let drawn = (0..1000).map(|seed| robots::draw(&mut Chance(seed), &drives, 250));
        let text = drawn.into_iter().find(|drawn| drawn.name == name).unwrap().text;
        text.replace("commissioning: none\n", "")
    };
    let ankle = robot("ankle");
    let record = |text: &str| read(text.to_owned(), None).unwrap().record();
    let own = record(&ankle);
    let is_done = |text: &str, record: &str| {
        read(text.to_owned(), Some(record)).unwrap().commissioning == Commissioning::Done
    };
    assert!(is_done(&ankle, &own));
    assert!(is_done(&ankle, &format!("# a table\n{own}\n")));
    assert!(!is_done(&ankle, &record(&robot("torso"))));
    for end in (0..own.trim_end().len()).step_by(29) {
        assert!(!is_done(&ankle, &own[..end]), "{end}");
    }
    // a range of the codes scales as a gear does
    let drive = own.find("velocity_range: ").unwrap() + 16;
    assert!(!is_done(&ankle, &format!("{}1{}", &own[..drive], &own[drive..])));
    let offset = own.find("offset: ").unwrap() + 8;
    let other = format!("{}1{}", &own[..offset], &own[offset..]);
    assert!(!is_done(&ankle, &other));
    assert!(!is_done(&ankle, &format!("{own}{own}")));
    let mut lines: Vec<&str> = own.lines().collect();
    lines.swap(2, 3);
    assert!(!is_done(&ankle, &lines.join("\n")));
}
