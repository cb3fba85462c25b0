//! The attacks of the soak, each on a run at a moment of its own.

use super::*;

/// The outcome of an attack: the time until it was found `[ms]`, or its damage; `None` where it
/// cannot be made.
pub(super) type Outcome = Option<Result<f64, String>>;
pub(super) type Attack = fn(&mut Run) -> Outcome;

/// Changes the world, and waits until that is found.
fn found(run: &mut Run, change: impl FnOnce(&mut World, &mut Chance)) -> Outcome {
    // in a cycle that asks the motor, whose frames a second master repeats
    while run.world.bridge.frames(0).iter().all(|frame| frame.data().len() < 3) {
        run.cycle();
    }
    let attacked_ns = run.world.now_ns;
    change(&mut run.world, &mut run.chance);
    Some(match run.until(FOUND_S) {
        Some(_) => Ok((run.world.now_ns - run.world.period_ns - attacked_ns) as f64 / MS as f64),
        None => Err("not found".to_owned()),
    })
}

/// As [`found`], of one of the shafts.
fn found_of(run: &mut Run, change: fn(&mut Shaft, &mut Chance)) -> Outcome {
    found(run, |world, chance| {
        let i = (chance.bits() % world.shafts.len() as u64) as usize;
        change(&mut world.shafts[i], chance);
    })
}

pub(super) const ATTACKS: &[(&str, Attack)] = &[
    ("encoder jumps", |run| {
        found_of(run, |shaft, chance| {
            let by = chance.within(0.2, 3.0) * if chance.bits() % 2 == 0 { 1.0 } else { -1.0 };
            shaft.encoder = Encoder::Off(by);
        })
    }),
    ("encoder reversed", |run| found_of(run, |shaft, _| shaft.encoder = Encoder::Reversed)),
    ("position frozen", |run| found_of(run, |shaft, _| freeze(shaft, false))),
    ("position and velocity frozen", |run| found_of(run, |shaft, _| freeze(shaft, true))),
    ("limp", |run| found_of(run, |shaft, _| shaft.stuck = Some(0.0))),
    ("pushes", |run| found_of(run, |shaft, chance| shaft.stuck = Some(chance.within(3.0, 9.0)))),
    ("two motors on one id", |run| found_of(run, |shaft, _| shaft.is_doubled = true)),
    ("second master", |run| {
        found(run, |world, _| {
            let frame = world.bridge.frames(0).iter().find(|frame| frame.data().len() > 2);
            world.intruder = frame.and_then(|frame| {
                let mut data = frame.data().to_vec();
                data[1] ^= 0x55;
                let rate =
                    frame.kind == sarrus_can_core::frame::FrameKind::Fd { bit_rate_switch: true };
                match frame.is_fd() {
                    true => Frame::fd(frame.id, rate, &data),
                    false => Frame::classic(frame.id, &data),
                }
            });
        })
    }),
    ("silence", |run| found_of(run, |shaft, _| shaft.motor.silence(true))),
    ("150 °C", |run| found_of(run, |shaft, _| shaft.temperature = 150.0)),
    ("blocked", |run| {
        let begin_ns = run.world.now_ns;
        run.behind = [0.0; 3];
        let mut outcome = found_of(run, |shaft, _| shaft.is_blocked = true);
        // it shows in a motion that leaves it behind
        while matches!(outcome, Some(Err(_))) && run.behind[2] < 1.2 * FOLLOWING_S {
            if run.world.now_ns > begin_ns + 100_000 * MS {
                return None;
            }
            let found = run.until(1.0);
            let ms = (run.world.now_ns - begin_ns) as f64 / MS as f64;
            outcome = found.map_or(outcome, |_| Some(Ok(ms)));
        }
        outcome
    }),
    ("error-passive", |run| {
        found(run, |world, chance| {
            let i = (chance.bits() % world.shafts.len() as u64) as usize;
            world.event(world.shafts[i].bus, BusEvent::ErrorPassive);
        })
    }),
    ("frozen while a load is held", |run| {
        if let Err(outcome) = comes_to_rest(run) {
            return outcome;
        }
        let i = (run.chance.bits() % run.world.shafts.len() as u64) as usize;
        let actuator = run.world.shafts[i].actuator;
        if run.world.bridge.state().flags[actuator] & flag::FROZEN_UNDETECTABLE != 0 {
            return None;
        }
        found(run, |world, _| freeze(&mut world.shafts[i], true))
    }),
    ("hot while a load is held", |run| {
        if let Err(outcome) = comes_to_rest(run) {
            return outcome;
        }
        let before: Vec<[f64; 2]> = run.world.shafts.iter().map(Shaft::at_actuator).collect();
        let outcome = found_of(run, |shaft, _| shaft.temperature = 115.0);
        // it holds its load until the end of the stop
        while run.world.stopped().is_some_and(|(state, _)| state == MechanismState::Stopping) {
            for (shaft, [position, _]) in run.world.shafts.iter().zip(&before) {
                let [now, _] = shaft.at_actuator();
                let range = shaft.limits.upper - shaft.limits.lower;
                if shaft.motor.plant.power && (now - position).abs() > 0.05 * range {
                    return Some(Err(format!("it sank by {}", now - position)));
                }
            }
            run.cycle();
        }
        outcome
    }),
    ("into a limit", |run| {
        if run.world.robot.is_some() || run.name.contains("position") {
            return None;
        }
        let side = if run.chance.bits() % 2 == 0 { 1.0 } else { -1.0 };
        let speed = run.chance.within(0.3, 0.95) * SPEED;
        let begin_ns = run.world.now_ns;
        let mut at = None;
        while run.world.now_ns < begin_ns + 12_000 * MS {
            let shaft = &run.world.shafts[0];
            if side * shaft.position > 3.03 {
                return Some(Err(format!("{} rad at {} rad/s", shaft.position, shaft.velocity)));
            }
            let lag = side * speed - shaft.velocity;
            let torque =
                (20.0 * shaft.inertia * lag - shaft.load).clamp(-0.9 * EFFORT, 0.9 * EFFORT);
            run.world.give(Setpoint { torque, ..Setpoint::default() });
            run.world.shafts[0].load = match run.body {
                Body::Motor { load } => load * run.world.shafts[0].position.sin(),
                Body::Robot { .. } => 0.0,
            };
            run.pass();
            if run.world.stopped().is_some() && at.is_none() {
                at = Some((run.world.now_ns - begin_ns) as f64 / MS as f64);
            }
        }
        at.map(Ok)
    }),
    ("zero moves without power", |run| {
        run.disarm();
        let by = run.chance.within(0.2, 3.0) * if run.chance.bits() % 2 == 0 { 1.0 } else { -1.0 };
        run.world.shafts[0].encoder = Encoder::Off(by);
        run.pause(|_| ());
        Some(run.is_refused(1.0, &[Reason::PositionChanged], |_| ()))
    }),
    ("armed in motion", |run| {
        if run.world.robot.is_some() {
            return None;
        }
        run.disarm();
        let speed = run.chance.within(0.05, 0.9) * SPEED;
        let side = -run.world.shafts[0].position.signum();
        // from side to side
        let mut turn = |world: &mut World| {
            let shaft = &mut world.shafts[0];
            let is_far = shaft.position.abs() > 2.0;
            let way = if is_far { -shaft.position.signum() } else { shaft.velocity.signum() };
            shaft.velocity = speed * if shaft.velocity == 0.0 { side } else { way };
        };
        run.pause(&mut turn);
        Some(run.is_refused(0.5, &[Reason::Moving, Reason::PositionChanged], turn))
    }),
    ("old feedback while it is armed", |run| {
        run.disarm();
        let delay_ns = (run.chance.within(30.0, 200.0) * 1e6) as u64;
        run.world.shafts.iter_mut().for_each(|shaft| shaft.delay_ns = delay_ns);
        let begin_ns = run.world.now_ns;
        run.rests = false;
        run.rest_ns = run.world.now_ns;
        // motors that measure without being asked are armed, and stopped once they move
        if run.is_refused(1.0, &[], |_| ()).is_ok() {
            return Some(Ok(0.0));
        }
        let outcome = run.until(FOUND_S);
        let ms = (run.world.now_ns - begin_ns) as f64 / MS as f64;
        Some(outcome.map(|_| ms).ok_or("not found".to_owned()))
    }),
    ("commands for another robot", |run| {
        found(run, |world, _| {
            world.command.fingerprint ^= 1;
            world.is_stranger = true;
        })
    }),
    ("second encoder slips", |run| {
        run.world.robot.as_ref()?.encoder()?;
        found(run, |world, chance| {
            let by = MARGIN * chance.within(1.5, 4.0);
            world.slip = if chance.bits() % 2 == 0 { by } else { -by };
        })
    }),
];

