//! No false alarm, and every attack found: motors of all protocols that make quick moves from rest
//! to rest, at 250 to 1000 Hz, while frames are lost, late, held back and cut off, with quiet and
//! noisy encoders; each run ends with an attack at a random moment of the motion.
//!
//! Twenty minutes of the bridge's time; `SARRUS_SOAK_SECONDS=1000000` makes it more, from seed
//! `SARRUS_SOAK_SEED` on, and stops after `SARRUS_SOAK_MINUTES`. Every false alarm prints its seed.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::drive::Setpoint;
use sarrus_can_core::frame::Frame;
use sarrus_proto::actuators::{MechanismState, Operation, Reason};

use crate::attack_table::drives;
use crate::closed_loop::{DBC, DBC_FILE};
use crate::world::{Chance, Encoder, MS, Shaft, World};

/// Time of the motion before the attack, and time to find it `[s]`.
const QUIET_S: f64 = 20.0;
const FOUND_S: f64 = 10.0;
/// Greatest speed and effort of the configuration, and the part of both that a move needs.
const SPEED: f64 = 5.0;
const EFFORT: f64 = 2.0;
const PART: f64 = 0.85;
/// Least deceleration of a stop, SPEED in 0.4 s `[rad/s²]`.
const BRAKE: f64 = SPEED / 0.4;
/// Part of the way to a limit for which a stop is true by the codes of position and velocity.
const CODES: f64 = 0.98;

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(usual)
}

/// The drives of the table, and those that it leaves out.
pub(crate) fn all_drives() -> Vec<(&'static str, String)> {
    let turns = "id: 3, motor_torque_constant: 0.1, pole_pairs: 7";
    let mit = "id: 4, reply_id: 20, position_range: 12.5, velocity_range: 30, torque_range: 10, \
        stiffness_range: 500, damping_range: 5";
    let cia402 = "node: 5, rated_torque: 2.0, counts_per_turn: 65536";
    let more = [
        ("mini_cheetah impedance", format!("{{protocol: mit, variant: mini_cheetah, {mit}}}")),
        (
            "cia402 position alone",
            format!(
                "{{protocol: cia402, {cia402}, mode: position, \
            velocity_feedback: false}}"
            ),
        ),
        ("rmd torque", "{protocol: rmd, id: 3, motor_torque_constant: 1}".to_owned()),
        ("vesc torque", format!("{{protocol: vesc, {turns}}}")),
        ("ak_servo torque", format!("{{protocol: ak_servo, {turns}, reduction: 9}}")),
        ("dbc torque", format!("{{protocol: dbc, {}", &DBC[1..])),
    ];
    drives().into_iter().chain(more).collect()
}

/// A move from rest to rest.
struct Move {
    from: f64,
    way: f64,
    begin_ns: u64,
    seconds: f64,
    is_smooth: bool,
}

impl Move {
    /// A move to a random place, as quick as speed and effort allow, or slower.
    fn new(world: &World, chance: &mut Chance, from: f64, load: f64) -> Move {
        let shaft = &world.shafts[0];
        let way = chance.within(-2.5, 2.5) - from;
        let is_smooth = chance.within(0.0, 1.0) < 0.5;
        // greatest speed and acceleration of a move of one second and one radian
        let [speed, acceleration] = if is_smooth { [1.875, 5.78] } else { [2.0, 4.0] };
        let carried = load.abs() + shaft.dry + shaft.friction * SPEED;
        let most = (PART * EFFORT - carried) / shaft.inertia;
        let by_speed = speed * way.abs() / (PART * SPEED);
        let by_effort = (acceleration * way.abs() / most).sqrt();
        let seconds = by_speed.max(by_effort).max(0.02) * chance.within(0.0, 1.0).exp();
        Move { from, way, begin_ns: world.now_ns, seconds, is_smooth }
    }

