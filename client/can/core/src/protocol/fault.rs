//! Faults that a drive detects, as numbers of [`DriveState::fault`](crate::drive::DriveState) above
//! all motor codes.

/// The motor's ranges, read back, differ from the configuration: every number would be scaled
/// wrongly.
pub const RANGES_DIFFER: u32 = 0x8000_0001;
/// The motor is outside its protocol's range of positions, where position set-points have no code.
pub const OUT_OF_RANGE: u32 = 0x8000_0002;
/// The motor lost its power without a command.
pub const POWER_LOST: u32 = 0x8000_0003;
/// The motor does not take the configured mode.
pub const MODE_REFUSED: u32 = 0x8000_0004;
/// The motor refused a required setting.
pub const SETTING_REFUSED: u32 = 0x8000_0005;
/// The motor sent a number that is not finite.
pub const NOT_FINITE: u32 = 0x8000_0006;
/// The motor reports a fault without a code.
pub const UNKNOWN: u32 = 0x8000_0007;
/// The motor's reports of its fault or its power have stopped.
pub const SILENT: u32 = 0x8000_0008;
/// The motor does not hold its torque limit.
pub const LIMIT_REFUSED: u32 = 0x8000_0009;
/// The motor answers with frames of another protocol; the bridge detects this.
pub const MALFORMED: u32 = 0x8000_0020;

/// The first of several faults, the gravest first; 0 without one.
#[inline]
pub(super) fn first<const N: usize>(faults: [u32; N]) -> u32 {
    faults.into_iter().find(|fault| *fault != 0).unwrap_or(0)
}

/// The fault if the condition holds; else 0.
#[inline]
pub(super) fn when(is_there: bool, fault: u32) -> u32 {
    if is_there { fault } else { 0 }
}

/// Description of a drive's own fault; `None` for the codes of motors.
pub fn describe(fault: u32) -> Option<&'static str> {
    Some(match fault {
        RANGES_DIFFER => "the motor's ranges are not those of the configuration",
        OUT_OF_RANGE => "the motor is outside its protocol's range of positions",
        POWER_LOST => "the motor lost its power by itself",
        MODE_REFUSED => "the motor does not take this mode",
        SETTING_REFUSED => "the motor refused a setting",
        NOT_FINITE => "the motor sent a number that is not finite",
        UNKNOWN => "the motor has a fault without a code",
        SILENT => "the motor does not tell its state any more",
        LIMIT_REFUSED => "the motor does not hold the limit of torque",
        MALFORMED => {
            "the motor's answers are malformed: protocol, variant or firmware is another one"
        }
        _ => return None,
    })
}
