//! The whole state of a bridge as numbers, for logs that begin anywhere.
//!
//! One function of each type both writes its state and reads it, so that the order is the same. The
//! macro `state` makes it from the fields: those that change, then those that the configuration
//! fixes, so that no field can be left out. Nothing here allocates.

use sarrus_proto::actuators::{ActuatorCommand, MechanismState, Reason};

use crate::event::BusState;

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
coded!(BusState, MechanismState, Reason);
