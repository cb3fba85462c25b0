//! The state of one closed mechanism. Its motors get and lose power together.

use sarrus_proto::actuators::{MechanismState, Reason};

use super::course::Course;
use super::motor::Motor;
use super::reaction::Reaction;
use crate::config::{MechanismStop, StopFunction};
use crate::state::{state, state_of_enum};

/// Part of a stop's time in which the velocity goes to zero along a ramp.
const RAMP: f64 = 1.0 / 3.0;

/// A lowered mechanism counts as still below this part of its greatest speed.
const STILL: f64 = 0.1;
/// Lowering ends after the mechanism is still for this time `[ns]`.
const STILL_NS: u64 = 300_000_000;

/// The way to a rest pose takes no longer `[ns]`.
const REST_NS: u64 = 20_000_000_000;

/// A return inside the limits that takes longer has failed `[ns]`.
const RETURN_NS: u64 = 60_000_000_000;

/// The stage of arming, and how commands reach the mechanism.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No power.
    Off,
    /// Waits for a missing condition.
    Waiting,
    /// Its motors power up, with the measured position and no gains.
    Starting,
    /// Follows commands, with gains that began to grow at this time `[ns]`.
    Following(u64),
    /// Commands are late; the gains began to grow at this time `[ns]`.
    Damped(u64),
    /// Is being stopped, since this time `[ns]` or from the next cycle on.
    Stopping(Option<u64>),
}

/// The state of all motors of a mechanism.
#[derive(Clone, Copy, Debug)]
pub(super) struct Members {
    /// All have power.
    pub(super) all_on: bool,
    /// None has.
    pub(super) all_off: bool,
    /// One is faster than before it was stopped.
    pub(super) runs_away: bool,
    /// One moves.
    pub(super) moves: bool,
    /// One is outside its limits.
    pub(super) is_outside: bool,
    /// All are where they may rest.
    pub(super) all_resting: bool,
}

/// A change of phase that the motors take part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    /// They follow from where they are.
    Begin,
    /// Commands became late.
    Late,
    /// Commands came back.
    Resume,
    /// They are stopped, by this reaction.
    Stop(Reaction),
}

/// A closed mechanism.
#[derive(Debug)]
pub(super) struct Mechanism {
    pub(super) state: MechanismState,
    pub(super) reason: Reason,
    /// Places of its motors.
    pub(super) motors: Vec<usize>,
    /// The motion of its motors in this cycle.
    pub(super) given: Option<Course>,
    phase: Phase,
    /// When it was asked to arm `[ns]`.
    armed_ns: u64,
    stop: MechanismStop,
    /// Where a stop ends.
    end: MechanismState,
    /// When it last moved while it was lowered `[ns]`.
    moved_ns: u64,
    /// An operator disarmed it while it was stopped, or by that.
    is_disarmed: bool,
    /// All of its motors have a place where they may rest without power.
    has_rest: bool,
    /// It has power to come back inside its limits, and follows no commands.
    returns: bool,
}

impl Mechanism {
    pub(super) fn new(motors: Vec<usize>, stop: MechanismStop, has_rest: bool) -> Mechanism {
        Mechanism {
            state: MechanismState::Disabled,
            reason: Reason::None,
            motors,
            given: None,
            phase: Phase::Off,
            armed_ns: 0,
            stop,
            end: MechanismState::Disabled,
            moved_ns: 0,
            is_disarmed: false,
            returns: false,
            has_rest,
        }
    }

    /// Its motors among those of the robot.
    pub(super) fn motors<'a>(&'a self, all: &'a [Motor]) -> impl Iterator<Item = &'a Motor> {
        self.motors.iter().filter_map(|place| all.get(*place))
    }

    /// Does something with each of its motors.
    pub(super) fn each_motor(&self, all: &mut [Motor], mut what: impl FnMut(&mut Motor)) {
        for place in &self.motors {
            if let Some(motor) = all.get_mut(*place) {
                what(motor);
            }
        }
    }

    /// Arms, or has power.
    pub(super) fn is_live(&self) -> bool {
        self.phase != Phase::Off
    }

    /// Its motors have power, or are taking it.
    pub(super) fn is_powered(&self) -> bool {
        !matches!(self.phase, Phase::Off | Phase::Waiting)
    }

    pub(super) fn is_waiting(&self) -> bool {
        self.phase == Phase::Waiting
    }

    /// Follows commands of now.
    pub(super) fn is_following(&self) -> bool {
        matches!(self.phase, Phase::Following(_)) && !self.returns
    }

    pub(super) fn returns(&self) -> bool {
        self.returns
    }

    pub(super) fn is_stopping(&self) -> bool {
        matches!(self.phase, Phase::Stopping(_))
    }

    /// Its motors must have power.
    pub(super) fn needs_power(&self) -> bool {
        self.follows() || self.is_stopping() && self.stop.function != StopFunction::QuickStop
    }

