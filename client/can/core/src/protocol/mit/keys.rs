//! Settings of the protocol.

use crate::protocol::Key;
use crate::protocol::keys::range;

pub(super) const KEYS: &[Key] = &[
    Key::word(
        "variant",
        &["mini_cheetah", "t_motor", "damiao", "robstride"],
        "whose MIT mode it is",
    ),
    Key::integer("id", 1, 0x7FE, "identifier of the motor's commands"),
    Key::integer("reply_id", 0, 0x7FE, "identifier of the motor's replies"),
    range("position_range", "position at the end of the range [rad]"),
    range("velocity_range", "velocity at the end of the range [rad/s]"),
    range("torque_range", "torque at the end of the range [N m]"),
    range("stiffness_range", "largest stiffness [N m/rad]"),
    range("damping_range", "largest damping [N m s/rad]"),
];
