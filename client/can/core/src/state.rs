//! The whole state of a bridge as numbers, for logs that begin anywhere.
//!
//! One function of each type both writes its state and reads it, so that the order is the same. The
//! macro [`state`] makes it from the fields: those that change, then those that the configuration
//! fixes, so that no field can be left out. Nothing here allocates.

/// Numbers of a state that are written, or read.
#[derive(Debug)]
pub struct Words<'a>(Access<'a>);

#[derive(Debug)]
enum Access<'a> {
    /// With whether there was no room.
    Write(&'a mut Vec<u64>, bool),
    /// With whether there were too few.
    Read(core::slice::Iter<'a, u64>, bool),
}

impl<'a> Words<'a> {
    pub(crate) fn write(into: &'a mut Vec<u64>) -> Words<'a> {
        into.clear();
        Words(Access::Write(into, false))
    }

    pub(crate) fn read(from: &'a [u64]) -> Words<'a> {
        Words(Access::Read(from.iter(), false))
    }

    /// Writes a number, or reads it.
    pub fn word(&mut self, word: &mut u64) {
        match &mut self.0 {
            Access::Write(into, _) if into.len() < into.capacity() => into.push(*word),
            Access::Read(from, is_short) => match from.next() {
                Some(next) => *word = *next,
                None => *is_short = true,
            },
            Access::Write(_, is_full) => *is_full = true,
        }
    }

    /// Whether every number found room, or every one was there and none is left.
    pub(crate) fn are_complete(&self) -> bool {
        match &self.0 {
            Access::Write(_, is_full) => !is_full,
            Access::Read(from, is_short) => !is_short && from.len() == 0,
        }
    }
}

/// A state that can be written and read.
pub trait State {
    /// Writes it, or reads it.
    fn carry(&mut self, words: &mut Words<'_>);
}

macro_rules! whole {
    ($($type:ty),*) => {$(
        impl State for $type {
            fn carry(&mut self, words: &mut Words<'_>) {
                let mut word = *self as u64;
                words.word(&mut word);
                *self = word as $type;
            }
        }
    )*};
}
whole!(u8, u16, u32, u64, usize, i64);

impl State for bool {
    fn carry(&mut self, words: &mut Words<'_>) {
        let mut word = u64::from(*self);
        words.word(&mut word);
        *self = word != 0;
    }
}

impl State for f64 {
    fn carry(&mut self, words: &mut Words<'_>) {
        let mut word = self.to_bits();
        words.word(&mut word);
        *self = f64::from_bits(word);
    }
}

impl<T: State + Default> State for Option<T> {
    fn carry(&mut self, words: &mut Words<'_>) {
        let mut is_some = self.is_some();
        is_some.carry(words);
        if is_some {
            self.get_or_insert_default().carry(words);
        } else {
            *self = None;
        }
    }
}

impl<T: State, const N: usize> State for [T; N] {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.iter_mut().for_each(|one| one.carry(words));
    }
}

/// As many as the configuration has.
impl<T: State> State for Vec<T> {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.iter_mut().for_each(|one| one.carry(words));
    }
}

impl<A: State, B: State> State for (A, B) {
    fn carry(&mut self, words: &mut Words<'_>) {
        self.0.carry(words);
        self.1.carry(words);
    }
}

/// The state of a struct: the fields that change; the others.
macro_rules! state {
    ($type:ty { $($changing:ident),* $(; $($fixed:ident),*)? }) => {
        impl $crate::state::State for $type {
            fn carry(&mut self, words: &mut $crate::state::Words<'_>) {
                let Self { $($changing,)* $($($fixed: _,)*)? } = self;
                $($crate::state::State::carry($changing, words);)*
            }
        }
    };
}

/// The state of an enum whose variants have at most one number.
macro_rules! state_of_enum {
    (@any $payload:ty) => { _ };
    (@read $self:ident, $words:ident, $variant:ident) => { *$self = Self::$variant };
    (@read $self:ident, $words:ident, $variant:ident($payload:ty)) => {{
        let mut payload = match $self {
            Self::$variant(payload) => *payload,
            _ => <$payload>::default(),
        };
        $crate::state::State::carry(&mut payload, $words);
        *$self = Self::$variant(payload);
    }};
    ($type:ty { $($variant:ident $(($payload:ty))?),* }) => {
        impl $crate::state::State for $type {
            fn carry(&mut self, words: &mut $crate::state::Words<'_>) {
                let names = [$(stringify!($variant)),*];
                let name = match self {
                    $(Self::$variant $(($crate::state::state_of_enum!(@any $payload)))? => {
                        stringify!($variant)
                    })*
                };
                let mut place = names.iter().position(|known| *known == name).unwrap_or(0);
                $crate::state::State::carry(&mut place, words);
                match names.get(place).copied().unwrap_or(name) {
                    $(name if name == stringify!($variant) => {
                        $crate::state::state_of_enum!(@read self, words, $variant $(($payload))?)
                    })*
                    _ => {}
                }
            }
        }
    };
}

pub(crate) use {state, state_of_enum};

use crate::drive::{DriveState, Measurement, Power, Watchdog};
use crate::event::BusState;
use crate::frame::{Frame, FrameKind, FrameQueue, Id};
use crate::mapping::{ActuatorMeasurement, ActuatorSetpoint};
use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Reason};

state!(DriveState { power, fault, watchdog });
state!(Measurement { position, velocity, torque, temperature });
state!(ActuatorMeasurement { position, velocity, effort, temperature });
state!(ActuatorSetpoint { position, velocity, effort, stiffness, damping });
state!(ActuatorCommand {
    sequence,
    stamp_ns,
    fingerprint,
    n_u,
    position,
    velocity,
    effort,
    stiffness,
    damping
});
state_of_enum!(Power { Unknown, Off, Starting, On });
state_of_enum!(Watchdog { Unknown, Off, Set(u32), Unreadable });
state_of_enum!(BusState { Active, Warning, Passive, Off });

macro_rules! coded {
    ($($type:ty),*) => {$(
        impl State for $type {
            fn carry(&mut self, words: &mut Words<'_>) {
                let mut code = *self as u32;
                code.carry(words);
                *self = Self::from_code(code).unwrap_or(*self);
            }
        }
    )*};
}
coded!(MechanismState, Reason);

impl State for FrameQueue {
    fn carry(&mut self, words: &mut Words<'_>) {
        let mut n = self.frames().len();
        n.carry(words);
        for place in 0..n.min(self.capacity()) {
            let mut frame = self.frames().get(place).copied();
            frame.get_or_insert(Frame::EMPTY).carry(words);
            self.put(place, frame.unwrap_or(Frame::EMPTY));
        }
        self.cut(n);
    }
}

impl State for Frame {
    fn carry(&mut self, words: &mut Words<'_>) {
        let is_extended = matches!(self.id, Id::Extended(_));
        let is_switched = self.kind == FrameKind::Fd { bit_rate_switch: true };
        let mut head = [
            u64::from(self.id.number()),
            u64::from(is_extended) | u64::from(self.is_fd()) << 1 | u64::from(is_switched) << 2,
            self.data().len() as u64,
        ];
        head.carry(words);
        let [number, flags, len] = head;
        let mut bytes = [0; crate::frame::MAX_DATA];
        let len = (len as usize).min(bytes.len());
        bytes.iter_mut().zip(self.data()).for_each(|(byte, own)| *byte = *own);
        for chunk in bytes.chunks_exact_mut(8).take(len.div_ceil(8)) {
            let mut word = chunk.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
            word.carry(words);
            chunk.copy_from_slice(&word.to_le_bytes());
        }
        let number = number as u32;
        let id = if flags & 1 != 0 { Id::extended(number) } else { Id::standard(number) };
        let data = bytes.get(..len).unwrap_or_default();
        let frame = id.and_then(|id| match flags & 2 != 0 {
            true => Frame::fd(id, flags & 4 != 0, data),
            false => Frame::classic(id, data),
        });
        *self = frame.unwrap_or(*self);
    }
}
