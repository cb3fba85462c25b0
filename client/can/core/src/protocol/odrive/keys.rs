//! Settings of the protocol.

use crate::protocol::Key;

pub(super) const KEYS: &[Key] = &[
    Key::integer("node", 0, 62, "node_id of the axis"),
    Key::number(
        "velocity_scale",
        1e-6,
        1.0,
        "1 / input_vel_scale: one step of the velocity beside a position [turn/s]",
    )
    .or("0.001"),
    Key::number(
        "torque_scale",
        1e-6,
        1.0,
        "1 / input_torque_scale: one step of the torque beside a position [N m]",
    )
    .or("0.001"),
    Key::number(
        "motor_torque_constant",
        1e-6,
        1e6,
        "axis0.config.motor.torque_constant [N m/A], for the limit of current",
    )
    .optional(),
    Key::flag("torque_feedback", "whether the ODrive tells its torque every cycle").or("false"),
    Key::integer(
        "watchdog_timeout_endpoint",
        1,
        0xFFFF,
        "endpoint of axis0.config.watchdog_timeout",
    )
    .optional(),
    Key::integer("enable_watchdog_endpoint", 1, 0xFFFF, "endpoint of axis0.config.enable_watchdog")
        .optional(),
];
