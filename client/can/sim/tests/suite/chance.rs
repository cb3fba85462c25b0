//! Commands, shafts and faults by chance: a motor with power is beyond its limits no longer than
//! detection and stop take, and nothing is enabled with a motor that is limp.
//!
//! Some hundred runs; `SARRUS_CHANCE_RUNS=10000` makes more of them, `SARRUS_CHANCE_SEED` begins
//! elsewhere. A run that fails prints its seed.

use sarrus_can_core::drive::Setpoint;
use sarrus_proto::actuators::{MechanismState, Operation};

use crate::attack_table::drives;
use crate::world::{Chance, Encoder, MS, World};

/// The time to find something, and that of a stop `[ns]`.
const FOUND_NS: u64 = 40 * MS;
const STOP_NS: u64 = 500 * MS;
/// An effort that a limp motor is found by `[N m]`.
const WORTH: f64 = 0.5;

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

#[test]
fn whatever_happens_limits_hold_and_nothing_limp_is_enabled() {
    let first = number("SARRUS_CHANCE_SEED", 1);
    let n_runs = number("SARRUS_CHANCE_RUNS", 200);
    let drives = drives();
    let mut n_ended = 0;
    let mut n_failed = Vec::new();
    println!("{n_runs} runs from seed {first}");
    for seed in first..first + n_runs {
        match run(seed, &drives) {
            Ok(ended) => n_ended += u64::from(ended),
            Err(what) => {
                println!("seed {seed}: {what}");
                n_failed.push(seed);
            }
        }
    }
    println!("{n_ended} of them ended by a fault");
    assert!(n_failed.is_empty(), "seeds {n_failed:?}");
}

/// Whether it ended without power.
fn run(seed: u64, drives: &[(&'static str, String)]) -> Result<bool, String> {
    let mut chance = Chance(seed);
    let (name, drive) = &drives[(chance.bits() % drives.len() as u64) as usize];
    let mut world = World::one(drive, "");
    world.chance = Chance(seed ^ 0x00C0_FFEE);
    let is_noisy = chance.within(0.0, 1.0) < 0.5;
    if is_noisy {
        (world.loss, world.noise, world.jitter_ns) = (0.01, 2.0, [MS / 2, MS]);
    }
    world.shafts[0].inertia = 0.004 * (chance.within(0.0, 3.0)).exp();
    world.shafts[0].friction = chance.within(0.0, 0.05);
    // where the request to begin is lost, a CANopen drive is set up anew
    let is_armed = (0..3).any(|_| {
        world.bridge.operate(world.now_ns, Operation::Reset);
        world.arm().is_some()
    });
    if !is_armed {
        return Err(format!("{name} is not armed: {:?}", world.state(0)));
    }
    let is_wild = chance.within(0.0, 1.0) < 0.3;
    let fault = chance.bits() % 8;
    let fault_cycle = 50 + chance.bits() % 250;
    let mut beyond_ns = [0; 3];
    let mut limp_ns = 0;
    let mut next = 0;
    for cycle in 0..500 {
        if cycle >= next {
            next = cycle + 10 + chance.bits() % 80;
            let [position, velocity, torque] =
                if is_wild { [3.5, 2.0, 1.5] } else { [0.4, 0.2, 0.3] };
            world.give(Setpoint {
                position: chance.within(-position, position),
                velocity: chance.within(-velocity, velocity),
                torque: chance.within(-torque, torque),
                stiffness: chance.within(0.0, 4.0),
                damping: chance.within(0.1, 0.4),
            });
        }
        if cycle == fault_cycle {
            let shaft = &mut world.shafts[0];
            match fault {
                0 => shaft.encoder = Encoder::Off(chance.within(0.2, 2.0)),
                1 => shaft.encoder = Encoder::Reversed,
                2 => shaft.stuck = Some(0.0),
                3 => shaft.stuck = Some(chance.within(3.0, 9.0)),
                4 => shaft.load = chance.within(-1.0, 1.0),
                5 => shaft.is_doubled = true,
                6 => shaft.temperature = 150.0,
                _ => {}
            }
        }
        world.cycle();
        let shaft = &world.shafts[0];
        let is_enabled = world.state(0).0 == MechanismState::Enabled;
        let has_power = shaft.motor.plant.power;
        // its effort while it follows its set-point
        let effort = if shaft.stuck.is_some() { 0.0 } else { shaft.torque };
        let beyond = [
            (shaft.position.abs(), 3.0, FOUND_NS + STOP_NS),
            (shaft.velocity.abs(), 5.0, FOUND_NS + STOP_NS),
            (effort.abs(), 2.0, FOUND_NS + STOP_NS),
        ];
        for ((value, limit, most_ns), passed_ns) in beyond.into_iter().zip(&mut beyond_ns) {
            let is_beyond = has_power && value > 1.05 * limit;
            *passed_ns = if is_beyond { *passed_ns + world.period_ns } else { 0 };
            if *passed_ns > most_ns {
                let (state, reason) = world.state(0);
                return Err(format!(
                    "{name}: {value} with limit {limit} for {} ms, fault {fault}, {} {}",
                    *passed_ns / MS,
                    state.name(),
                    reason.name()
                ));
            }
        }
        let asked = shaft.motor.plant.drive_torque();
        let is_limp = is_enabled
            && !name.contains("position")
            && shaft.stuck == Some(0.0)
            && asked.abs() > WORTH;
        limp_ns = if is_limp { limp_ns + world.period_ns } else { 0 };
        if limp_ns > FOUND_NS {
            return Err(format!("{name}: limp for {} ms and asked for {asked}", limp_ns / MS));
        }
    }
    Ok(!world.is_enabled())
}
