//! Settings of the protocol.

use crate::protocol::{Key, KeyKind};

pub(super) const KEYS: &[Key] = &[
    Key {
        name: "variant",
        kind: KeyKind::Word(&["mini_cheetah", "t_motor", "damiao", "robstride"]),
        default: None,
        about: "whose MIT mode it is",
    },
    Key {
        name: "id",
        kind: KeyKind::Integer(1, 0x7FE),
        default: None,
        about: "identifier of the motor's commands",
    },
    Key {
        name: "reply_id",
        kind: KeyKind::Integer(0, 0x7FE),
        default: None,
        about: "identifier of the motor's replies",
    },
    range("position_range", "position at the end of the range [rad]"),
    range("velocity_range", "velocity at the end of the range [rad/s]"),
    range("torque_range", "torque at the end of the range [N m]"),
    range("stiffness_range", "largest stiffness [N m/rad]"),
    range("damping_range", "largest damping [N m s/rad]"),
];

const fn range(name: &'static str, about: &'static str) -> Key {
    Key { name, kind: KeyKind::Number(1e-3, 1e5), default: None, about }
}
