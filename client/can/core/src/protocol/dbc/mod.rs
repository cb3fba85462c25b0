//! Any motor whose frames a DBC file describes.
//!
//! The settings assign the file's signals, written `Message.Signal`: set-points that are sent, and
//! the motor's measurements. Every message with a signal that is sent goes out in each cycle, once
//! for each value of its switch that those signals need; its other signals are raw 0 unless they
//! are in `constants`. Intel and Motorola, signed, scaled and IEEE 754 signals; values saturate.
//! Units: `position_unit` and so on give the file's units in rad, rad/s, N m, N m/rad and N m
//! s/rad.
//!
//! Torque, gains and the largest torque are rounded towards zero. In the modes position and
//! velocity the motor's own loops produce the torque: without the signal `torque_limit` they are
//! refused.
//!
//! The motor has power while `enable` has the value `enable_value`. Without power it gets only its
//! measured position; the first set-point goes out a cycle before power. In each cycle the frames
//! with `enable` come last when they give power and first when they take it. A report of the motor
//! counts for `stale_ms`: later velocity and torque are missing, and a late `fault` or `enabled` is
//! a fault. A DBC file describes no watchdog, so it cannot be read back.

mod drive;
mod file;
mod signals;

use super::{Key, KeyKind, Protocol};
use crate::drive::Mode;
use drive::make;

/// Any DBC file.
pub(super) const DBC: Protocol = Protocol {
    name: "dbc",
    about: "any motor, by a DBC file and a mapping of its signals",
    modes: &[Mode::Torque, Mode::Impedance, Mode::Position, Mode::Velocity],
    fd: false,
    keys: &[
        Key { kind: KeyKind::File, ..Key::text("file", "the DBC file") },
        signal("enable", None, "signal that gives power, Message.Signal"),
        number("enable_value", "1", "its value for power"),
        number("disable_value", "0", "its value without power"),
        signal("position", Some(""), "signal of the desired position"),
        signal("velocity", Some(""), "signal of the desired velocity"),
        signal("torque", Some(""), "signal of the desired torque"),
        signal("stiffness", Some(""), "signal of the desired stiffness"),
        signal("damping", Some(""), "signal of the desired damping"),
        signal(
            "torque_limit",
            Some(""),
            "signal of the largest torque, which the modes position and velocity need",
        ),
        signal(
            "constants",
            Some(""),
            "values of other signals that are sent: Message.Signal=1, Message.Other=2",
        ),
        signal("measured_position", None, "signal of the measured position"),
        signal("measured_velocity", Some(""), "signal of the measured velocity"),
        signal("measured_torque", Some(""), "signal of the measured torque"),
        signal("temperature", Some(""), "signal of the temperature [°C]"),
        signal("fault", Some(""), "signal of the motor's fault, 0 without one"),
        signal("enabled", Some(""), "signal that tells whether the motor has power"),
        signal("counter", Some(""), "signal that steps with each new measurement of the sensor"),
        number("enabled_value", "1", "its value with power"),
        Key::integer(
            "stale_ms",
            1,
            60_000,
            "what the motor has not reported again after this time is not believed any more, in ms",
        )
        .or("200"),
        number("position_unit", "1", "rad for 1 of the file's positions"),
        number("velocity_unit", "1", "rad/s for 1 of the file's velocities"),
        number("torque_unit", "1", "N m for 1 of the file's torques"),
        number("stiffness_unit", "1", "N m/rad for 1 of the file's stiffnesses"),
        number("damping_unit", "1", "N m s/rad for 1 of the file's dampings"),
    ],
    make,
};

const fn signal(name: &'static str, default: Option<&'static str>, about: &'static str) -> Key {
    Key { name, kind: KeyKind::Text, default, about }
}

const fn number(name: &'static str, default: &'static str, about: &'static str) -> Key {
    Key::number(name, -1e12, 1e12, about).or(default)
}
