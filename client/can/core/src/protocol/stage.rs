//! The way to power of motors that take a whole set-point in one frame.

/// How far it is; each step waits for the motor's reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Off,
    /// A set-point of nothing was sent, so that no old one waits in the motor.
    Neutral,
    /// Power was asked for; so many replies came since, where they are counted.
    Asked(u8),
    On,
    /// The motor let go by itself; it gets no power before it was told to be off.
    Lost,
}
