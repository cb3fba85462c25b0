//! The monitors in each cycle: their input, and the faults that follow from their findings.

use sarrus_proto::actuators::{Reason, flag};

use super::{Monitors, Seen, effort, effort_of, jump, noise, velocity};
use crate::bridge::motor::Motor;
use crate::bridge::rest::Rest;
use crate::bridge::whereabouts::Allowed;
use crate::bridge::{Bridge, BusState};
use crate::drive::Pairing;
use crate::frame::Frame;
use crate::mapping::ActuatorSetpoint;

impl Bridge {
    /// Fails motors with doubted measurements; a motor outside its limits does not arm.
    pub(in crate::bridge) fn look_at_measurements(&mut self, now_ns: u64) {
        let period = self.configuration.period_ns() as f64 * 1e-9;
        let feedback_ns = self.configuration.feedback_ns();
        let clocks = velocity::clocks(period, self.uneven_ns as f64 * 1e-9);
        let lag = effort::lag(period, clocks);
        for i in 0..self.motors.len() {
            let Some(motor) = self.motors.get_mut(i) else { continue };
            let number = motor.mechanism;
            let Some(mechanism) = self.mechanisms.get_mut(number) else { continue };
            if !mechanism.is_powered() {
                motor.unwatched(feedback_ns);
                let is_elsewhere = motor.whereabouts.is_elsewhere;
                if mechanism.is_waiting()
                    && motor.is_beyond()
                    && !mechanism.returns()
                    && !is_elsewhere
                {
                    mechanism.disable(Reason::OutsideLimits);
                }
                continue;
            }
            let bus = self.buses.get(motor.config.bus).map_or(BusState::Active, |bus| bus.state);
            let found = motor
                .doubt([period, clocks, lag], mechanism.is_following())
                .or_else(|| motor.monitors.check_bus(now_ns, bus));
            if let Some(reason) = found {
                self.fail_mechanism(number, reason);
            }
        }
    }
}

impl Motor {
    /// The reason to doubt the newest measurement, if it is new. The rules see the newest one of
    /// each cycle.
    fn doubt(&mut self, [period, clocks, lag]: [f64; 3], is_following: bool) -> Option<Reason> {
        if self.measured_ns == self.seen_ns {
            return None;
        }
        let dwell = self.dwell();
        let since = self.seen_ns.zip(self.measured_ns);
        let Monitors { bounds, steps, rules, punctual, .. } = &mut self.monitors;
        let found = since.and_then(|(before, measured)| {
            rules.check(&Seen {
                bounds,
                steps,
                period,
                clocks,
                lag,
                measured: &self.measured,
                before: &self.before,
                elapsed: measured.saturating_sub(before) as f64 * 1e-9,
                late: [self.late_before, punctual.late],
                asked: &self.asked,
                efforts: self.asked.map(|asked| effort_of(&asked, &self.measured)),
                stiffness: self.stiffness,
                limits: &self.config.limits,
                braking: &self.braking,
                free: &self.free,
                dwell,
                mode: self.config.common.mode,
                ripple: self.ripple,
                is_following,
            })
        });
        if let (Some(Reason::FeedbackJump), Some(before_ns)) = (found, self.seen_ns) {
            self.whereabouts.jumped(before_ns, &self.before);
        }
        (self.seen_ns, self.before) = (self.measured_ns, self.measured);
        self.late_before = self.monitors.punctual.late;
        found
    }