    /// Position, velocity and acceleration.
    fn at(&self, now_ns: u64) -> [f64; 3] {
        let t = self.seconds;
        let x = ((now_ns - self.begin_ns) as f64 * 1e-9 / t).min(1.0);
        let [part, speed, acceleration] = if self.is_smooth {
            [
                x.powi(3) * (10.0 - 15.0 * x + 6.0 * x * x),
                30.0 * x * x * (1.0 - x).powi(2),
                60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
            ]
        } else if x < 0.5 {
            [2.0 * x * x, 4.0 * x, 4.0]
        } else {
            [1.0 - 2.0 * (1.0 - x).powi(2), 4.0 * (1.0 - x), if x < 1.0 { -4.0 } else { 0.0 }]
        };
        [self.from + self.way * part, self.way * speed / t, self.way * acceleration / (t * t)]
    }

    fn is_over(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.begin_ns) as f64 * 1e-9 >= self.seconds
    }
}

/// A motor, its motion and its troubles.
struct Run {
    name: &'static str,
    world: World,
    chance: Chance,
    gains: [f64; 2],
    /// How true the inertia and friction of the controller are.
    knowledge: f64,
    load: f64,
    next: Move,
    rest_ns: u64,
    /// Longest time for which answers are held back, and for which frames are cut off `[cycles]`.
    bursts: [u64; 2],
    /// The fastest lately `[rad/s]`, and the greatest part of the way to a limit that a stop
    /// needed.
    fastest: f64,
    braking: f64,
}

/// Part of the way to the limit, and a quarter of its margin, that the least brake of the
/// configuration needs: `position_limit` in the README.
fn braking(shaft: &Shaft, period_ns: u64) -> f64 {
    let speed = shaft.velocity.abs();
    let delay = 0.04 + 4e-9 * period_ns as f64;
    let room = 3.015 - shaft.position * shaft.velocity.signum();
    speed * (0.5 * speed / BRAKE + delay) / room
}

