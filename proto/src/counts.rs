//! Counters of commands and buses. Each list is defined once, here: the wire, the bridge and every
//! display take names and order from it.

/// A command's possible verdicts: variant, name in JSON, description.
macro_rules! verdicts {
    ($($(#[$doc:meta])* $variant:ident $name:ident $words:literal,)*) => {
        /// Whether a command was accepted.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum CommandVerdict {
            $($(#[$doc])* $variant,)*
        }

        impl CommandVerdict {
            /// All verdicts, the accepting one first.
            pub const ALL: &[CommandVerdict] = &[$(CommandVerdict::$variant),*];

            /// The name in JSON and in Python.
            pub const fn name(self) -> &'static str {
                match self {
                    $(CommandVerdict::$variant => stringify!($name),)*
                }
            }

            /// The description.
            pub const fn words(self) -> &'static str {
                match self {
                    $(CommandVerdict::$variant => $words,)*
                }
            }
        }

        /// Commands since the start, by verdict.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(C)]
        pub struct CommandCounts {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl CommandCounts {
            /// Counts a command.
            pub fn add(&mut self, verdict: CommandVerdict) {
                match verdict {
                    $(CommandVerdict::$variant => self.$name += 1,)*
                }
            }

            /// Commands of a verdict.
            pub const fn of(&self, verdict: CommandVerdict) -> u64 {
                match verdict {
                    $(CommandVerdict::$variant => self.$name,)*
                }
            }
        }
    };
}

/// A structure of counts and their names.
macro_rules! counts {
    ($(#[$outer:meta])* $type:ident $n:literal { $($(#[$doc:meta])* $name:ident,)* }) => {
        $(#[$outer])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[repr(C)]
        pub struct $type {
            $($(#[$doc])* pub $name: u64,)*
        }

        impl $type {
            /// Names in JSON and in Python.
            pub const NAMES: [&'static str; $n] = [$(stringify!($name)),*];

            /// Each count with its name.
            pub const fn each(&self) -> [(&'static str, u64); $n] {
                [$((stringify!($name), self.$name)),*]
            }
        }
    };
}

verdicts! {
    /// The command is accepted.
    Accepted accepted "taken",
    /// A number is NaN, infinite or beyond 1e60; the whole command is not used.
    NotFinite not_finite "not finite",
    /// A stiffness or damping is negative; the whole command is not used.
    Negative negative "negative",
    /// Its sequence or stamp is not newer than that of the previous command.
    Old old "old",
    /// Its stamp lies in the future.
    Ahead ahead "ahead",
    /// It was computed with another model.
    WrongModel wrong_model "of another model",
    /// It is for another number of actuators.
    WrongSize wrong_size "of another size",
}

counts! {
    /// Counts of one bus since the start.
    BusCounts 7 {
        /// Frames received.
        received,
        /// Frames with an unknown identifier.
        unknown,
        /// Malformed frames of a motor.
        malformed,
        /// Frames that were not sent.
        dropped,
        /// Received frames that were lost.
        overrun,
        /// Times that the bus became error-passive.
        passive,
        /// Times that it went bus-off.
        off,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_verdict_has_a_count_of_its_own() {
        let mut counts = CommandCounts::default();
        for (n, verdict) in CommandVerdict::ALL.iter().enumerate() {
            (0..=n).for_each(|_| counts.add(*verdict));
        }
        for (n, verdict) in CommandVerdict::ALL.iter().enumerate() {
            assert_eq!(counts.of(*verdict), n as u64 + 1, "{}", verdict.name());
        }
        assert_eq!((counts.accepted, counts.wrong_size), (1, 7));
    }

    #[test]
    fn counts_are_listed_by_name_in_their_order() {
        let counts = BusCounts { received: 1, off: 2, ..BusCounts::default() };
        let [first, .., last] = counts.each();
        assert_eq!((first, last), (("received", 1), ("off", 2)));
    }
}
