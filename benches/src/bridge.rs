//! A cycle of the bridge between commands and motors, for counting its instructions: takes the
//! input since the last cycle, then runs the cycle.
//!
//! The motors are simulated, each with a shaft of its own, and follow slow sines. Commands and
//! motors are not counted, nor the cycles until all motors have power and their gains have grown.

use std::f64::consts::TAU;
use std::path::Path;

use sarrus_can_core::bridge::Bridge;
use sarrus_can_core::config::{Configuration, Limits, Surroundings};
use sarrus_can_core::frame::{Frame, FrameQueue};
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Simulated};
use sarrus_models::LoadError;
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Operation};
use sarrus_report::Outcome;

/// Cycles before the motors are armed, and before cycles are counted.
const ARMED: u64 = 50;
const COUNTED: u64 = 500;
/// Cycles of one pass.
const PASS: u64 = 16;
/// Time between two cycles `[ns]`.
const PERIOD_NS: u64 = 2_000_000;
/// Part of its range that an actuator moves to either side, and the time that it takes `[s]`.
const SWING: f64 = 0.02;
const SWING_S: f64 = 2.0;

/// Runs `bridge/ROBOT` this many passes of 16 cycles; `None` for a name that is none of these.
///
/// # Errors
///
/// A configuration that cannot be read, or a motor that does not follow.
pub(crate) fn run(name: &str, repeats: usize) -> Option<Outcome> {
    let configuration = match name {
        "bridge/20_motors" => twenty_motors(),
        "bridge/rh5v2_upper_body" => upper_body(false),
        "bridge/rh5v2_upper_body/model" => upper_body(true),
        _ => return None,
    };
    Some(configuration.and_then(|configuration| count(configuration, repeats)))
}

/// Twenty motors in MIT mode on four buses, without a model.
fn twenty_motors() -> Outcome<Configuration> {
    let mut text = String::from("rate_hz: 500\nramp_ms: 100\nbuses:\n");
    for bus in 0..4 {
        text +=
            &format!("- {{name: b{bus}, interface: none, channel: c{bus}, bitrate: 1000000}}\n");
    }
    text += "motors:\n";
    for i in 0..20 {
        let bus = i / 5;
        let id = 1 + i % 5;
        text += &format!(
            "- actuator: m{i}\n  bus: b{bus}\n  drive: {{protocol: mit, variant: t_motor, id: \
            {id}, reply_id: {}, position_range: 12.5, velocity_range: 30, torque_range: 10, \
            stiffness_range: 500, damping_range: 5}}\n  offset: 0\n  limits: {{position: [-3, 3], \
            velocity: 5, effort: 2}}\n  damping: 0.1\n  watchdog_ms: 50\n  watchdog: believed\n",
            id + 16
        );
    }
    let surroundings = Surroundings {
        file: &|_| Err("absent".into()),
        robot: &|_| Err(LoadError::Open("robot".into(), "absent".into())),
    };
    let read = Configuration::read("motors.yml", text.into_bytes(), &surroundings);
    Ok(read.map_err(|report| report.to_string())?)
}

/// The thirteen motors of the upper body on three buses.
fn upper_body(with_model: bool) -> Outcome<Configuration> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut configuration =
        Configuration::load(&folder.join("../client/can/examples/rh5v2_upper_body.yml"))?;
    if !with_model {
        configuration.model = None;
    }
    Ok(configuration)
}

/// A motor and the actuator that it moves.
struct Shaft {
    motor: Simulated,
    bus: usize,
    actuator: usize,
    mapping: Mapping,
    limits: Limits,
}

fn count(configuration: Configuration, repeats: usize) -> Outcome {
    let mut shafts = Vec::new();
    let mut command = ActuatorCommand::default();
    for motor in &configuration.motors {
        // its greatest effort brings it to its greatest speed in a fifth of a second
        let (Mapping { sign, gear, offset, .. }, limits) = (motor.mapping, motor.limits);
        let torque_limit = limits.effort / gear;
        let velocity = limits.velocity * gear;
        let part = torque_limit / velocity;
        let physics = Physics { inertia: 0.2 * part, friction: 0.02 * part, torque_limit };
        let protocol = motor.protocol.name;
        let mut simulated =
            Simulated::new(protocol, &motor.settings, motor.common, physics).ok_or(protocol)?;
        simulated.plant.position = -sign * gear * offset;
        let stiffness = 20.0 * limits.effort / (limits.upper - limits.lower);
        let gains =
            [&mut command.stiffness, &mut command.damping].map(|of| of.get_mut(motor.actuator));
        if let [Some(of_stiffness), Some(damping)] = gains {
            *of_stiffness = stiffness;
            *damping = (stiffness * physics.inertia).sqrt() * gear;
        }
        shafts.push(Shaft {
            motor: simulated,
            bus: motor.bus,
            actuator: motor.actuator,
            mapping: motor.mapping,
            limits,
        });
    }
    (command.fingerprint, command.n_u) =
        (configuration.fingerprint, configuration.actuators.len() as u64);
    let mut bridge = Bridge::new(configuration);

    // motors answer the frames of the previous cycle
    let mut answers = Vec::new();
    let mut out = FrameQueue::new(16);
    for cycle in 0..COUNTED + PASS * repeats as u64 {
        let now_ns = 1_000_000_000 + PERIOD_NS * cycle;
        (command.sequence, command.stamp_ns) = (cycle + 1, now_ns);
        let since = cycle.saturating_sub(ARMED) as f64 * PERIOD_NS as f64 * 1e-9;
        for shaft in &shafts {
            let swing = SWING * (shaft.limits.upper - shaft.limits.lower);
            if let Some(position) = command.position.get_mut(shaft.actuator) {
                *position = swing * (TAU * since / SWING_S).sin();
            }
        }
        bridge.command(now_ns, &command);
        if cycle == ARMED {
            bridge.operate(now_ns, Operation::Arm);
        }
        if cycle < COUNTED {
            take_and_cycle(&mut bridge, now_ns, &answers);
        } else {
            passes(&mut bridge, now_ns, &answers);
        }
        answers.clear();
        for Shaft { motor, bus, .. } in &mut shafts {
            out.clear();
            motor.step(now_ns + PERIOD_NS / 20, &mut out);
            for frame in bridge.frames(*bus) {
                motor.receive(now_ns + PERIOD_NS / 20, frame, &mut out);
            }
            answers.extend(out.frames().iter().map(|frame| (*bus, *frame)));
        }
    }
    for Shaft { actuator, mapping, motor, .. } in &shafts {
        let state = bridge.state().states.get(*actuator).copied();
        if state != Some(MechanismState::Enabled as u32) {
            let position = mapping.sign * motor.plant.measured() / mapping.gear;
            return Err(format!("actuator {actuator} does not follow, at {position}").into());
        }
    }
    Ok(())
}

/// The only function whose instructions are counted.
#[inline(never)]
fn passes(bridge: &mut Bridge, now_ns: u64, answers: &[(usize, Frame)]) {
    take_and_cycle(bridge, now_ns, answers);
}

fn take_and_cycle(bridge: &mut Bridge, now_ns: u64, answers: &[(usize, Frame)]) {
    for (bus, frame) in answers {
        bridge.receive(now_ns - PERIOD_NS / 2, *bus, frame);
    }
    bridge.cycle(now_ns);
}
