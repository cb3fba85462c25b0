//! No false alarm: the upper body's thirteen motors swing, each with a shaft of its own, while
//! frames are lost, times jitter and numbers are noisy.
//!
//! Two minutes of simulated time; `SARRUS_SWING_SECONDS=3600` makes it an hour.

use std::path::Path;

use sarrus_can_core::config::Configuration;
use sarrus_proto::actuators::MechanismState;

use crate::world::{MS, World};

/// The bundled example.
pub(crate) fn upper_body() -> Configuration {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    Configuration::load(&folder.join("../examples/rh5v2_upper_body.yml"))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Its motors with shafts of their own, all actuators at zero, and gains for them.
pub(crate) fn world(configuration: Configuration) -> World {
    let mut world = World::new(configuration, 15);
    for shaft in &mut world.shafts {
        let gear = shaft.mapping.gear;
        let limits = shaft.limits;
        let effort = limits.effort / gear;
        let velocity = limits.velocity * gear;
        // its greatest effort brings it to its greatest speed in a fifth of a second
        shaft.inertia = 0.2 * effort / velocity;
        shaft.friction = 0.02 * effort / velocity;
        shaft.position = -shaft.mapping.sign * gear * shaft.mapping.offset;
        let half = 0.5 * (limits.upper - limits.lower);
        let stiffness = limits.effort / (0.1 * half);
        let inertia = shaft.inertia * gear * gear;
        world.command.stiffness[shaft.actuator] = stiffness;
        world.command.damping[shaft.actuator] = (stiffness * inertia).sqrt();
    }
    world
}

#[test]
fn the_upper_body_swings_without_a_false_alarm() {
    let seconds: f64 = std::env::var("SARRUS_SWING_SECONDS")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(120.0);
    // without its model, which knows that the actuators of a mechanism cannot each go their own way
    let mut configuration = upper_body();
    configuration.model = None;
    let mut world = world(configuration);
    (world.loss, world.noise, world.jitter_ns) = (0.01, 2.0, [MS / 5, MS]);

    // a period of each actuator's own, with 60 % of its range or of its speed
    let n_u = world.shafts.len();
    let swings: Vec<(f64, f64)> = world
        .shafts
        .iter()
        .map(|shaft| {
            let half = 0.5 * (shaft.limits.upper - shaft.limits.lower);
            let period = 4.0 + 0.37 * shaft.actuator as f64;
            let amplitude = (0.6 * half).min(0.6 * shaft.limits.velocity * period / 12.6);
            (amplitude, period)
        })
        .collect();
    let mut begin_ns = None;
    let end_ns = world.now_ns + (seconds * 1e9) as u64;
    assert!(world.arm().is_some(), "{:?}", world.state(0));
    while world.now_ns < end_ns {
        let t = (world.now_ns - *begin_ns.get_or_insert(world.now_ns)) as f64 * 1e-9;
        for i in 0..n_u {
            let shaft = &mut world.shafts[i];
            shaft.load = 0.15 * (t / 2.0).min(1.0) * shaft.limits.effort / shaft.mapping.gear;
            let (amplitude, period) = swings[i];
            let actuator = world.shafts[i].actuator;
            // cycloids there and back, from rest to rest
            let part = (t / period).fract();
            let (way, speed) = cycloid(2.0 * part.min(1.0 - part));
            let sign = if part < 0.5 { 1.0 } else { -1.0 };
            world.command.position[actuator] = amplitude * (2.0 * way - 1.0) * (t / 2.0).min(1.0);
            world.command.velocity[actuator] = sign * amplitude * 4.0 * speed / period;
        }
        world.cycle();
        if !world.is_enabled() {
            for i in 0..n_u {
                let (state, reason) = world.state(i);
                let name = &world.bridge.configuration().actuators[i];
                println!("{name}: {} {}", state.name(), reason.name());
            }
            panic!("after {t} s; seed 15");
        }
    }
    assert_eq!(world.state(0).0, MechanismState::Enabled);
    println!("{seconds} s, {} cycles, no alarm", world.bridge.counters().cycles);
}

/// Way and speed of a cycloid from 0 to 1.
fn cycloid(x: f64) -> (f64, f64) {
    let turn = core::f64::consts::TAU * x;
    (x - turn.sin() / core::f64::consts::TAU, 1.0 - turn.cos())
}