    /// The speed below which its motors stand still `[rad/s, m/s]`.
    pub(super) fn still(&self) -> f64 {
        STILL * self.stop.lower_velocity
    }

    /// The worst comes last. A stopping mechanism still has power, which `disabled` would deny.
    pub(super) fn severity(&self) -> u32 {
        match self.state {
            MechanismState::Enabled => 0,
            MechanismState::Arming => 1,
            MechanismState::Disabled => 2,
            MechanismState::Stopping => 3,
            _ => 4,
        }
    }

    /// The motion of its motors; `None` without power.
    pub(super) fn course(&self, now_ns: u64, ramp_ns: u64) -> Option<Course> {
        let passed = |since: u64| now_ns.saturating_sub(since);
        match self.phase {
            Phase::Off | Phase::Waiting => None,
            Phase::Starting => Some(Course::Follow(0.0)),
            Phase::Damped(_) => Some(Course::Damp),
            Phase::Following(_) if self.returns => Some(Course::Return),
            Phase::Following(since) if passed(since) >= ramp_ns => Some(Course::Follow(1.0)),
            Phase::Following(since) => Some(Course::Follow(passed(since) as f64 / ramp_ns as f64)),
            Phase::Stopping(_) if self.stop.function == StopFunction::QuickStop => {
                Some(Course::QuickStop)
            }
            Phase::Stopping(Some(since)) if self.rests(now_ns, since) => Some(Course::Rest),
            Phase::Stopping(Some(since)) if self.lowers(now_ns, since) => {
                Some(Course::Lower(self.stop.lower_velocity))
            }
            Phase::Stopping(since) => {
                let ramp = match Reaction::to(self.reason) {
                    Reaction::Ramp => RAMP * self.stop.stop_ns as f64,
                    _ => 0.0,
                };
                let passed = since.map_or(0.0, |since| passed(since) as f64);
                let speed = if passed < ramp { 1.0 - passed / ramp } else { 0.0 };
                Some(Course::Brake { speed, passed: passed / self.stop.stop_ns as f64 })
            }
        }
    }

    /// An operator arms. A motor that no waiting makes ready refuses at once. Returns whether it
    /// begins to wait.
    pub(super) fn arm(&mut self, now_ns: u64, unready: Option<Reason>) -> bool {
        if self.state != MechanismState::Disabled || self.motors.is_empty() {
            return false;
        }
        if let Some(reason) = unready {
            self.disable(reason);
            return false;
        }
        (self.state, self.reason, self.phase) =
            (MechanismState::Arming, Reason::None, Phase::Waiting);
        (self.armed_ns, self.returns) = (now_ns, false);
        true
    }

    /// An operator brings it back inside its limits.
    pub(super) fn come_back(&mut self, now_ns: u64, unready: Option<Reason>) -> bool {
        self.returns = self.arm(now_ns, unready);
        self.returns
    }

    /// Takes the power away, unless it is latched in a fault, which has none.
    pub(super) fn disable(&mut self, reason: Reason) {
        if self.state != MechanismState::Fault {
            (self.state, self.reason, self.phase) = (MechanismState::Disabled, reason, Phase::Off);
        }
    }

    /// As [`Mechanism::disable`] where there is power to take.
    pub(super) fn torque_off(&mut self, reason: Reason) {
        if self.is_stopping() {
            self.finish();
        } else if self.is_powered() {
            self.disable(reason);
        }
    }

    /// An operator disarms: a mechanism that follows commands is stopped, and loses its power at
    /// once when it is disarmed a second time meanwhile.
    pub(super) fn disarm(&mut self) {
        match self.phase {
            Phase::Following(_) | Phase::Damped(_) => {
                self.stop(Reason::Disarmed, MechanismState::Disabled);
            }
            Phase::Stopping(_) if self.is_disarmed => self.finish(),
            Phase::Stopping(_) => self.is_disarmed = true,
            Phase::Off | Phase::Waiting | Phase::Starting => self.disable(Reason::Disarmed),
        }
    }

    /// Something failed: a stop where the motors are able to, which a stop under way is already,
    /// or else no power. The first reason for a fault stays.
    pub(super) fn fail(&mut self, reason: Reason) {
        let is_able = Reaction::to(reason) != Reaction::TorqueOff;
        if is_able && self.follows() {
            self.stop(reason, MechanismState::Fault);
        } else if self.is_live() && !(is_able && self.is_stopping()) {
            self.fail_now(reason);
        }
    }

    fn fail_now(&mut self, reason: Reason) {
        let is_first = !(self.is_stopping() && self.end == MechanismState::Fault);
        self.latch(if is_first { reason } else { self.reason });
    }

    /// Is in fault, without power.
    pub(super) fn latch(&mut self, reason: Reason) {
        (self.state, self.reason, self.phase) = (MechanismState::Fault, reason, Phase::Off);
    }

    /// A stop by lowering goes down from when it stood still.
    fn lowers(&self, now_ns: u64, since: u64) -> bool {
        self.stop.function == StopFunction::Lower
            && now_ns.saturating_sub(since) >= self.stop.stop_ns
    }

