//! Settings of a configuration: top level, timeouts, buses, motors, limits.

use super::StopFunction;
use crate::settings::{Key, KeyKind};

/// A time or a size that nobody sensible exceeds.
pub(super) const LARGE: f64 = 1e9;

pub(super) const TOP: &[Key] = &[
    key("robot", KeyKind::Text, Some(""), "a bundled robot"),
    key("urdf", KeyKind::Text, Some(""), "the robot's URDF"),
    key("submechanisms", KeyKind::Text, Some(""), "the robot's submechanism file"),
    key("rate_hz", KeyKind::Number(1.0, 4000.0), None, "cycles in a second"),
    key(
        "ramp_ms",
        KeyKind::Number(0.0, 60_000.0),
        Some("500"),
        "time in which gains and efforts grow after arming",
    ),
    key(
        "stop",
        KeyKind::Word(&["mechanism", "robot"]),
        Some("mechanism"),
        "what stops when a motor fails",
    ),
    key(
        "stop_function",
        KeyKind::Word(StopFunction::NAMES),
        Some("ss1"),
        "how a mechanism stops, in the words of IEC 61800-5-2",
    ),
    key("stop_ms", KeyKind::Number(1.0, 10_000.0), Some("500"), "time to come to a standstill"),
];
pub(super) const MECHANISM: &[Key] = &[
    key("actuator", KeyKind::Text, None, "one of its actuators"),
    key(
        "stop_function",
        KeyKind::Word(StopFunction::NAMES),
        Some(""),
        "how it stops, in the words of IEC 61800-5-2",
    ),
    key("stop_ms", KeyKind::Number(1.0, 10_000.0), Some(""), "time to come to a standstill"),
    key(
        "hold_ms",
        KeyKind::Number(0.0, 600_000.0),
        Some(""),
        "longest time of holding or lowering",
    ),
    key(
        "lower_velocity",
        KeyKind::Number(1e-9, LARGE),
        Some(""),
        "greatest speed of lowering, rad/s or m/s",
    ),
];
pub(super) const TIMEOUTS: &[Key] = &[
    key(
        "damping_ms",
        KeyKind::Number(0.1, 10_000.0),
        Some("20"),
        "T1: older commands bring damping",
    ),
    key(
        "disable_ms",
        KeyKind::Number(0.1, 60_000.0),
        Some("100"),
        "T2: older commands bring a stop",
    ),
    key(
        "feedback_ms",
        KeyKind::Number(0.1, 10_000.0),
        Some("20"),
        "a motor silent for longer has failed",
    ),
    key(
        "arming_ms",
        KeyKind::Number(1.0, 60_000.0),
        Some("2000"),
        "arming that takes longer has failed",
    ),
];
pub(super) const MODEL: &[Key] = &[
    key(
        "effort",
        KeyKind::Number(0.0, 10.0),
        Some("0"),
        "part of limits.effort by which efforts may differ from the model's, 0 for not compared",
    ),
    key(
        "clearance",
        KeyKind::Number(0.0, 0.9),
        Some("0.2"),
        "least clearance from singular poses, 1 at the best pose, 0 for not assessed",
    ),
];
pub(super) const ENCODER: &[Key] = &[
    key("joint", KeyKind::Text, None, "the joint that it measures"),
    key("bus", KeyKind::Text, None, "the bus that it reports on"),
    key("id", KeyKind::Integer(0, 0x1FFF_FFFF), None, "the identifier of its frames"),
    key("byte", KeyKind::Integer(0, 60), Some("0"), "where its number begins in the data"),
    key("bits", KeyKind::Integer(8, 32), Some("32"), "size of its number, whole bytes"),
    key("scale", KeyKind::Number(-LARGE, LARGE), None, "what one step is, rad or m"),
    key(
        "offset",
        KeyKind::Number(-LARGE, LARGE),
        Some("0"),
        "where the joint is when the number is 0, rad or m",
    ),
    key(
        "margin",
        KeyKind::Number(1e-9, LARGE),
        None,
        "by how much it may contradict the motors, rad or m",
    ),
];
pub(super) const BUS: &[Key] = &[
    key("name", KeyKind::Text, None, "what motors call it"),
    key("interface", KeyKind::Text, Some("socketcan"), "how it is reached, in python-can's words"),
    key("channel", KeyKind::Text, None, "which of them, as can0"),
    key("bitrate", KeyKind::Integer(10_000, 1_000_000), Some("1000000"), "bit rate in bit/s"),
    key(
        "data_bitrate",
        KeyKind::Integer(10_000, 8_000_000),
        Some(""),
        "bit rate of the data in CAN FD in bit/s",
    ),
];
pub(super) const MOTOR: &[Key] = &[
    key("actuator", KeyKind::Text, None, "the actuator that it drives"),
    key("bus", KeyKind::Text, None, "the bus that it is on"),
    key(
        "sign",
        KeyKind::Integer(-1, 1),
        Some("1"),
        "-1 where actuator and motor go against each other",
    ),
    key(
        "gear",
        KeyKind::Number(1e-9, LARGE),
        Some("1"),
        "the motor's turn for the actuator's, rad/rad or rad/m",
    ),
    key(
        "offset",
        KeyKind::Number(-LARGE, LARGE),
        Some(""),
        "where the actuator is when the motor says 0, in rad or m",
    ),
    key(
        "torque_constant",
        KeyKind::Number(1e-9, LARGE),
        Some("1"),
        "true torque for the torque that the protocol says",
    ),
    key(
        "damping",
        KeyKind::Number(0.0, LARGE),
        Some(""),
        "damping while commands are late, N m s/rad or N s/m",
    ),
    key("watchdog_ms", KeyKind::Integer(1, 10_000), None, "the motor's own watchdog in ms"),
    key(
        "watchdog",
        KeyKind::Word(&["read_back", "believed"]),
        Some("read_back"),
        "believed where the protocol cannot read it",
    ),
];
pub(super) const LIMITS: &[Key] = &[
    key("velocity", KeyKind::Number(1e-9, LARGE), Some(""), "greatest speed, rad/s or m/s"),
    key("effort", KeyKind::Number(0.0, LARGE), Some(""), "greatest effort, N m or N"),
    key(
        "effort_rate",
        KeyKind::Number(1e-9, 1e15),
        Some(""),
        "greatest change of the effort, N m/s or N/s",
    ),
];

/// All may be left out: what stands there then is in [`super::MonitorBounds::USUAL`].
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
    key(name, KeyKind::NumberOrOff(1e-6, most), Some(""), about)
}

const fn switch(name: &'static str, about: &'static str) -> Key {
    key(name, KeyKind::Word(&["on", "off"]), Some(""), about)
}

const fn key(
    name: &'static str,
    kind: KeyKind,
    default: Option<&'static str>,
    about: &'static str,
) -> Key {
    Key { name, kind, default, about }
}
