//! Settings that several protocols have.

use crate::settings::Key;

/// The torque constant of a motor, for protocols with currents.
pub(super) const fn motor_torque_constant(about: &'static str) -> Key {
    Key::number("motor_torque_constant", 1e-6, 1e6, about)
}

/// For protocols that count electrical turns.
pub(super) const POLE_PAIRS: Key =
    Key::integer("pole_pairs", 1, 1000, "electrical turns in one of the rotor");

/// Ranges of the codes that MIT mode and CyberGear share.
pub(super) const RANGES: [&str; 5] =
    ["position_range", "velocity_range", "torque_range", "stiffness_range", "damping_range"];

/// The end of one of these ranges.
pub(super) const fn range(name: &'static str, about: &'static str) -> Key {
    Key::number(name, 1e-3, 1e5, about)
}
