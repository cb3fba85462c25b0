//! Settings of the protocol.

use crate::protocol::{Key, KeyKind};

pub(super) const KEYS: &[Key] = &[
    Key {
        name: "id",
        kind: KeyKind::Integer(1, 126),
        default: None,
        about: "id.id of the controller",
    },
    Key {
        name: "source",
        kind: KeyKind::Integer(0, 126),
        default: Some("0"),
        about: "identifier of this side",
    },
    Key {
        name: "kp",
        kind: KeyKind::Number(1e-6, 1e6),
        default: Some(""),
        about: "servo.pid_position.kp [N m/turn], for the mode impedance",
    },
    Key {
        name: "kd",
        kind: KeyKind::Number(1e-6, 1e6),
        default: Some(""),
        about: "servo.pid_position.kd [N m s/turn], for the mode impedance",
    },
];