    /// A hot mechanism goes to its rest pose, if it has one, from when it stood still.
    fn rests(&self, now_ns: u64, since: u64) -> bool {
        self.has_rest
            && self.reason == Reason::OverTemperature
            && self.stop.function != StopFunction::QuickStop
            && now_ns.saturating_sub(since) >= self.stop.stop_ns
    }

    fn follows(&self) -> bool {
        matches!(self.phase, Phase::Following(_) | Phase::Damped(_))
    }

    fn stop(&mut self, reason: Reason, end: MechanismState) {
        (self.state, self.reason, self.end) = (MechanismState::Stopping, reason, end);
        self.phase = Phase::Stopping(None);
        self.is_disarmed = reason == Reason::Disarmed;
        if self.stop.function == StopFunction::Sto {
            self.finish();
        }
    }

    /// A stop ends without power.
    fn finish(&mut self) {
        (self.state, self.phase) = (self.end, Phase::Off);
    }

    pub(super) fn reset(&mut self) {
        if self.state == MechanismState::Fault {
            (self.state, self.reason) = (MechanismState::Disabled, Reason::None);
        }
    }

    /// Waits for a missing condition, up to `arming_ns`.
    pub(super) fn wait(&mut self, now_ns: u64, arming_ns: u64, missing: Option<Reason>) {
        match (self.phase, missing) {
            (Phase::Waiting, None) => {
                (self.reason, self.phase) = (Reason::None, Phase::Starting);
                self.armed_ns = now_ns;
            }
            (Phase::Waiting, Some(reason)) if now_ns.saturating_sub(self.armed_ns) > arming_ns => {
                self.disable(reason)
            }
            (Phase::Waiting, Some(reason)) => self.reason = reason,
            _ => {}
        }
    }

    /// From power to following, to damping and back, to a stop and to no power; returns the change
    /// that its motors take part in.
    pub(super) fn follow(
        &mut self,
        now_ns: u64,
        arming_ns: u64,
        members: Members,
        is_late: bool,
        is_lost: bool,
    ) -> Option<Change> {
        // the way back inside the limits needs no commands
        let is_late = is_late && !self.returns;
        let is_lost = is_lost && !self.returns;
        match self.phase {
            Phase::Following(since) if self.returns => {
                if !members.is_outside {
                    self.stop(Reason::Disarmed, MechanismState::Disabled);
                } else if now_ns.saturating_sub(since) > RETURN_NS {
                    self.stop(Reason::OutsideLimits, MechanismState::Disabled);
                }
            }
            Phase::Following(_) | Phase::Damped(_) if is_lost => {
                self.stop(Reason::CommandLost, MechanismState::Disabled);
            }
            Phase::Starting if is_lost => self.disable(Reason::CommandLost),
            // the brake accelerates: a sign is wrong, or the load is too much
            Phase::Stopping(Some(_)) if members.runs_away => self.fail_now(Reason::VelocityLimit),
            _ => {}
        }
        let (phase, change) = match self.phase {
            // motors that are on before they were asked are so from an earlier time
            Phase::Starting if members.all_on && now_ns > self.armed_ns => {
                (self.state, self.reason) = match self.returns {
                    true => (MechanismState::Arming, Reason::OutsideLimits),
                    false => (MechanismState::Enabled, self.reason),
                };
                (Phase::Following(now_ns), Change::Begin)
            }
            Phase::Starting if now_ns.saturating_sub(self.armed_ns) > arming_ns => {
                self.fail(Reason::ArmingTimeout);
                return None;
            }
            Phase::Following(since) if is_late => (Phase::Damped(since), Change::Late),
            Phase::Damped(since) if !is_late => (Phase::Following(since), Change::Resume),
            Phase::Stopping(None) => {
                (Phase::Stopping(Some(now_ns)), Change::Stop(Reaction::to(self.reason)))
            }
            Phase::Stopping(Some(since)) => {
                if members.moves || !self.lowers(now_ns, since) {
                    self.moved_ns = now_ns;
                }
                let MechanismStop { function, stop_ns, hold_ns, .. } = self.stop;
                let rests = self.rests(now_ns, since);
                let hold_ns = if rests { hold_ns.max(REST_NS) } else { hold_ns };
                if now_ns.saturating_sub(since) >= stop_ns + hold_ns
                    || rests && members.all_resting
                    || now_ns.saturating_sub(self.moved_ns) > STILL_NS
                    || function == StopFunction::QuickStop && members.all_off
                {
                    self.finish();
                }
                return None;
            }
            _ => return None,
        };
        self.phase = phase;
        Some(change)
    }
}

state_of_enum!(Phase {
    Off, Waiting, Starting, Following(u64), Damped(u64), Stopping(Option<u64>)
});
state!(Mechanism {
    state, reason, phase, armed_ns, end, moved_ns, is_disarmed, returns;
    motors, given, stop, has_rest
});
