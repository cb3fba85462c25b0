//! Motors that run away, drop or lie, on each protocol and mode, with the times until the bridge no
//! longer follows commands and until the motor has no torque: the attacks, for every frontend.

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::drive::Setpoint;
use sarrus_proto::actuators::{MechanismState, Reason};

use super::world::{Encoder, MS, Record, World};

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
pub(crate) fn swing(world: &mut World, seconds: f64) {
    let begin_ns = world.now_ns;
    while world.now_ns < begin_ns + (seconds * 1e9) as u64 {
        let t = (world.now_ns - begin_ns) as f64 * 1e-9;
        let phase = 2.0 * t;
        let (sin, cos) = phase.sin_cos();
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

/// Outcome of an attack.
pub(crate) struct Outcome {
    /// Time until commands were not followed any more; `None` where they always were `[ms]`.
    pub(crate) ms: Option<f64>,
    /// Time until the motor had no torque `[ms]`.
    pub(crate) safe_ms: Option<f64>,
    pub(crate) reason: Reason,
    /// The farthest and the fastest that the shaft was before that, and its largest torque then.
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    pub(crate) torque: f64,
}

/// A stop takes no longer `[ns]`.
const STOP_NS: u64 = 1_000 * MS;

/// Runs the world from the begin of an attack until the bridge no longer follows commands, and then
/// until the motor has no torque. `each` comes before each cycle.
fn watch_with(
    world: &mut World,
    seconds: f64,
    has_begun: impl Fn(&World) -> bool,
    each: impl Fn(&mut World),
) -> Outcome {
    let mut end_ns = world.now_ns + (seconds * 1e9) as u64;
    let mut begun_ns = None;
    let mut found = None;
    let [mut position, mut velocity, mut torque] = [0_f64; 3];
    let mut safe_ns = None;
    while world.now_ns < end_ns {
        if begun_ns.is_none() && has_begun(world) {
            begun_ns = Some(world.now_ns);
        }
        each(world);
        world.cycle();
        let shaft = &world.shafts[0];
        position = position.max(shaft.position.abs());
        velocity = velocity.max(shaft.velocity.abs());
        torque = torque.max(shaft.torque.abs());
        // frames of this cycle went out at its beginning
        let at_ns = world.now_ns - world.period_ns;
        let (state, reason) = world.state(0);
        if state != MechanismState::Enabled && found.is_none() {
            found = Some((at_ns, reason));
            end_ns = world.now_ns + STOP_NS;
        }
        if matches!(state, MechanismState::Disabled | MechanismState::Fault) {
            safe_ns = Some(at_ns);
            break;
        }
    }
    let since = |at_ns: u64| at_ns.saturating_sub(begun_ns.unwrap_or(at_ns)) as f64 / MS as f64;
    Outcome {
        ms: found.map(|(at_ns, _)| since(at_ns)),
        safe_ms: safe_ns.map(since),
        reason: found.map_or(Reason::None, |(_, reason)| reason),
        position,
        velocity,
        torque,
    }
}

pub(crate) fn watch(
    world: &mut World,
    seconds: f64,
    has_begun: impl Fn(&World) -> bool,
) -> Outcome {
    watch_with(world, seconds, has_begun, |_| ())
}

/// The motor has this torque with any set-point.
fn stuck(world: &mut World, torque: f64) -> Outcome {
    watch_with(world, 1.0, always, |world| {
        let follows = world.state(0).0 == MechanismState::Enabled;
        world.shafts[0].stuck = follows.then_some(torque);
    })
}

/// Ready to be attacked: armed, and past the ramp.
pub(crate) fn armed(drive: &str) -> World {
    prepared(World::one(drive, ""), drive)
}

/// As [`armed`], with a record of everything.
pub(crate) fn recorded(drive: &str) -> World {
    prepared(World { record: Some(Record::default()), ..World::one(drive, "") }, drive)
}

pub(crate) fn prepared(mut world: World, drive: &str) -> World {
    assert!(world.arm().is_some(), "{drive}: {:?}", world.state(0));
    world.give(Setpoint { stiffness: 5.0, damping: 0.1, ..Setpoint::default() });
    world.cycles(50);
    assert_eq!(world.state(0).0, MechanismState::Enabled, "{drive}: {:?}", world.state(0));
    world
}

/// An effort of 75 % of the limit; position and velocity for modes without efforts.
const PUSH: Setpoint =
    Setpoint { position: 50.0, velocity: 0.0, torque: 1.5, stiffness: 0.0, damping: 0.0 };

pub(crate) type Attack = fn(&mut World) -> Outcome;

pub(crate) fn always(_: &World) -> bool {
    true
}

fn is_beyond(world: &World) -> bool {
    let shaft = &world.shafts[0];
    shaft.velocity.abs() > 1.05 * 5.0 || shaft.position.abs() > 3.03
}

pub(crate) const ATTACKS: &[(&str, Attack)] = &[
    ("runaway under an effort within its limit", |world| {
        world.give(PUSH);
        watch(world, 2.0, is_beyond)
    }),
    ("runaway, and the motor says that it stands", |world| {
        world.shafts[0].hides_velocity = true;
        world.give(PUSH);
        watch(world, 2.0, is_beyond)
    }),
    ("a limit approached at 4.5 rad/s", |world| {
        (world.shafts[0].inertia, world.shafts[0].friction) = (0.15, 0.0);
        watch_with(
            world,
            6.0,
            |world| world.shafts[0].position > 3.06,
            |world| {
                let torque = (4.5 - world.shafts[0].velocity).clamp(-1.4, 1.4);
                world.give(Setpoint { torque, ..Setpoint::default() });
            },
        )
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
        world.event(0, BusEvent::ErrorPassive);
        watch(world, 1.0, always)
    }),
];

/// Whether a protocol can show an attack. CiA 402 reports no temperature; without gains in the
/// motor and at their own rate the expected effort is unknown; a motor that is not asked answers at
/// any rate.
pub(crate) fn is_possible(attack: &str, drive: &str) -> bool {
    let is_position = drive.contains("position");
    match attack {
        "150 °C" => !drive.contains("cia402"),
        "two motors on one id" => !drive.contains("odrive"),
        "limp under load" | "frozen at rest, then 1.5 N m" => !is_position,
        "runaway, and the motor says that it stands"
        | "runaway under an effort within its limit" => !is_position,
        "sensor against the motor" | "a limit approached at 4.5 rad/s" => !is_position,
        _ => true,
    }
}

/// The longest time that an attack may take `[ms]`: 20, or five cycles of 4, but where it is a time
/// by nature.
pub(crate) fn bound(attack: &str) -> f64 {
    match attack {
        "150 °C" => 1000.0,
        // 12 ms after the change of the effort that it is judged by
        "frozen at rest, then 1.5 N m" => 28.0,
        "2.5 rad behind" => 2000.0,
        _ => 20.0,
    }
}
