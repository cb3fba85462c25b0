//! Settings of the protocol.

use crate::protocol::{Key, KeyKind};

pub(super) const KEYS: &[Key] = &[
    Key { name: "node", kind: KeyKind::Integer(1, 126), default: None, about: "node of the drive" },
    Key {
        name: "master",
        kind: KeyKind::Integer(1, 127),
        default: Some("127"),
        about: "node of this side, for its heartbeat",
    },
    Key {
        name: "rated_torque",
        kind: KeyKind::Number(1e-3, 1e6),
        default: None,
        about: "object 6076 [N m], at the motor's output",
    },
    Key {
        name: "counts_per_turn",
        kind: KeyKind::Number(1.0, 1e9),
        default: None,
        about: "counts of 6064 in a turn of the motor's output",
    },
    Key {
        name: "velocity_counts_per_turn",
        kind: KeyKind::Number(1e-3, 1e9),
        default: Some(""),
        about: "606C and 60FF at one turn a second; without it the counts of the position",
    },
    Key {
        name: "torque_offset",
        kind: KeyKind::Flag,
        default: Some("false"),
        about: "torque beside position or velocity, by 60B2",
    },
    Key {
        name: "velocity_feedback",
        kind: KeyKind::Flag,
        default: Some("true"),
        about: "the velocity in a second PDO",
    },
    Key {
        name: "configure",
        kind: KeyKind::Flag,
        default: Some("true"),
        about: "whether the PDOs are set up by SDO; else they are as above",
    },
];
