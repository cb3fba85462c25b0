//! The power-up sequence, the same for every protocol: one action per cycle. The protocol defines
//! its frames and the motor's answers.
//!
//! ```text
//! Off ── ready ──→ Primed ── next cycle ──→ Asked ── the motor has power ──→ On
//!                    ↑                        │                              │
//!                    └── the request was lost ┘        the motor lost power ─┴→ Lost
//! ```
//!
//! `DriveCommand::Off` and `Reset` lead from everywhere to `Off`, and nothing else leads out of
//! `Lost`. `Primed` is skipped if a set-point itself requests power.

use super::fault;
use crate::drive::{DriveCommand, Power, Setpoint};
use crate::state::{state, state_of_enum};

/// The stage; each one waits for the motor's reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    /// No power.
    Off,
    /// A set-point was sent, so that the motor holds no old one.
    Primed,
    /// Power was requested; the number of replies since then, if counted.
    Asked(u8),
    /// The motor follows.
    On,
    /// The motor lost power without a command; it gets none until a command turns it off.
    Lost,
}

/// Action of a drive in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Action {
    /// Keep the motor off, write and read its settings; with the number of cycles since its last
    /// power-up attempt, from 1.
    Idle(u64),
    /// Frames that keep the motor off and clear a latched fault.
    Reset,
    /// A set-point before power.
    Prime(Setpoint),
    /// The request for power.
    Ask(Setpoint),
    /// It was asked for in an earlier cycle, and the motor has not confirmed it yet.
    Await(Setpoint),
    /// The set-point.
    Follow(Setpoint),
    /// Frames that keep a motor off that lost its power by itself.
    Withhold,
}

/// The way of one motor to power.
#[derive(Clone, Copy, Debug)]
pub(super) struct PowerUp {
    /// How far it is.
    pub(super) stage: Stage,
    /// The stage after `Off`.
    first: Stage,
    n_idle: u64,
}

impl PowerUp {
    /// For motors that take a set-point before they have power.
    pub(super) fn primed() -> PowerUp {
        PowerUp { stage: Stage::Off, first: Stage::Primed, n_idle: 0 }
    }

    /// For motors that a set-point gives power.
    pub(super) fn at_once() -> PowerUp {
        PowerUp { first: Stage::Asked(0), ..PowerUp::primed() }
    }

    /// Power was asked for, and the motor has not lost it.
    pub(super) fn is_asked(&self) -> bool {
        matches!(self.stage, Stage::Asked(_) | Stage::On)
    }

    /// The action for a command; a motor that is not ready stays off.
    pub(super) fn action(&mut self, command: DriveCommand, is_ready: bool) -> Action {
        let setpoint = match command {
            DriveCommand::On(setpoint) if self.stage != Stage::Off || is_ready => setpoint,
            DriveCommand::On(_) => return self.idle(),
            DriveCommand::Off => {
                if self.stage != Stage::Off {
                    self.forget();
                }
                return self.idle();
            }
            DriveCommand::Reset => {
                self.stage = Stage::Off;
                return Action::Reset;
            }
        };
        let (stage, action) = match self.stage {
            Stage::Off if self.first == Stage::Primed => (Stage::Primed, Action::Prime(setpoint)),
            Stage::Off | Stage::Primed => (Stage::Asked(0), Action::Ask(setpoint)),
            stage @ Stage::Asked(_) => (stage, Action::Await(setpoint)),
            Stage::On => (Stage::On, Action::Follow(setpoint)),
            Stage::Lost => (Stage::Lost, Action::Withhold),
        };
        self.stage = stage;
        action
    }

    /// The motor reports whether it has power. True where it just lost it.
    pub(super) fn report(&mut self, has_power: bool) -> bool {
        let before = self.stage;
        self.stage = match self.stage {
            Stage::Asked(_) if has_power => Stage::On,
            Stage::On if !has_power => Stage::Lost,
            stage => stage,
        };
        before == Stage::On && self.stage == Stage::Lost
    }

    /// A reply of a motor that does not report its power: after `enough` of them since it
    /// was asked to have it counts as having it.
    pub(super) fn count_reply(&mut self, enough: u8) {
        self.stage = match self.stage {
            Stage::Asked(replies) if replies + 1 < enough => Stage::Asked(replies + 1),
            Stage::Asked(_) => Stage::On,
            stage => stage,
        };
    }