impl Run {
    fn new(seed: u64, drives: &[(&'static str, String)]) -> Option<Run> {
        let mut chance = Chance(seed);
        let (name, drive) = &drives[(chance.bits() % drives.len() as u64) as usize];
        let rate = [250, 333, 500, 1000][(chance.bits() % 4) as usize];
        let text = World::text(drive, "").replace("rate_hz: 250", &format!("rate_hz: {rate}"));
        let mut world = World::read_beside(text, DBC_FILE);
        world.chance = Chance(seed ^ 0x00C0_FFEE);
        let period_ns = world.period_ns;
        let some = |chance: &mut Chance| chance.within(0.0, 1.0) < 0.6;
        let shaft = &mut world.shafts[0];
        shaft.inertia = 0.004 * chance.within(0.0, 2.5).exp();
        shaft.friction = chance.within(0.0, 0.02);
        shaft.dry = if some(&mut chance) { chance.within(0.0, 0.05) } else { 0.0 };
        shaft.quantum = if some(&mut chance) { 3.8e-4 * chance.within(0.05, 1.0) } else { 0.0 };
        let load = if some(&mut chance) { chance.within(-0.6, 0.0) } else { 0.0 };
        let speed = chance.within(8.0, 25.0);
        let gains = [shaft.inertia * speed * speed, 1.4 * shaft.inertia * speed];
        // the first report says in which turn it is; later the bridge learns how noisy it is
        world.cycles(100);
        world.noise = if some(&mut chance) { 0.0 } else { chance.within(0.0, 2.0) };
        let armed = (0..5).any(|_| {
            world.bridge.operate(world.now_ns, Operation::Reset);
            world.arm().is_some()
        });
        if !armed {
            println!("{name} at {rate} Hz is not armed: {:?}, seed {seed}", world.state(0));
            return None;
        }
        if some(&mut chance) {
            world.loss = chance.within(0.0, 0.02);
        }
        if some(&mut chance) {
            let most_ns = (0.9 * period_ns as f64).min(3e6);
            world.jitter_ns =
                [most_ns, 3e6].map(|most: f64| (most * chance.within(0.0, 1.0)) as u64);
        }
        let bursts =
            if some(&mut chance) { [(6 * MS).max(3 * period_ns) / period_ns, 3] } else { [0, 0] };
        let next =
            Move { from: 0.0, way: 0.0, begin_ns: world.now_ns, seconds: 0.02, is_smooth: true };
        let armed_ns = world.now_ns;
        let knowledge = chance.within(0.8, 1.2);
        Some(Run {
            name,
            world,
            chance,
            gains,
            knowledge,
            load,
            next,
            rest_ns: armed_ns + 800 * MS,
            bursts,
            fastest: 0.0,
            braking: 0.0,
        })
    }

    /// One cycle of the motion.
    fn cycle(&mut self) {
        let Run { world, chance, next, .. } = self;
        let now_ns = world.now_ns;
        // as a weight hangs from it
        world.shafts[0].load = self.load * world.shafts[0].position.sin();
        if next.is_over(now_ns) && now_ns >= self.rest_ns {
            let [place, ..] = next.at(now_ns);
            *next = Move::new(world, chance, place, self.load);
            let rest = if chance.bits() % 2 == 0 { chance.within(0.0, 0.5) } else { 0.0 };
            self.rest_ns = now_ns + ((next.seconds + rest) * 1e9) as u64;
        }
        let [position, velocity, acceleration] = next.at(now_ns);
        let shaft = &world.shafts[0];
        let moving = if velocity == 0.0 { 0.0 } else { shaft.dry * velocity.signum() };
        let effort = shaft.inertia * acceleration + shaft.friction * velocity + moving;
        let [stiffness, damping] = self.gains;
        let torque = self.knowledge * effort - self.load * position.sin();
        world.give(Setpoint { position, velocity, torque, stiffness, damping });
        // once in two seconds on average
        let [held, cut] = self.bursts;
        let period_ns = world.period_ns;
        if held > 0 && chance.within(0.0, 2e9) < period_ns as f64 {
            match chance.bits() % 2 {
                0 => world.held_until_ns = now_ns + held * period_ns,
                _ => world.lost_until_ns = now_ns + (1 + chance.bits() % cut) * period_ns,
            }
        }
        world.cycle();
        let fastest = 0.99 * self.fastest;
        self.fastest = fastest.max(world.shafts[0].velocity.abs());
        self.braking = (0.999 * self.braking).max(braking(&world.shafts[0], period_ns));
    }

    /// Runs until something is found, or for this time; the reason.
    fn until(&mut self, seconds: f64) -> Option<Reason> {
        let end_ns = self.world.now_ns + (seconds * 1e9) as u64;
        while self.world.now_ns < end_ns {
            self.cycle();
            let (state, reason) = self.world.state(0);
            if state != MechanismState::Enabled {
                return Some(reason);
            }
        }
        None
    }
}

type Attack = fn(&mut World, &mut Chance);

const ATTACKS: &[(&str, Attack)] = &[
    ("encoder jumps", |world, chance| {
        let by = chance.within(0.2, 3.0) * if chance.bits() % 2 == 0 { 1.0 } else { -1.0 };
        world.shafts[0].encoder = Encoder::Off(by);
    }),
    ("encoder reversed", |world, _| world.shafts[0].encoder = Encoder::Reversed),
    ("position frozen", |world, _| freeze(world, false)),
    ("position and velocity frozen", |world, _| freeze(world, true)),
    ("limp", |world, _| world.shafts[0].stuck = Some(0.0)),
    ("pushes", |world, chance| world.shafts[0].stuck = Some(chance.within(3.0, 9.0))),
    ("two motors on one id", |world, _| world.shafts[0].is_doubled = true),
    ("second master", |world, _| {
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
    }),
    ("silence", |world, _| world.shafts[0].motor.silence(true)),
    ("150 °C", |world, _| world.shafts[0].temperature = 150.0),
    ("blocked", |world, _| world.shafts[0].is_blocked = true),
    ("error-passive", |world, _| world.event(0, BusEvent::ErrorPassive)),
];

fn freeze(world: &mut World, velocity_too: bool) {
    let position = world.shafts[0].position;
    world.shafts[0].encoder = Encoder::Frozen { position, velocity_too };
}

/// Whether a protocol can show an attack; see the blind spots of the README.
fn is_possible(attack: &str, drive: &str) -> bool {
    let has_efforts = !["rmd", "vesc", "ak_servo", "dbc"].iter().any(|name| drive.contains(name));
    match attack {
        "150 °C" => !["cia402", "dbc", "cheetah"].iter().any(|name| drive.contains(name)),
        "two motors on one id" => {
            !["odrive", "rmd", "vesc", "ak_servo", "dbc"].iter().any(|name| drive.contains(name))
        }
        "limp" | "pushes" => has_efforts && !drive.contains("position"),
        "second master" => !drive.contains("dbc"),
        _ => true,
    }
}

#[test]
fn nothing_is_found_where_nothing_is_wrong_and_every_attack_is() {
    let first = number("SARRUS_SOAK_SEED", 1);
    let n_runs = number("SARRUS_SOAK_SECONDS", 1200).div_ceil(QUIET_S as u64);
    let end = Instant::now() + Duration::from_secs(60 * number("SARRUS_SOAK_MINUTES", 60));
    let drives = all_drives();
    let mut seconds = 0.0;
    let mut n_fast = 0;
    let mut false_alarms = Vec::new();
    let mut unfound = Vec::new();
    let mut times: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut next = first;
    while next < first + n_runs && Instant::now() < end {
        let seed = next;
        next += 1;
        let Some(mut run) = Run::new(seed, &drives) else {
            false_alarms.push(format!("seed {seed}: not armed"));
            continue;
        };
        let begin_ns = run.world.now_ns;
        let quiet = QUIET_S + run.chance.within(0.0, 2.0);
        let alarm = run.until(quiet);
        seconds += (run.world.now_ns - begin_ns) as f64 * 1e-9;
        let about = format!(
            "seed {seed}, {} at {} Hz, loss {:.3}, jitter {:?} µs, noise {:.1}, bursts {:?}, \
                fastest {:.2} rad/s, braking {:.3}",
            run.name,
            1_000_000_000 / run.world.period_ns,
            run.world.loss,
            run.world.jitter_ns.map(|ns| ns / 1000),
            run.world.noise,
            run.bursts,
            run.fastest,
            run.braking,
        );
        let is_true = match alarm {
            Some(Reason::VelocityLimit) => run.fastest > 1.05 * SPEED,
            Some(Reason::PositionLimit) => {
                run.world.shafts[0].position.abs() > 3.03 || run.braking > CODES
            }
            _ => false,
        };
        if is_true {
            n_fast += 1;
            continue;
        }
        if let Some(reason) = alarm {
            let t = (run.world.now_ns - begin_ns) as f64 * 1e-9;
            println!("{} after {t:.3} s: {about}", reason.name());
            false_alarms.push(format!("{} {about}", reason.name()));
            continue;
        }
        let (attack, apply) = &ATTACKS[(run.chance.bits() % ATTACKS.len() as u64) as usize];
        if !is_possible(attack, run.name) {
            continue;
        }
        // in a cycle that asks the motor, whose frames a second master repeats
        while run.world.bridge.frames(0).iter().all(|frame| frame.data().len() < 3) {
            run.cycle();
        }
        let attacked_ns = run.world.now_ns;
        apply(&mut run.world, &mut run.chance);
        match run.until(FOUND_S) {
            Some(_) => {
                let ms = (run.world.now_ns - run.world.period_ns - attacked_ns) as f64 / MS as f64;
                times.entry(attack).or_default().push(ms);
            }
            None => {
                println!("not found: {attack}, {about}");
                unfound.push(format!("{attack}, {about}"));
            }
        }
    }
    println!(
        "{seconds:.0} s of the bridge's time, seeds {first} to {}, {} false alarms, {n_fast} runs ended \
            by a true excess, {} attacks not found",
        next - 1,
        false_alarms.len(),
        unfound.len()
    );
    for (attack, times) in &mut times {
        times.sort_by(f64::total_cmp);
        let at = |part: f64| times[((times.len() - 1) as f64 * part) as usize];
        println!(
            "{attack:30} {:6} times, found after p50 {:.0} ms, p99 {:.0} ms, at most {:.0} ms",
            times.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
    assert!(false_alarms.is_empty() && unfound.is_empty(), "{false_alarms:#?} {unfound:#?}");
}
