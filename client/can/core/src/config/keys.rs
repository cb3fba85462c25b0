//! Settings of a configuration: top level, timeouts, buses, motors, limits.

use super::values::StopFunction;
use crate::settings::{Key, KeyKind};

/// A time or a size beyond every sensible one.
pub(super) const LARGE: f64 = 1e9;
/// A size below every sensible one.
pub(super) const LEAST: f64 = 1e-9;

pub(super) const TOP: &[Key] = &[
    Key::text("robot", "a bundled robot").optional(),
    Key::text("urdf", "the robot's URDF").optional(),
    Key::text("submechanisms", "the robot's submechanism file").optional(),
    Key::text("commissioning", "the record of the robot's commissioning, or none").optional(),
    Key::number("rate_hz", 1.0, 4000.0, "cycles in a second"),
    Key::number("ramp_ms", 0.0, 60_000.0, "time in which gains and efforts grow after arming")
        .or("500"),
    Key::word("stop", &["mechanism", "robot"], "what stops when a motor fails").or("mechanism"),
    Key::word(
        "stop_function",
        StopFunction::NAMES,
        "how a mechanism stops, in the words of IEC 61800-5-2",
    )
    .or("ss1"),
    Key::number("stop_ms", 1.0, 10_000.0, "time to come to a standstill").or("500"),
];
pub(super) const MECHANISM: &[Key] = &[
    Key::text("actuator", "one of its actuators"),
    Key::word("stop_function", StopFunction::NAMES, "how it stops, in the words of IEC 61800-5-2")
        .optional(),
    Key::number("stop_ms", 1.0, 10_000.0, "time to come to a standstill").optional(),
    Key::number("hold_ms", 0.0, 600_000.0, "longest time of holding or lowering").optional(),
    Key::number("lower_velocity", LEAST, LARGE, "greatest speed of lowering, rad/s or m/s")
        .optional(),
];
pub(super) const TIMEOUTS: &[Key] = &[
    Key::number("damping_ms", 0.1, 10_000.0, "T1: older commands bring damping").or("20"),
    Key::number("disable_ms", 0.1, 60_000.0, "T2: older commands bring a stop").or("100"),
    Key::number(
        "feedback_ms",
        0.1,
        10_000.0,
        "a motor silent for longer, at least 8 cycles, has failed",
    )
    .or("20"),
    Key::number("arming_ms", 1.0, 60_000.0, "arming that takes longer has failed").or("2000"),
];
pub(super) const MODEL: &[Key] = &[
    Key::number(
        "effort",
        0.0,
        10.0,
        "part of limits.effort by which efforts may differ from the model's, 0 for not compared",
    )
    .or("0"),
    Key::number("external", 0.0, 10.0, "part of limits.effort for external forces, 0: off").or("0"),
    Key::number(
        "clearance",
        0.0,
        0.9,
        "least clearance from singular poses, 1 at the best pose, 0 for not assessed",
    )
    .or("0.2"),
];
pub(super) const ENCODER: &[Key] = &[
    Key::text("joint", "the joint that it measures"),
    Key::text("bus", "the bus that it reports on"),
    Key::integer("id", 0, 0x1FFF_FFFF, "the identifier of its frames"),
    Key::integer("byte", 0, 60, "where its number begins in the data").or("0"),
    Key::integer("bits", 8, 32, "size of its number, whole bytes").or("32"),
    Key::number("scale", -LARGE, LARGE, "what one step is, rad or m"),
    Key::number("offset", -LARGE, LARGE, "where the joint is when the number is 0, rad or m")
        .or("0"),
    Key::number("margin", LEAST, LARGE, "by how much it may contradict the motors, rad or m"),
];
pub(super) const BUS: &[Key] = &[
    Key::text("name", "what motors call it"),
    Key::text("interface", "how it is reached, in python-can's words").or("socketcan"),
    Key::text("channel", "which of them, as can0"),
    Key::integer("bitrate", 10_000, 1_000_000, "bit rate in bit/s").or("1000000"),
    Key::integer("data_bitrate", 10_000, 8_000_000, "bit rate of the data in CAN FD in bit/s")
        .optional(),
];
pub(super) const MOTOR: &[Key] = &[
    Key::text("actuator", "the actuator that it drives"),
    Key::text("bus", "the bus that it is on"),
    Key::integer("sign", -1, 1, "-1 where actuator and motor go against each other").or("1"),
    Key::number("gear", LEAST, LARGE, "the motor's turn for the actuator's, rad/rad or rad/m")
        .or("1"),
    Key::number(
        "offset",
        -LARGE,
        LARGE,
        "where the actuator is when the motor says 0, in rad or m",
    )
    .optional(),
    Key::number(
        "torque_constant",
        LEAST,
        LARGE,
        "true torque for the torque that the protocol says",
    )
    .or("1"),
    Key::number("damping", 0.0, LARGE, "damping while commands are late, N m s/rad or N s/m")
        .optional(),
    Key::number(
        "dither",
        1e-12,
        LARGE,
        "swing that moves the joint by two codes or more, N m or N; rad or m in the mode position",
    )
    .optional(),
    Key::number("rest", -LARGE, LARGE, "where it may rest without power when hot, rad or m")
        .optional(),
    Key::integer("watchdog_ms", 1, 10_000, "the motor's own watchdog in ms"),
    Key::word("watchdog", &["read_back", "believed"], "believed where the protocol cannot read it")
        .or("read_back"),
];
pub(super) const LIMITS: &[Key] = &[
    Key::number("velocity", LEAST, LARGE, "greatest speed, rad/s or m/s"),
    Key::number("effort", LEAST, LARGE, "greatest effort, N m or N"),
    Key::number("effort_rate", LEAST, 1e15, "greatest change of the effort, N m/s or N/s")
        .optional(),
];

/// All are optional; defaults are in [`super::values::MonitorBounds::USUAL`].
pub(super) const MONITORS: &[Key] = &[
    bound("position", 10.0, "distance beyond a position limit, as part of the range"),
    bound("velocity", 100.0, "speed beyond its limit, as part of it"),
    bound("following_ms", 600_000.0, "time far behind the set-point"),
    bound("effort", 100.0, "difference of reported and asked effort, as part of the limit"),
    bound("frozen", 100.0, "change of effort under one position code, as part of the limit"),
    bound("jump", 1000.0, "speed between two measurements, as multiple of the velocity limit"),
    bound("late_ms", 10_000.0, "age of a measurement"),
    bound("second_answer", 1e6, "answers more than asked for"),
    switch("second_master", "frames with the bridge's own identifiers"),
    bound("derate", 1000.0, "temperature in °C from which the effort is reduced"),
    bound("temperature", 1000.0, "temperature in °C that is a fault"),
    switch("bus_passive", "error-passive while there is power"),
];

const fn bound(name: &'static str, most: f64, about: &'static str) -> Key {
    Key { name, kind: KeyKind::NumberOrOff(1e-6, most), default: Some(""), about }
}

const fn switch(name: &'static str, about: &'static str) -> Key {
    Key::word(name, &["on", "off"], about).optional()
}
