//! What runs away, drops or lies, on each protocol and mode: how long it takes until the bridge no
//! longer follows commands. The table is printed.

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::{Frame, Id};
use sarrus_proto::actuators::{MechanismState, Reason};

use crate::world::{Encoder, MS, World};

const MIT: &str = "id: 4, reply_id: 20, position_range: 12.5, velocity_range: 30, torque_range: 10, \
    stiffness_range: 500, damping_range: 5";
const MOTEUS: &str = "{protocol: moteus, id: 1, kp: 300, kd: 10";
const CIA402: &str = "{protocol: cia402, node: 5, rated_torque: 2.0, counts_per_turn: 65536";
const ODRIVE: &str = "{protocol: odrive, node: 3, torque_feedback: true";

/// Drives by their names in the table.
pub(crate) fn drives() -> Vec<(&'static str, String)> {
    vec![
        ("robstride impedance", format!("{{protocol: mit, variant: robstride, {MIT}}}")),
        ("damiao impedance", format!("{{protocol: mit, variant: damiao, {MIT}}}")),
        ("t_motor torque", format!("{{protocol: mit, variant: t_motor, mode: torque, {MIT}}}")),
        ("cybergear impedance", "{protocol: cybergear, id: 10, position_range: 12.5}".to_owned()),
        ("moteus impedance", format!("{MOTEUS}, mode: impedance}}")),
        ("moteus torque", format!("{MOTEUS}}}")),
        ("odrive torque", format!("{ODRIVE}}}")),
        (
            "odrive with endpoints",
            format!("{ODRIVE}, watchdog_timeout_endpoint: 300, enable_watchdog_endpoint: 301}}"),
        ),
        ("odrive position", format!("{ODRIVE}, motor_torque_constant: 0.1, mode: position}}")),
        ("cia402 torque", format!("{CIA402}}}")),
        ("cia402 position", format!("{CIA402}, mode: position}}")),
    ]
}

/// A slow swing of ± 1 rad, stiff enough to follow.
fn swing(world: &mut World, seconds: f64) {
    let begin_ns = world.now_ns;
    while world.now_ns < begin_ns + (seconds * 1e9) as u64 {
        let t = (world.now_ns - begin_ns) as f64 * 1e-9;
        let (sin, cos) = (2.0 * t).sin_cos();
        let setpoint = Setpoint {
            position: sin,
            velocity: 2.0 * cos,
            torque: 0.0,
            stiffness: 5.0,
            damping: 0.1,
        };
        world.give(setpoint);
        world.cycle();
    }
}

struct Outcome {
    ms: Option<f64>,
    reason: Reason,
    position: f64,
    velocity: f64,
}

/// Cycles until it does not follow any more, from a beginning that is seen in the world, and what
/// it did meanwhile.
fn watch(world: &mut World, seconds: f64, has_begun: impl Fn(&World) -> bool) -> Outcome {
    let end_ns = world.now_ns + (seconds * 1e9) as u64;
    let mut begun_ns = None;
    let (mut position, mut velocity) = (0_f64, 0_f64);
    while world.now_ns < end_ns {
        if begun_ns.is_none() && has_begun(world) {
            begun_ns = Some(world.now_ns);
        }
        world.cycle();
        let shaft = &world.shafts[0];
        position = position.max(shaft.position.abs());
        velocity = velocity.max(shaft.velocity.abs());
        if world.state(0).0 != MechanismState::Enabled {
            break;
        }
    }
    // frames of this cycle went out at its beginning
    let left_ns = world.now_ns - world.period_ns;
    let (state, reason) = world.state(0);
    let ms = (state != MechanismState::Enabled)
        .then(|| left_ns.saturating_sub(begun_ns.unwrap_or(left_ns)) as f64 / MS as f64);
    Outcome { ms, reason, position, velocity }
}

/// Ready to be attacked: armed, and past the ramp.
fn armed(drive: &str) -> World {
    let mut world = World::one(drive, "");
    assert!(world.arm().is_some(), "{drive}: {:?}", world.state(0));
    world.give(Setpoint { stiffness: 5.0, damping: 0.1, ..Setpoint::default() });
    world.cycles(50);
    assert_eq!(world.state(0).0, MechanismState::Enabled, "{drive}: {:?}", world.state(0));
    world
}

/// An effort of 75 % of the limit, with what a mode without efforts is given instead.
const PUSH: Setpoint =
    Setpoint { position: 50.0, velocity: 0.0, torque: 1.5, stiffness: 0.0, damping: 0.0 };

type Attack = fn(&mut World) -> Outcome;

fn always(_: &World) -> bool {
    true
}

fn is_beyond(world: &World) -> bool {
    let shaft = &world.shafts[0];
    shaft.velocity.abs() > 1.05 * 5.0 || shaft.position.abs() > 3.03
}

