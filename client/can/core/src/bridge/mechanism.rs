//! Where one closed mechanism stands. Its motors get and lose power together.

use sarrus_proto::actuators::{MechanismState, Reason};

/// How far a mechanism is with arming, and how commands reach it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No power.
    Off,
    /// Waits for what is missing.
    Waiting,
    /// Its motors take power, with the measured position and no gains.
    Starting,
    /// Follows commands, with gains that began to grow at this time `[ns]`.
    Following(u64),
    /// Commands are late.
    Damped,
}

/// A closed mechanism.
#[derive(Debug)]
pub(super) struct Mechanism {
    pub(super) state: MechanismState,
    pub(super) reason: Reason,
    pub(super) has_motors: bool,
    phase: Phase,
    /// When it was asked to arm `[ns]`.
    armed_ns: u64,
}

impl Mechanism {
    pub(super) fn new(has_motors: bool) -> Mechanism {
        Mechanism {
            state: MechanismState::Disabled,
            reason: Reason::None,
            has_motors,
            phase: Phase::Off,
            armed_ns: 0,
        }
    }

    /// Arms, or takes power.
    pub(super) fn is_live(&self) -> bool {
        matches!(self.state, MechanismState::Arming | MechanismState::Enabled)
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
        matches!(self.phase, Phase::Following(_))
    }

    pub(super) fn is_damped(&self) -> bool {
        self.phase == Phase::Damped
    }

    /// The worst comes last.
    pub(super) fn severity(&self) -> u32 {
        match self.state {
            MechanismState::Enabled => 0,
            MechanismState::Arming => 1,
            MechanismState::Disabled => 2,
            _ => 3,
        }
    }

    /// How far gains and efforts have grown, from 0 to 1; `None` without power.
    pub(super) fn ramp(&self, now_ns: u64, ramp_ns: u64) -> Option<f64> {
        match self.phase {
            Phase::Off | Phase::Waiting => None,
            Phase::Starting => Some(0.0),
            Phase::Damped => Some(1.0),
            Phase::Following(_) if ramp_ns == 0 => Some(1.0),
            Phase::Following(since) => {
                Some((now_ns.saturating_sub(since) as f64 / ramp_ns as f64).min(1.0))
            }
        }
    }

    /// An operator arms. What can never become ready by waiting refuses at once. Whether it begins
    /// to wait.
    pub(super) fn arm(&mut self, now_ns: u64, unready: Option<Reason>) -> bool {
        if self.state != MechanismState::Disabled || !self.has_motors {
            return false;
        }
        if let Some(reason) = unready {
            self.disable(reason);
            return false;
        }
        (self.state, self.reason, self.phase) =
            (MechanismState::Arming, Reason::None, Phase::Waiting);
        self.armed_ns = now_ns;
        true
    }

    /// Takes the power away, unless it is latched in a fault, which has none.
    pub(super) fn disable(&mut self, reason: Reason) {
        if self.state != MechanismState::Fault {
            (self.state, self.reason, self.phase) = (MechanismState::Disabled, reason, Phase::Off);
        }
    }

    /// As [`Mechanism::disable`] where there is power to take.
    pub(super) fn torque_off(&mut self, reason: Reason) {
        if self.is_powered() {
            self.disable(reason);
        }
    }

    /// Something failed; the first reason stays.
    pub(super) fn fail(&mut self, reason: Reason) {
        if self.is_live() {
            (self.state, self.reason, self.phase) = (MechanismState::Fault, reason, Phase::Off);
        }
    }

    pub(super) fn reset(&mut self) {
        if self.state == MechanismState::Fault {
            (self.state, self.reason) = (MechanismState::Disabled, Reason::None);
        }
    }

    /// Waits for what is missing, but not for ever.
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

    /// From power to following, to damping and back, and to no power. True where it is to begin
    /// anew from the measured position.
    pub(super) fn follow(
        &mut self,
        now_ns: u64,
        arming_ns: u64,
        all_on: bool,
        is_late: bool,
        is_lost: bool,
    ) -> bool {
        let before = self.phase;
        match self.phase {
            Phase::Off | Phase::Waiting => {}
            _ if is_lost => self.disable(Reason::CommandLost),
            Phase::Starting if all_on => {
                (self.state, self.phase) = (MechanismState::Enabled, Phase::Following(now_ns));
            }
            Phase::Starting if now_ns.saturating_sub(self.armed_ns) > arming_ns => {
                self.fail(Reason::ArmingTimeout)
            }
            Phase::Following(_) if is_late => self.phase = Phase::Damped,
            Phase::Damped if !is_late => self.phase = Phase::Following(now_ns),
            _ => {}
        }
        self.phase != before
    }
}
