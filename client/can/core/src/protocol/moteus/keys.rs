//! Settings of the protocol.

use crate::protocol::Key;

pub(super) const KEYS: &[Key] = &[
    Key::integer("id", 1, 126, "id.id of the controller"),
    Key::integer("source", 0, 126, "identifier of this side").or("0"),
    Key::number("kp", 1e-6, 1e6, "servo.pid_position.kp [N m/turn], for the mode impedance")
        .optional(),
    Key::number("kd", 1e-6, 1e6, "servo.pid_position.kd [N m s/turn], for the mode impedance")
        .optional(),
];