    /// The request for power was lost: it is sent again.
    pub(super) fn ask_again(&mut self) {
        if matches!(self.stage, Stage::Asked(_)) {
            self.stage = Stage::Primed;
        }
    }

    /// The motor cannot have power any more.
    pub(super) fn lose(&mut self) {
        if self.stage != Stage::Off {
            self.stage = Stage::Lost;
        }
    }

    /// Back to the beginning.
    pub(super) fn forget(&mut self) {
        (self.stage, self.n_idle) = (Stage::Off, 0);
    }

    /// Power of a motor that does not report it; `is_known` once it has answered.
    pub(super) fn power(&self, is_known: bool) -> Power {
        match self.stage {
            _ if !is_known => Power::Unknown,
            Stage::On => Power::On,
            Stage::Primed | Stage::Asked(_) => Power::Starting,
            Stage::Off | Stage::Lost => Power::Off,
        }
    }

    /// Power of a motor that reports it, but for its way there.
    #[inline]
    pub(super) fn reported(&self, power: Power) -> Power {
        let is_starting = matches!(self.stage, Stage::Primed | Stage::Asked(_));
        if power == Power::Off && is_starting { Power::Starting } else { power }
    }

    /// [`fault::POWER_LOST`] where the motor lost its power by itself; else 0.
    #[inline]
    pub(super) fn fault(&self) -> u32 {
        fault::when(self.stage == Stage::Lost, fault::POWER_LOST)
    }

    fn idle(&mut self) -> Action {
        self.n_idle = self.n_idle.wrapping_add(1);
        Action::Idle(self.n_idle)
    }
}

state!(PowerUp { stage, n_idle; first });
state_of_enum!(Stage { Off, Primed, Asked(u8), On, Lost });

#[cfg(test)]
mod tests {
    use super::*;

    const ON: DriveCommand = DriveCommand::On(Setpoint {
        position: 0.0,
        velocity: 0.0,
        torque: 1.0,
        stiffness: 0.0,
        damping: 0.0,
    });

    #[test]
    fn power_is_asked_for_after_a_set_point_and_only_when_ready() {
        let mut power_up = PowerUp::primed();
        assert_eq!(power_up.action(ON, false), Action::Idle(1));
        assert!(matches!(power_up.action(ON, true), Action::Prime(_)));
        assert!(matches!(power_up.action(ON, false), Action::Ask(_)));
        assert!(matches!(power_up.action(ON, false), Action::Await(_)));
        assert!(!power_up.report(true));
        assert!(matches!(power_up.action(ON, false), Action::Follow(_)));
        let mut at_once = PowerUp::at_once();
        assert!(matches!(at_once.action(ON, true), Action::Ask(_)));
    }

    #[test]
    fn power_that_was_lost_comes_back_only_after_off() {
        for end in [DriveCommand::Off, DriveCommand::Reset] {
            let mut power_up = PowerUp::at_once();
            power_up.action(ON, true);
            power_up.report(true);
            assert!(power_up.report(false));
            assert!(!power_up.report(true));
            assert_eq!(power_up.action(ON, true), Action::Withhold);
            power_up.action(end, true);
            assert!(matches!(power_up.action(ON, true), Action::Ask(_)));
        }
    }

    #[test]
    fn a_motor_without_a_word_of_its_power_counts_replies() {
        let mut power_up = PowerUp::primed();
        power_up.count_reply(2);
        assert_eq!(power_up.stage, Stage::Off);
        power_up.action(ON, true);
        power_up.action(ON, true);
        power_up.count_reply(2);
        assert_eq!(power_up.stage, Stage::Asked(1));
        power_up.count_reply(2);
        assert_eq!(power_up.stage, Stage::On);
    }

    #[test]
    fn nothing_is_lost_that_was_never_asked_for() {
        let mut power_up = PowerUp::primed();
        power_up.lose();
        assert_eq!(power_up.stage, Stage::Off);
        power_up.action(ON, true);
        power_up.lose();
        assert_eq!(power_up.stage, Stage::Lost);
    }
}
