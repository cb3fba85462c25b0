//! No false alarm, and every attack found: motors of all protocols, alone or in bundled robots
//! with closed mechanisms, that make quick moves from rest to rest, at 250 to 1000 Hz, while frames
//! are lost, late, held back and cut off, with quiet and noisy encoders; each run ends with an
//! attack at a random moment of the motion.
//!
//! Twenty minutes of the bridge's time; `SARRUS_SOAK_SECONDS=1000000` makes it more, from seed
//! `SARRUS_SOAK_SEED` on, and stops after `SARRUS_SOAK_MINUTES`. Every false alarm prints its seed.

mod attacks;
mod moves;
mod pushes;
mod regressions;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::drive::{Mode, Setpoint};
use sarrus_can_core::frame::Frame;
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Operation, Reason, flag};

use self::attacks::{ATTACKS, is_possible};
use self::moves::Move;
use crate::attack_table::drives;
use crate::closed_loop::{DBC, DBC_FILE};
use crate::robots::{self, Drawn, MARGIN};
use crate::world::{Chance, Encoder, MS, Shaft, World};

/// Time of the motion before the attack, of a motor and of a robot, and time to find it `[s]`.
const QUIET_S: [f64; 2] = [20.0, 60.0];
const FOUND_S: f64 = 10.0;
/// One seed in so many is of a robot.
const ROBOTS: u64 = 25;
/// Greatest speed and effort of a motor's configuration, and the part of both that a move needs.
const SPEED: f64 = 5.0;
const EFFORT: f64 = 2.0;
const PART: f64 = 0.85;
/// Part of the way to a limit for which a stop is true by the codes of position and velocity, and
/// of a lag and its time.
const CODES: f64 = 0.98;
/// Time for which a motor may lag behind `[s]`.
const FOLLOWING_S: f64 = 0.5;
/// A speed beyond its limit is found within so many cycles.
const FOUND_CYCLES: usize = 8;
/// Part of its box that a robot leaves no more, to which no pose is near to a singular one.
const LEFT: f64 = 1.1;
/// How far a damper turns its motor's speed in the time until it takes effect: it swings at π/2.
const TURNED: f64 = 0.8;

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

