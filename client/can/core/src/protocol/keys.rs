//! Settings that several protocols have.

use crate::settings::{Key, KeyKind};

/// The torque of a motor for its current, where its protocol says currents.
pub(super) const fn motor_torque_constant(about: &'static str) -> Key {
    Key { name: "motor_torque_constant", kind: KeyKind::Number(1e-6, 1e6), default: None, about }
}

/// For protocols that count electrical turns.
pub(super) const POLE_PAIRS: Key = Key {
    name: "pole_pairs",
    kind: KeyKind::Integer(1, 1000),
    default: None,
    about: "electrical turns in one of the rotor",
};

/// The number of a motor on its bus.
pub(super) const fn id(least: i64, most: i64, about: &'static str) -> Key {
    Key { name: "id", kind: KeyKind::Integer(least, most), default: None, about }
}
