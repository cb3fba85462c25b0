//! The controller of a commissioning: it holds all actuators and moves one after the other.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use sarrus_can_core::config::{Configuration, Limits, MotorConfig};
use sarrus_client::Controller;
use sarrus_client::actuators::{
    ActuatorCommand, ActuatorState, MechanismState, Operation, Reason, flag,
};

use super::model::Model;
use crate::top::of;

/// Stiffness of holding for its damping, as in a stop `[1/s]`.
const STIFFNESS: f64 = 10.0;
/// Greatest speed of a trial, as part of the limit.
const SPEED: f64 = 0.1;
/// Part of a way at both ends in which efforts do not count.
const END: f64 = 0.2;
/// Time for the first states, and for the robot to come to rest `[s]`.
const FIRST: f64 = 3.0;
const REST: f64 = 0.5;

/// A motor to be tried.
pub(super) struct Motor {
    pub(super) name: String,
    pub(super) limits: Limits,
    actuator: usize,
    damping: f64,
    /// Time in which its gains grow, and to get power `[s]`.
    ramp: f64,
    arming: f64,
}

impl Motor {
    pub(super) fn new(motor: &MotorConfig, of: &Configuration) -> Motor {
        Motor {
            name: of.actuators.get(motor.actuator).cloned().unwrap_or_default(),
            limits: motor.limits,
            actuator: motor.actuator,
            damping: motor.stop_damping(),
            ramp: of.ramp_ns as f64 * 1e-9,
            arming: of.timeouts.arming_ns as f64 * 1e-9,
        }
    }
}

/// The outcome of one motor.
#[derive(Clone, Debug)]
pub(super) struct Trial {
    /// The way as part of the range, the way, and its measured length `[rad, m]`.
    pub(super) part: f64,
    pub(super) way: f64,
    pub(super) moved: f64,
    /// Means over both ways of the reported effort and of the model's `[N m, N]`.
    pub(super) effort: f64,
    pub(super) model: f64,
    /// There was a pose all the time.
    pub(super) has_pose: bool,
    /// The largest motion of each motor `[rad, m]`.
    pub(super) others: Vec<f64>,
}

/// A running bridge and its commands.
pub(super) struct Session {
    controller: Controller,
    command: ActuatorCommand,
    state: ActuatorState,
    period: Duration,
    next: Instant,
    places: Vec<usize>,
    stop: Arc<AtomicBool>,
}

impl Session {
    pub(super) fn connect(
        name: &str,
        fingerprint: u64,
        rate_hz: f64,
        motors: &[Motor],
        stop: Arc<AtomicBool>,
    ) -> Result<Session, super::Error> {
        Ok(Session {
            controller: Controller::connect(name, fingerprint)?,
            command: ActuatorCommand::default(),
            state: ActuatorState::default(),
            period: Duration::from_secs_f64(1.0 / rate_hz),
            next: Instant::now(),
            places: motors.iter().map(|motor| motor.actuator).collect(),
            stop,
        })
    }

    /// The trial of each motor, or why there was none.
    pub(super) fn all(
        &mut self,
        motors: &[Motor],
        model: &mut Model,
        part: f64,
        seconds: f64,
    ) -> Vec<Result<Trial, String>> {
        if let Err(why) = self.hold(motors, model) {
            return why.into_iter().map(Err).collect();
        }
        let mut trials: Vec<Result<Trial, String>> = Vec::new();
        for (place, motor) in motors.iter().enumerate() {
            let trial = match trials.iter().find_map(|trial| trial.as_ref().err()) {
                Some(_) => Err("not tried".to_owned()),
                None => self.move_one(place, motor, model, part, seconds),
            };
            trials.push(trial);
        }
        trials
    }

    /// Takes the power away, by a stop.
    pub(super) fn disarm(&mut self) {
        let begin = Instant::now();
        if self.is_live() {
            self.controller.operate(Operation::Disarm);
        }
        while begin.elapsed().as_secs_f64() < FIRST && self.is_live() {
            self.cycle();
        }
    }

    fn is_live(&self) -> bool {
        self.places.iter().any(|place| {
            let state = of(&self.state.states, *place);
            [MechanismState::Arming, MechanismState::Enabled, MechanismState::Stopping]
                .iter()
                .any(|live| *live as u32 == state)
        })
    }

    /// One command, and the newest state.
    fn cycle(&mut self) {
        self.controller.send(&mut self.command);
        self.next = (self.next + self.period).max(Instant::now() - self.period);
        thread::sleep(self.next.saturating_duration_since(Instant::now()));
        if let Some(state) = self.controller.state() {
            self.state = state;
            self.command.n_u = state.n_u;
        }
    }

    /// Why an actuator does not follow; `None` where it does.
    fn trouble(&self, actuator: usize) -> Option<String> {
        if self.stop.load(Ordering::Relaxed) {
            return Some("ended by a signal".to_owned());
        }
        let state = of(&self.state.states, actuator);
        let words = || {
            let reason = Reason::name_of(of(&self.state.reasons, actuator));
            format!("{}: {reason}", MechanismState::name_of(state))
        };
        (state != MechanismState::Enabled as u32).then(words)
    }

