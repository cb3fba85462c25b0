//! Settings of the protocol, the motor's parameters, and the kinds of frames.

use crate::drive::Parameter;
use crate::protocol::Key;
use crate::protocol::keys::range;

pub(super) const KEYS: &[Key] = &[
    Key::word("model", &["cybergear", "robstride"], "whose motor it is").or("cybergear"),
    Key::integer("id", 0, 127, "identifier of the motor"),
    Key::integer("host_id", 0, 255, "identifier of this side").or("253"),
    range(
        "position_range",
        "position at the end of the range [rad]; of a CyberGear 12.5 in the maker's code and 4 π \
            in its manual",
    ),
    range("velocity_range", "velocity at the end of the range [rad/s]; of a CyberGear 30")
        .optional(),
    range("torque_range", "torque at the end of the range [N m]; of a CyberGear 12").optional(),
    range("stiffness_range", "largest stiffness [N m/rad]; of a CyberGear 500").optional(),
    range("damping_range", "largest damping [N m s/rad]; of a CyberGear 5").optional(),
    Key::integer(
        "watchdog_index",
        0,
        0xFFFF,
        "index of the parameter canTimeout, 0 where the firmware has none; else 0x200C \
            (CyberGear) or 0x7028 (RobStride)",
    )
    .optional(),
];

pub(super) const RUN_MODE: u16 = 0x7005;
pub(super) const LIMIT_TORQUE: u16 = 0x700B;

/// The index of the last one is the motor's.
pub(super) const PARAMETERS: &[Parameter] = &[
    Parameter::whole(RUN_MODE as u32, "run_mode", ""),
    Parameter::single(LIMIT_TORQUE as u32, "limit_torque", "N m"),
    Parameter::single(0x7019, "mechPos", "rad"),
    Parameter::single(0x701A, "iqf", "A"),
    Parameter::single(0x701B, "mechVel", "rad/s"),
    Parameter::single(0x701C, "VBUS", "V"),
    Parameter::whole(0, "canTimeout", "50 µs"),
];
pub(super) const LAST: usize = PARAMETERS.len() - 1;

pub(super) const WHO: u32 = 0;
pub(super) const SETPOINT: u32 = 1;
pub(super) const FEEDBACK: u32 = 2;
pub(super) const POWER_ON: u32 = 3;
pub(super) const POWER_OFF: u32 = 4;
pub(super) const ZERO: u32 = 6;
pub(super) const SET_ID: u32 = 7;
pub(super) const READ: u32 = 17;
pub(super) const WRITE: u32 = 18;
pub(super) const FAULTS: u32 = 21;
pub(super) const SAVE: u32 = 22;

/// Units of canTimeout in a millisecond: one is 50 µs.
pub(super) const TIMEOUT_PER_MS: u32 = 20;
/// Feedback's mode of a motor that runs.
pub(super) const RUNS: u32 = 2;