/// It holds where it is, with its set-points at rest for half a second; if it is stopped before,
/// the outcome of its attack: none where the stop has its reason.
fn comes_to_rest(run: &mut Run) -> Result<(), Outcome> {
    run.rests = true;
    let last_ns = run.world.now_ns.max(run.next.begin_ns + (run.next.seconds * 1e9) as u64);
    while run.world.now_ns < last_ns + 500 * MS {
        run.cycle();
        if let Some((_, reason)) = run.world.stopped() {
            let is_true = run.is_true(reason);
            return Err((!is_true).then(|| Err(format!("no rest: {reason:?}"))));
        }
    }
    Ok(())
}

fn freeze(shaft: &mut Shaft, velocity_too: bool) {
    shaft.encoder = Encoder::Frozen { position: shaft.position, velocity_too };
}

/// Whether a protocol can show an attack; see the blind spots of the README. A robot has more than
/// one way to find it, and one motor that cannot show it is enough not to make it.
pub(super) fn is_possible(attack: &str, drive: &str) -> bool {
    let has_efforts = !["rmd", "vesc", "ak_servo", "dbc"].iter().any(|name| drive.contains(name));
    match attack {
        "150 °C" | "hot while a load is held" => {
            !["cia402", "dbc", "cheetah"].iter().any(|name| drive.contains(name))
        }
        "two motors on one id" => {
            !["odrive", "rmd", "vesc", "ak_servo", "dbc"].iter().any(|name| drive.contains(name))
        }
        "limp" | "pushes" => has_efforts && !drive.contains("position"),
        "second master" => !drive.contains("dbc"),
        _ => true,
    }
}