/// A motor or a robot.
enum Body {
    /// A motor with a weight that hangs from it.
    Motor { load: f64 },
    /// A robot: the box of its independents, the inertia of each actuator, and how much lighter a
    /// motion of all of them is.
    Robot { half: &'static [f64], inertia: Vec<f64>, lightness: f64 },
}

/// Motors, their motion and their troubles.
struct Run {
    name: String,
    world: World,
    chance: Chance,
    body: Body,
    /// How fast the controller is `[rad/s]`.
    speed: f64,
    /// How true the inertia and friction of the controller are.
    knowledge: f64,
    /// Where the move begins, and its way: of the shaft, or of the robot's independents.
    from: Vec<f64>,
    way: Vec<f64>,
    next: Move,
    rest_ns: u64,
    /// It stays where it is from the next end of a move on.
    rests: bool,
    /// Longest time for which answers are held back, and for which frames are cut off `[cycles]`.
    bursts: [u64; 2],
    /// How long an actuator may have been behind, has been behind for certain, and was so at most
    /// `[s]`.
    behind: [f64; 3],
    /// The fastest in each of the last cycles, in which it is found, as part of the limit, and the
    /// greatest part of the way to a limit that a stop needed lately.
    fastest: [f64; FOUND_CYCLES],
    braking: f64,
    numbers: Vec<f64>,
}

/// Part of the way to the limit, and a quarter of its margin, that the least brake of the
/// configuration needs: `position_limit` in the README.
fn braking(shaft: &Shaft, period_ns: u64) -> f64 {
    let [position, velocity] = shaft.at_actuator();
    let limits = &shaft.limits;
    let delay = 0.04 + 4e-9 * period_ns as f64;
    let room = if velocity > 0.0 { limits.upper - position } else { position - limits.lower };
    let room = room + 0.0025 * (limits.upper - limits.lower);
    let speed = velocity.abs();
    speed * (0.5 * speed * 0.4 / limits.velocity + delay) / room
}

/// Whether an actuator is farther behind than `following_error` in the README allows, by this
/// factor.
fn is_behind(shaft: &Shaft, command: &ActuatorCommand, factor: f64) -> bool {
    let [position, _] = shaft.at_actuator();
    let limits = &shaft.limits;
    let error = (command.position[shaft.actuator] - position).abs() / factor;
    let pull = command.stiffness[shaft.actuator] * error / limits.effort;
    let part = error / (limits.upper - limits.lower);
    match shaft.mode {
        Mode::Impedance | Mode::Torque => pull > 0.2 && part > 0.05 && (pull > 1.0 || part > 0.25),
        Mode::Position => part > 0.05,
        Mode::Velocity => false,
    }
}

fn some(chance: &mut Chance) -> bool {
    chance.within(0.0, 1.0) < 0.6
}

impl Run {
    fn new(seed: u64, drives: &[(&'static str, String)]) -> Option<Run> {
        let mut chance = Chance(seed);
        if seed % ROBOTS == 1 {
            Run::robot(seed, chance, drives, "effort: 0.3")
        } else {
            let (name, drive) = &drives[(chance.bits() % drives.len() as u64) as usize];
            let rate = [250, 333, 500, 1000][(chance.bits() % 4) as usize];
            let text = World::text(drive, "").replace("rate_hz: 250", &format!("rate_hz: {rate}"));
            let mut world = World::read_beside(text, DBC_FILE);
            world.chance = Chance(seed ^ 0x00C0_FFEE);
            let shaft = &mut world.shafts[0];
            shaft.inertia = 0.004 * chance.within(0.0, 2.5).exp();
            shaft.friction = chance.within(0.0, 0.02);
            shaft.dry = if some(&mut chance) { chance.within(0.0, 0.05) } else { 0.0 };
            shaft.quantum = if some(&mut chance) { 3.8e-4 * chance.within(0.05, 1.0) } else { 0.0 };
            let load = if some(&mut chance) { chance.within(-0.6, 0.0) } else { 0.0 };
            Run::begin(seed, chance, (*name).to_owned(), world, Body::Motor { load })
        }
    }

    /// A robot whose bridge has these rules of the model.
    fn robot(
        seed: u64,
        mut chance: Chance,
        drives: &[(&'static str, String)],
        rules: &str,
    ) -> Option<Run> {
        let rates = [1000, 500, 333, 250];
        let first = (chance.bits() % 4) as usize;
        let drawn = |rate: u32| {
            let mut chance = Chance(seed ^ 0x0B07);
            let mut drawn = robots::draw(&mut chance, drives, rate);
            drawn.text = drawn.text.replacen("effort: 0.3", rules, 1);
            World::of_robot(&drawn).map(|world| (drawn, world))
        };
        let (drawn, mut world) = rates[first..].iter().find_map(|rate| drawn(*rate))?;
        let Drawn { name, half, inertia, drives, lightness, .. } = drawn;
        world.chance = Chance(seed ^ 0x00C0_FFEE);
        let rotor = chance.within(0.01, 0.15);
        let friction = chance.within(0.0, 0.03);
        let dry = if some(&mut chance) { chance.within(0.0, 0.02) } else { 0.0 };
        let quantum = if some(&mut chance) { 3.8e-4 * chance.within(0.05, 1.0) } else { 0.0 };
        for shaft in &mut world.shafts {
            let gear = shaft.mapping.gear;
            let torque = shaft.limits.effort / (gear * shaft.mapping.torque_constant);
            let square = gear * gear * shaft.mapping.torque_constant;
            shaft.inertia = rotor * inertia[shaft.actuator] / square;
            shaft.friction = friction * torque / (gear * shaft.limits.velocity);
            (shaft.dry, shaft.quantum) = (dry * torque, quantum);
        }
        let lightness = 1.0 / (1.0 / lightness + rotor);
        let name = format!("{name} on {drives:?}");
        Run::begin(seed, chance, name, world, Body::Robot { half, inertia, lightness })
    }

    /// Arms, and then the troubles begin.
    fn begin(seed: u64, mut chance: Chance, name: String, world: World, body: Body) -> Option<Run> {
        let period_ns = world.period_ns;
        let speed = chance.within(8.0, 25.0);
        let from = world.robot.as_ref().map_or(vec![0.0], |robot| robot.y.clone());
        let next = Move { begin_ns: world.now_ns, seconds: 0.02, is_smooth: true };
        let mut run = Run {
            name,
            chance: Chance(0),
            body,
            speed,
            knowledge: 1.0,
            way: vec![0.0; from.len()],
            from,
            next,
            rest_ns: u64::MAX,
            rests: false,
            bursts: [0, 0],
            behind: [0.0; 3],
            fastest: [0.0; FOUND_CYCLES],
            braking: 0.0,
            numbers: Vec::new(),
            world,
        };
        if run.world.robot.is_some() {
            run.command();
        }
        let world = &mut run.world;
        // the first report says in which turn it is; later the bridge learns how noisy it is
        world.cycles(100);
        world.noise = if some(&mut chance) { 0.0 } else { chance.within(0.0, 2.0) };
        let armed = (0..5).any(|_| {
            world.bridge.operate(world.now_ns, Operation::Reset);
            world.arm().is_some()
        });
        if !armed {
            let state: Vec<_> =
                world.shafts.iter().map(|shaft| world.state(shaft.actuator)).collect();
            println!("{} is not armed: {state:?}, seed {seed}", run.name);
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
        if some(&mut chance) {
            run.bursts = [(6 * MS).max(3 * period_ns) / period_ns, 3];
        }
        // nor is the damper so strong that it swings by the delay of cycle, bus and troubles
        if let Body::Robot { lightness, .. } = run.body {
            let [late_ns, back_ns] = world.jitter_ns;
            let delay_ns = 1.5 * period_ns as f64 + 0.5 * (late_ns + back_ns) as f64;
            run.speed = run.speed.min(TURNED / (1.4e-9 * delay_ns * lightness));
        }
        run.next.begin_ns = world.now_ns;
        run.rest_ns = world.now_ns + 800 * MS;
        run.knowledge = chance.within(0.8, 1.2);
        run.chance = chance;
        Some(run)
    }

    /// Where the move is: of the shaft or the independents, its velocity and its acceleration.
    fn wanted(&self) -> [Vec<f64>; 3] {
        let [part, speed, acceleration] = self.next.at(self.world.now_ns);
        let position = self.from.iter().zip(&self.way).map(|(from, way)| from + part * way);
        let of = |factor: f64| self.way.iter().map(|way| factor * way).collect();
        [position.collect(), of(speed), of(acceleration)]
    }

    /// A move to a random place, as quick as speed, effort and brakes allow, or slower.
    fn go_on(&mut self) {
        let [from, ..] = self.wanted();
        let Run { world, chance, .. } = self;
        let seconds;
        let is_smooth;
        match &self.body {
            Body::Motor { load } => {
                let shaft = &world.shafts[0];
                let way = chance.within(-2.5, 2.5) - from[0];
                is_smooth = chance.within(0.0, 1.0) < 0.5;
                let [speed, acceleration] = Move::greatest(is_smooth);
                let carried = load.abs() + shaft.dry + shaft.friction * SPEED;
                let most = (PART * EFFORT - carried) / shaft.inertia;
                let by_speed = speed * way.abs() / (PART * SPEED);
                let by_effort = (acceleration * way.abs() / most).sqrt();
                seconds = by_speed.max(by_effort).max(0.02) * chance.within(0.0, 1.0).exp();
                self.way = vec![way];
            }
            Body::Robot { half, .. } => {
                let to = half.iter().map(|half| half * chance.within(-1.0, 1.0));
                self.way = to.zip(&from).map(|(to, from)| to - from).collect();
                is_smooth = chance.within(0.0, 1.0) < 0.5;
                let mut least = 0.1;
                let robot = world.robot.as_mut().expect("a robot");
                for k in 0..24 {
                    // at its quickest places too
                    let x = if is_smooth { f64::from(k) / 23.0 } else { f64::from(k / 2) / 11.5 };
                    loop {
                        let next = Move { begin_ns: 0, seconds: least, is_smooth };
                        let [part, speed, acceleration] = next.at((x * least * 1e9) as u64);
                        let of = |factor: f64| -> Vec<f64> {
                            self.way.iter().map(|way| factor * way).collect()
                        };
                        let y: Vec<f64> = from
                            .iter()
                            .zip(&self.way)
                            .map(|(from, way)| from + part * way)
                            .collect();
                        robot.efforts([&y, &of(speed), &of(acceleration)], &mut self.numbers);
                        if robots::is_allowed(&world.shafts, &self.numbers, world.period_ns) {
                            break;
                        }
                        least *= 1.1;
                        assert!(least < 100.0, "{}: nowhere from {from:?}", self.name);
                    }
                }
                seconds = least * chance.within(0.0, 1.0).exp();
            }
        }
        self.from = from;
        self.next = Move { begin_ns: world.now_ns, seconds, is_smooth };
        let rest = if chance.bits() % 2 == 0 { chance.within(0.0, 0.5) } else { 0.0 };
        self.rest_ns = world.now_ns + ((seconds + rest) * 1e9) as u64;
    }

    /// Gives the set-points of the move.
    fn command(&mut self) {
        let [position, velocity, acceleration] = self.wanted();
        let Run { world, knowledge, speed, .. } = self;
        match &self.body {
            Body::Motor { load } => {
                let shaft = &mut world.shafts[0];
                // as a weight hangs from it
                shaft.load = load * shaft.position.sin();
                let [position, velocity] = [position[0], velocity[0]];
                let moving = if velocity == 0.0 { 0.0 } else { shaft.dry * velocity.signum() };
                let effort = shaft.inertia * acceleration[0] + shaft.friction * velocity + moving;
                let torque = *knowledge * effort - load * position.sin();
                let stiffness = shaft.inertia * *speed * *speed;
                let damping = 1.4 * shaft.inertia * *speed;
                world.give(Setpoint { position, velocity, torque, stiffness, damping });
            }
            Body::Robot { inertia, .. } => {
                let acceleration: Vec<f64> =
                    acceleration.iter().map(|of| *knowledge * of).collect();
                let robot = world.robot.as_mut().expect("a robot");
                robot.efforts([&position, &velocity, &acceleration], &mut self.numbers);
                let n_u = inertia.len();
                for shaft in &world.shafts {
                    let u = shaft.actuator;
                    let inertia = inertia[u];
                    let velocity = self.numbers[n_u + u];
                    let drag = shaft.drag(velocity);
                    world.command.position[u] = self.numbers[u];
                    world.command.velocity[u] = velocity;
                    world.command.effort[u] = self.numbers[2 * n_u + u] + *knowledge * drag;
                    world.command.stiffness[u] = inertia * *speed * *speed;
                    world.command.damping[u] = 1.4 * inertia * *speed;
                }
            }
        }
    }

    /// One cycle of the motion.
    fn cycle(&mut self) {
        let now_ns = self.world.now_ns;
        if self.next.is_over(now_ns) && now_ns >= self.rest_ns && !self.rests {
            self.go_on();
        }
        self.command();
        self.pass();
    }

    /// One cycle with the set-points as they are.
    fn pass(&mut self) {
        let Run { world, chance, .. } = self;
        let now_ns = world.now_ns;
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
        for (behind, factor) in self.behind.iter_mut().zip([CODES, 1.0 / CODES]) {
            let is_behind = |shaft: &Shaft| is_behind(shaft, &world.command, factor);
            let is_behind = world.shafts.iter().any(is_behind);
            *behind = if is_behind { *behind + period_ns as f64 * 1e-9 } else { 0.0 };
        }
        let [_, behind, most] = &mut self.behind;
        *most = most.max(*behind);
        self.braking *= 0.999;
        self.fastest.rotate_right(1);
        self.fastest[0] = 0.0;
        for shaft in &world.shafts {
            let [_, velocity] = shaft.at_actuator();
            self.fastest[0] = self.fastest[0].max(velocity.abs() / shaft.limits.velocity);
            self.braking = self.braking.max(braking(shaft, period_ns));
        }
    }

    /// Runs until something is found, or for this time; the reason.
    fn until(&mut self, seconds: f64) -> Option<Reason> {
        let end_ns = self.world.now_ns + (seconds * 1e9) as u64;
        while self.world.now_ns < end_ns {
            self.cycle();
            if let Some((_, reason)) = self.world.stopped() {
                return Some(reason);
            }
        }
        None
    }

    /// Whether an alarm is none: the motion went beyond its limits, or far from its command.
    fn is_true(&self, reason: Reason) -> bool {
        let is_beyond = |shaft: &Shaft| {
            let [position, _] = shaft.at_actuator();
            let margin = 0.01 * (shaft.limits.upper - shaft.limits.lower);
            position > shaft.limits.upper + margin || position < shaft.limits.lower - margin
        };
        match reason {
            Reason::VelocityLimit => self.fastest.iter().any(|part| *part > 1.05),
            Reason::PositionLimit => {
                self.world.shafts.iter().any(is_beyond) || self.braking > CODES
            }
            Reason::FollowingError => self.behind[0] > CODES * FOLLOWING_S,
            Reason::NearSingular => match (&self.body, &self.world.robot) {
                (Body::Robot { half, .. }, Some(robot)) => {
                    robot.y.iter().zip(*half).any(|(y, half)| y.abs() > LEFT * half)
                }
                _ => false,
            },
            _ => false,
        }
    }

    /// Its power goes, and it lies on something.
    fn disarm(&mut self) {
        self.world.operate(Operation::Disarm);
        self.rests = true;
        let end_ns = self.world.now_ns + 1_000 * MS;
        while self.world.now_ns < end_ns {
            self.cycle();
        }
        if let Body::Motor { load } = &mut self.body {
            (*load, self.world.shafts[0].velocity) = (0.0, 0.0);
        }
        while self.world.now_ns < end_ns + 500 * MS {
            self.cycle();
        }
    }

    /// A fifth of a second.
    fn pause(&mut self, mut each: impl FnMut(&mut World)) {
        let end_ns = self.world.now_ns + 200 * MS;
        while self.world.now_ns < end_ns {
            each(&mut self.world);
            self.cycle();
        }
    }

    /// Asks for power for this time, and longer until the state has one of these reasons: the
    /// set-up of the motor comes first. An error where a motor gets power, or at another reason.
    fn is_refused(
        &mut self,
        seconds: f64,
        of: &[Reason],
        mut each: impl FnMut(&mut World),
    ) -> Result<f64, String> {
        self.world.operate(Operation::Reset);
        self.cycle();
        self.world.operate(Operation::Arm);
        let begin_ns = self.world.now_ns;
        let end_ns = begin_ns + (seconds * 1e9) as u64;
        let last_ns = begin_ns + self.world.bridge.configuration().timeouts.arming_ns;
        let mut reasons = Vec::new();
        let is_told =
            |reasons: &[Reason]| of.is_empty() || of.iter().any(|reason| reasons.contains(reason));
        while self.world.now_ns < if is_told(&reasons) { end_ns } else { last_ns } {
            each(&mut self.world);
            self.cycle();
            let (state, why) = self.world.state(0);
            if !reasons.contains(&why) {
                reasons.push(why);
            }
            if state == MechanismState::Enabled {
                return Err("it was armed".to_owned());
            }
        }
        is_told(&reasons).then_some(0.0).ok_or_else(|| format!("refused by {reasons:?}"))
    }
}

/// Results of the runs.
#[derive(Default)]
struct Tally {
    /// Of motors, and of robots `[s]`.
    seconds: [f64; 2],
    n_fast: usize,
    false_alarms: Vec<String>,
    unfound: Vec<String>,
    times: BTreeMap<String, Vec<f64>>,
}

impl Tally {
    fn run(&mut self, seed: u64, drives: &[(&'static str, String)]) {
        let Some(mut run) = Run::new(seed, drives) else {
            self.false_alarms.push(format!("seed {seed}: not armed"));
            return;
        };
        let kind = usize::from(run.world.robot.is_some());
        let begin_ns = run.world.now_ns;
        let quiet = QUIET_S[kind] + run.chance.within(0.0, 2.0);
        let alarm = run.until(quiet);
        self.seconds[kind] += (run.world.now_ns - begin_ns) as f64 * 1e-9;
        let about = format!(
            "seed {seed}, {} at {} Hz, loss {:.3}, jitter {:?} µs, noise {:.1}, bursts {:?}, \
                fastest {:.3?}, braking {:.3}",
            run.name,
            1_000_000_000 / run.world.period_ns,
            run.world.loss,
            run.world.jitter_ns.map(|ns| ns / 1000),
            run.world.noise,
            run.bursts,
            run.fastest,
            run.braking,
        );
        if let Some(reason) = alarm {
            if run.is_true(reason) {
                self.n_fast += 1;
                return;
            }
            let t = (run.world.now_ns - begin_ns) as f64 * 1e-9;
            println!("{} after {t:.3} s: {about}", reason.name());
            self.false_alarms.push(format!("{} {about}", reason.name()));
            return;
        }
        let (attack, make) = &ATTACKS[(run.chance.bits() % ATTACKS.len() as u64) as usize];
        if !is_possible(attack, &run.name) {
            return;
        }
        match make(&mut run) {
            None => {}
            Some(Ok(ms)) => {
                let of = if kind == 0 { "" } else { ", robot" };
                self.times.entry(format!("{attack}{of}")).or_default().push(ms);
            }
            Some(Err(what)) => {
                println!("{attack}: {what}, {about}");
                self.unfound.push(format!("{attack}: {what}, {about}"));
            }
        }
    }
}

#[test]
fn nothing_is_found_where_nothing_is_wrong_and_every_attack_is() {
    let first = number("SARRUS_SOAK_SEED", 1);
    let [motor, robot] = QUIET_S;
    let mean = motor + (robot - motor) / ROBOTS as f64;
    let n_runs = (number("SARRUS_SOAK_SECONDS", 1200) as f64 / mean).ceil() as u64;
    let end = Instant::now() + Duration::from_secs(60 * number("SARRUS_SOAK_MINUTES", 60));
    let drives = all_drives();
    let mut tally = Tally::default();
    let mut next = first;
    while next < first + n_runs && Instant::now() < end {
        tally.run(next, &drives);
        next += 1;
    }
    let Tally { seconds: [motors, robots], n_fast, false_alarms, unfound, mut times } = tally;
    println!(
        "{motors:.0} s of motors and {robots:.0} s of robots, seeds {first} to {}, {} false alarms, {n_fast} runs \
            ended by a true excess, {} attacks not found",
        next - 1,
        false_alarms.len(),
        unfound.len()
    );
    for (attack, times) in &mut times {
        times.sort_by(f64::total_cmp);
        let at = |part: f64| times[((times.len() - 1) as f64 * part) as usize];
        println!(
            "{attack:40} {:6} times, found after p50 {:.0} ms, p99 {:.0} ms, at most {:.0} ms",
            times.len(),
            at(0.5),
            at(0.99),
            at(1.0)
        );
    }
    assert!(false_alarms.is_empty() && unfound.is_empty(), "{false_alarms:#?} {unfound:#?}");
}
