//! The state machine of CiA 402: control words, 6040, and states in the status word, 6041.

use crate::state::state_of_enum;

pub(super) const DISABLE_VOLTAGE: u16 = 0x00;
pub(super) const QUICK_STOP: u16 = 0x02;
pub(super) const SHUTDOWN: u16 = 0x06;
pub(super) const SWITCH_ON: u16 = 0x07;
pub(super) const ENABLE: u16 = 0x0F;
pub(super) const FORGET_FAULT: u16 = 0x80;

/// States of the status word.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum State {
    #[default]
    NotReady,
    Disabled,
    Ready,
    SwitchedOn,
    Enabled,
    QuickStop,
    Faulty,
}

impl State {
    pub(super) const fn of(status: u16) -> State {
        match (status & 0x4F, status & 0x6F) {
            (0x0F | 0x08, _) => State::Faulty,
            (0x40, _) => State::Disabled,
            (_, 0x21) => State::Ready,
            (_, 0x23) => State::SwitchedOn,
            (_, 0x27) => State::Enabled,
            (_, 0x07) => State::QuickStop,
            _ => State::NotReady,
        }
    }
}

state_of_enum!(State { NotReady, Disabled, Ready, SwitchedOn, Enabled, QuickStop, Faulty });