    /// Without power only its rest and its place are watched, and with power all rules start again.
    fn unwatched(&mut self, feedback_ns: u64) {
        if let Some(seen_ns) = self.seen_ns.take() {
            self.monitors.begin();
            self.rest = Rest::default();
            self.whereabouts.leave(seen_ns, &self.before);
            (self.asked, self.stiffness) = ([ActuatorSetpoint::default(); 2], 0.0);
        }
        if let Some(measured_ns) = self.measured_ns.filter(|last| *last != self.rest.until_ns) {
            let still = self.monitors.still(&self.config.limits);
            self.rest.see(measured_ns, &self.measured, still);
            let is_told = self.measured.velocity.is_finite();
            let speed = jump::unexplained(&self.monitors.bounds, &self.config.limits, is_told);
            let margin = self.monitors.margin(&self.config.limits);
            let allowed = Allowed { margin, speed, feedback_ns };
            self.whereabouts.find(measured_ns, &self.measured, allowed);
            self.learn();
        }
        self.lasting &= !flag::POSITION_CHANGED;
        if self.whereabouts.is_elsewhere {
            self.lasting |= flag::POSITION_CHANGED;
        }
    }

    /// Learns at rest whether the encoder is noisy.
    fn learn(&mut self) {
        if !self.rest.is_long_enough() {
            return self.noise.begin();
        }
        self.noise.learn(self.measured.position, self.monitors.steps.position);
        let is_blind = self.config.monitors.frozen == f64::INFINITY
            || !(self.noise.is_noisy() || self.config.dither > 0.0 || self.config.drive.counts());
        self.lasting = match is_blind {
            true => self.lasting | flag::FROZEN_UNDETECTABLE,
            false => self.lasting & !flag::FROZEN_UNDETECTABLE,
        };
    }

    /// How long its position may stay one code.
    fn dwell(&self) -> f64 {
        if self.noise.is_noisy() {
            noise::NOISY.max(noise::REPORTS * self.monitors.punctual.mean)
        } else if self.is_dithered {
            noise::DITHERED
        } else {
            f64::INFINITY
        }
    }

    /// Whether it is too far outside its limits to be armed.
    pub(in crate::bridge) fn is_beyond(&self) -> bool {
        self.monitors.is_beyond(&self.config.limits, self.measured.position)
    }

    /// Whether it is outside its limits at all.
    pub(in crate::bridge) fn is_outside(&self) -> bool {
        let position = self.measured.position;
        let limits = self.config.limits;
        position > limits.upper || position < limits.lower
    }

    /// Whether it goes without a request in this cycle; a bus that waits for one frame of all
    /// pauses as a whole.
    pub(in crate::bridge) fn pauses(
        &mut self,
        now_ns: u64,
        has_power: bool,
        bus_has_power: bool,
    ) -> bool {
        let was_paired = self.is_paired;
        self.is_paired = self.config.drive.pairing() == Pairing::Paired;
        if self.is_paired && !was_paired {
            self.monitors.punctual.pause();
        }
        if !self.is_paired || bus_has_power && self.is_synchronous {
            return false;
        }
        let pauses = self.monitors.age.pauses(now_ns, has_power, &mut self.monitors.answers);
        if pauses && !has_power {
            self.monitors.punctual.pause();
        }
        pauses
    }

    /// It stops by itself: its effort is unknown.
    pub(in crate::bridge) fn is_asked_nothing(&mut self) {
        self.asked = [ActuatorSetpoint { effort: f64::NAN, ..ActuatorSetpoint::default() }; 2];
    }

    /// The heartbeats among frames, which nothing answers.
    pub(in crate::bridge) fn heartbeats(&self, frames: Option<&[Frame]>) -> usize {
        let heartbeat = self.config.drive.heartbeat().map(|(frame, _)| frame);
        let is_one = |frame: &&Frame| Some(**frame) == heartbeat;
        frames.map_or(0, |frames| frames.iter().filter(is_one).count())
    }

    /// It was asked for a measurement, with so many frames.
    pub(in crate::bridge) fn ask(&mut self, n_frames: usize) {
        if self.is_paired {
            let Monitors { answers, age, .. } = &mut self.monitors;
            answers.ask(n_frames, self.is_synchronous && !age.explains(answers.open));
        } else {
            self.monitors.answers.forgive();
        }
    }
}
