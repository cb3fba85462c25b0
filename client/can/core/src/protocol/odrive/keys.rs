//! Settings of the protocol.

use crate::protocol::{Key, KeyKind};

pub(super) const KEYS: &[Key] = &[
    Key {
        name: "node",
        kind: KeyKind::Integer(0, 62),
        default: None,
        about: "node_id of the axis",
    },
    Key {
        name: "velocity_scale",
        kind: KeyKind::Number(1e-6, 1.0),
        default: Some("0.001"),
        about: "1 / input_vel_scale: one step of the velocity beside a position [turn/s]",
    },
    Key {
        name: "torque_scale",
        kind: KeyKind::Number(1e-6, 1.0),
        default: Some("0.001"),
        about: "1 / input_torque_scale: one step of the torque beside a position [N m]",
    },
    Key {
        name: "motor_torque_constant",
        kind: KeyKind::Number(1e-6, 1e6),
        default: Some(""),
        about: "axis0.config.motor.torque_constant [N m/A], for the limit of current",
    },
    Key {
        name: "torque_feedback",
        kind: KeyKind::Flag,
        default: Some("false"),
        about: "whether the ODrive tells its torque every cycle",
    },
    Key {
        name: "watchdog_timeout_endpoint",
        kind: KeyKind::Integer(1, 0xFFFF),
        default: Some(""),
        about: "endpoint of axis0.config.watchdog_timeout",
    },
    Key {
        name: "enable_watchdog_endpoint",
        kind: KeyKind::Integer(1, 0xFFFF),
        default: Some(""),
        about: "endpoint of axis0.config.enable_watchdog",
    },
];