    /// Gives power and holds all actuators where they are; or the trouble of each motor.
    fn hold(&mut self, motors: &[Motor], model: &mut Model) -> Result<(), Vec<String>> {
        // the first measurements
        let begin = Instant::now();
        let arming = motors.iter().map(|motor| motor.arming).fold(FIRST, f64::max);
        let is_heard = |state: &ActuatorState, place: &usize| {
            state.n_u > 0
                && of(&state.position, *place).is_finite()
                && of(&state.flags, *place) & flag::STALE == 0
        };
        while begin.elapsed().as_secs_f64() < arming
            && !self.places.iter().all(|place| is_heard(&self.state, place))
        {
            self.cycle();
        }
        let answer = |place: &usize| match is_heard(&self.state, place) {
            true => "answers; another motor does not".to_owned(),
            false => "no answer: its supply, its identifiers or its wires".to_owned(),
        };
        if !self.places.iter().all(|place| is_heard(&self.state, place)) {
            return Err(self.places.iter().map(answer).collect());
        }

        // where they are, by the effort that the model needs there
        self.command.position = self.state.position;
        self.command.position.iter_mut().for_each(|position| {
            *position = if position.is_finite() { *position } else { 0.0 };
        });
        for motor in motors {
            put(&mut self.command.damping, motor.actuator, motor.damping);
            put(&mut self.command.stiffness, motor.actuator, STIFFNESS * motor.damping);
        }
        if !self.balance(model) {
            let why = "the robot has no pose of all measured positions: an offset or a sign";
            return Err(vec![why.to_owned(); motors.len()]);
        }

        let begin = Instant::now();
        let mut asked = 0;
        while begin.elapsed().as_secs_f64() < arming + FIRST
            && self.places.iter().any(|place| self.trouble(*place).is_some())
        {
            let is_arming = self.state.state == MechanismState::Arming as u32;
            if self.state.stamp_ns > asked && !is_arming && asked == 0 {
                asked = self.controller.operate(Operation::Arm);
            }
            self.cycle();
        }
        let troubles: Vec<Option<String>> =
            self.places.iter().map(|place| self.trouble(*place)).collect();
        if troubles.iter().any(Option::is_some) {
            let words = |trouble: Option<String>| trouble.unwrap_or_else(|| "not tried".to_owned());
            return Err(troubles.into_iter().map(words).collect());
        }
        let ramp = motors.iter().map(|motor| motor.ramp).fold(0.0, f64::max);
        self.wait(ramp + REST);
        Ok(())
    }

    /// The model's efforts at the commanded positions; false where there is no such pose.
    fn balance(&mut self, model: &mut Model) -> bool {
        let n_u = self.command.n_u as usize;
        let Session { command: ActuatorCommand { position, effort, .. }, .. } = self;
        let (Some(u), Some(efforts)) = (position.get(..n_u), effort.get_mut(..n_u)) else {
            return false;
        };
        let has_pose = model.hold(u, efforts);
        for effort in efforts.iter_mut().filter(|effort| !effort.is_finite()) {
            *effort = 0.0;
        }
        has_pose
    }

    fn wait(&mut self, seconds: f64) {
        let begin = Instant::now();
        while begin.elapsed().as_secs_f64() < seconds {
            self.cycle();
        }
    }

    fn move_one(
        &mut self,
        place: usize,
        motor: &Motor,
        model: &mut Model,
        part: f64,
        seconds: f64,
    ) -> Result<Trial, String> {
        let Motor { actuator, limits, .. } = *motor;
        let n_u = self.command.n_u as usize;
        let start = of(&self.command.position, actuator);
        let before = self.state;
        let away = if limits.upper - start >= start - limits.lower { 1.0 } else { -1.0 };
        let way = away * part * (limits.upper - limits.lower);
        let seconds = seconds.max(way.abs() / (SPEED * limits.velocity));
        let mut has_pose = true;
        let mut others = vec![0.0_f64; self.places.len()];
        // of the reported efforts and of the model's
        let mut sums = [0.0; 2];
        let mut n = 0.0;
        let mut efforts = vec![0.0; n_u];
        let mut ends = [0.0; 2];
        for (end, [from, to]) in ends.iter_mut().zip([[0.0, 1.0], [1.0, 0.0]]) {
            let begin = Instant::now();
            let mut part_of_time = 0.0;
            while part_of_time < 1.0 {
                part_of_time = (begin.elapsed().as_secs_f64() / seconds).min(1.0);
                let target = start + way * (from + (to - from) * part_of_time);
                let speed = if part_of_time < 1.0 { (to - from) * way / seconds } else { 0.0 };
                put(&mut self.command.position, actuator, target);
                put(&mut self.command.velocity, actuator, speed);
                has_pose &= self.balance(model);
                self.cycle();
                if let Some(trouble) = self.trouble(actuator) {
                    return Err(trouble);
                }
                let counts = (END..=1.0 - END).contains(&part_of_time);
                let u = self.state.position.get(..n_u).unwrap_or_default();
                if counts && model.hold(u, &mut efforts) {
                    sums[0] += of(&self.state.effort, actuator);
                    sums[1] += of(&efforts, actuator);
                    n += 1.0;
                } else if counts {
                    has_pose = false;
                }
                for (moved, other) in others.iter_mut().zip(&self.places) {
                    let by = of(&self.state.position, *other) - of(&before.position, *other);
                    *moved = moved.max(by.abs());
                }
            }
            self.wait(REST);
            *end = of(&self.state.position, actuator);
        }
        let [effort, model] = sums.map(|sum| sum / n);
        put(&mut others, place, 0.0);
        Ok(Trial { part, way, moved: ends[0] - ends[1], effort, model, has_pose, others })
    }
}

fn put(numbers: &mut [f64], place: usize, number: f64) {
    if let Some(slot) = numbers.get_mut(place) {
        *slot = number;
    }
}