const ATTACKS: &[(&str, Attack)] = &[
    ("runaway under an effort within its limit", |world| {
        world.give(PUSH);
        watch(world, 2.0, is_beyond)
    }),
    ("runaway, and the motor says that it stands", |world| {
        world.shafts[0].hides_velocity = true;
        world.give(PUSH);
        watch(world, 2.0, is_beyond)
    }),
    ("sensor against the motor", |world| {
        world.shafts[0].encoder = Encoder::Reversed;
        world.give(Setpoint { position: 1.0, stiffness: 5.0, ..PUSH });
        watch(world, 2.0, is_beyond)
    }),
    ("position frozen in motion", |world| {
        swing(world, 3.3);
        let position = world.shafts[0].position;
        world.shafts[0].encoder = Encoder::Frozen { position, velocity_too: false };
        watch(world, 1.0, always)
    }),
    ("position and velocity frozen in motion", |world| {
        swing(world, 3.3);
        let position = world.shafts[0].position;
        world.shafts[0].encoder = Encoder::Frozen { position, velocity_too: true };
        watch(world, 1.0, always)
    }),
    ("frozen at rest, then 1.5 N m", |world| {
        let position = world.shafts[0].position;
        world.shafts[0].encoder = Encoder::Frozen { position, velocity_too: true };
        world.give(PUSH);
        watch(world, 1.0, |world| world.shafts[0].torque.abs() > 0.5)
    }),
    ("encoder jumps by 0.2 rad", |world| {
        world.shafts[0].encoder = Encoder::Off(0.2);
        watch(world, 1.0, always)
    }),
    ("encoder jumps by 12 rad", |world| {
        world.shafts[0].encoder = Encoder::Off(12.0);
        watch(world, 1.0, always)
    }),
    ("two motors on one id", |world| {
        world.shafts[0].is_doubled = true;
        watch(world, 1.0, always)
    }),
    ("limp under load", |world| {
        world.shafts[0].load = -1.0;
        world.cycles(100);
        stuck(world, 0.0)
    }),
    ("pushes with 10 N m", |world| {
        world.shafts[0].is_blocked = true;
        world.give(Setpoint { torque: 0.5, ..Setpoint::default() });
        world.cycles(50);
        stuck(world, 10.0)
    }),
    ("150 °C", |world| {
        world.shafts[0].temperature = 150.0;
        watch(world, 2.0, always)
    }),
    ("2.5 rad behind", |world| {
        world.shafts[0].is_blocked = true;
        world.give(Setpoint { position: 2.5, stiffness: 2.0, damping: 0.1, ..Setpoint::default() });
        watch(world, 5.0, always)
    }),
    ("error-passive", |world| {
        world.bridge.bus_event(world.now_ns, 0, BusEvent::ErrorPassive);
        watch(world, 1.0, always)
    }),
];

/// The motor has this torque whatever it is told.
fn stuck(world: &mut World, torque: f64) -> Outcome {
    let begin_ns = world.now_ns;
    while world.now_ns < begin_ns + 1_000 * MS && world.state(0).0 == MechanismState::Enabled {
        world.shafts[0].stuck = Some(torque);
        world.cycle();
    }
    let (state, reason) = world.state(0);
    let ms = (world.now_ns - world.period_ns - begin_ns) as f64 / MS as f64;
    Outcome {
        ms: (state != MechanismState::Enabled).then_some(ms),
        reason,
        position: world.shafts[0].position,
        velocity: 0.0,
    }
}

/// What a protocol cannot show: ODrive says its temperature, CiA 402 none; without gains in the
/// motor and at their own rate nothing of an effort is known; a motor that is not asked answers as
/// often as it likes.
fn is_possible(attack: &str, drive: &str) -> bool {
    let is_position = drive.contains("position");
    match attack {
        "150 °C" => !drive.contains("cia402"),
        "two motors on one id" => !drive.contains("odrive"),
        "limp under load" | "frozen at rest, then 1.5 N m" => !is_position,
        "runaway, and the motor says that it stands"
        | "runaway under an effort within its limit" => !is_position,
        "sensor against the motor" => !is_position,
        _ => true,
    }
}

/// The longest time that an attack may take `[ms]`: 20, or five cycles of 4, but where it is a time
/// by nature.
fn bound(attack: &str) -> f64 {
    match attack {
        "150 °C" => 1000.0,
        // 12 ms after the change of the effort that it is judged by
        "frozen at rest, then 1.5 N m" => 28.0,
        "2.5 rad behind" => 2000.0,
        _ => 20.0,
    }
}

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
            let Outcome { ms, reason, position, velocity } = run(&mut world);
            let torque = world.shafts[0].torque;
            let time = ms.map_or("never".to_owned(), |ms| format!("{ms:.0} ms"));
            println!(
                "  {name:20} {time:>8}  {:18} {position:6.3} rad {velocity:6.2} rad/s {torque:6.2} N m",
                reason.name()
            );
            if ms.is_none_or(|ms| ms > bound(attack)) {
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
        // what measures without being asked cannot be paired without a question that is answered,
        // but does not move as it is asked to
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
