//! C enums of the commands and states between controllers and a bridge.

/// State of a mechanism, and of the bridge as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum MechanismState {
    /// Its motors have no power.
    Disabled = 0,
    /// It was asked to arm, and waits for a missing condition or for its motors.
    Arming = 1,
    /// Its motors follow the commands.
    Enabled = 2,
    /// Something failed: its motors have no power until an operator resets it.
    Fault = 3,
    /// Its motors are brought to a standstill, and then lose power.
    Stopping = 4,
}

/// Why a mechanism is in its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Reason {
    /// Nothing to report.
    None = 0,
    /// An operator or a controller disarmed it.
    Disarmed = 1,
    /// No command came for longer than T2.
    CommandLost = 2,
    /// The bridge itself was stopped for longer than T2, or heard no motor for `feedback_ms`
    /// because it was late itself.
    Stalled = 3,
    /// No command came since it was asked to arm.
    NoCommand = 4,
    /// A motor has no offset in the configuration.
    NotCalibrated = 5,
    /// A motor's watchdog is off.
    WatchdogOff = 6,
    /// A motor's watchdog was not read, and is not believed to be on.
    WatchdogUnknown = 7,
    /// A motor does not measure, or no longer.
    FeedbackStale = 8,
    /// A motor reports a fault.
    MotorFault = 9,
    /// A motor lost power while it was to be enabled.
    PowerLost = 10,
    /// Motors did not take power in time.
    ArmingTimeout = 11,
    /// The bus is error-passive.
    BusPassive = 12,
    /// The bus is off.
    BusOff = 13,
    /// Frames of before still wait to be sent.
    Backlog = 14,
    /// Another mechanism failed, and the robot stops as a whole.
    OtherMechanism = 15,
    /// A motor's watchdog is longer than the configured one.
    WatchdogLong = 16,
    /// An actuator is beyond its position limit and moves outwards.
    PositionLimit = 17,
    /// An actuator is faster than its limit.
    VelocityLimit = 18,
    /// An actuator stays behind its set-point.
    FollowingError = 19,
    /// A motor reports another effort than it was asked for.
    EffortMismatch = 20,
    /// A motor repeats one position while it must have moved.
    FeedbackFrozen = 21,
    /// A position changed by more than the speed allows.
    FeedbackJump = 22,
    /// A motor answers requests of long ago.
    FeedbackLate = 23,
    /// More answers came than a motor was asked for.
    SecondAnswer = 24,
    /// Another sender uses the bridge's own identifiers.
    SecondMaster = 25,
    /// A motor is too hot.
    OverTemperature = 26,
    /// An actuator is outside its limits, where nothing is armed.
    OutsideLimits = 27,
    /// An independent coordinate of the mechanism is beyond its limit.
    MechanismLimit = 28,
    /// No pose of the mechanism has the measured positions.
    Unreachable = 29,
    /// The mechanism is too near to a singular pose.
    NearSingular = 30,
    /// Encoders of one closed loop contradict each other.
    LoopResidual = 31,
    /// Reported efforts contradict the inverse dynamics of the model.
    ModelEffort = 32,
    /// An actuator moves, and power is given at rest only.
    Moving = 33,
    /// The configuration names a robot, and no record of its commissioning fits.
    NotCommissioned = 34,
    /// A motor is back at another position than the last known one: an operator confirms it.
    PositionChanged = 35,
    /// Something pushes a mechanism harder than its threshold.
    ExternalForce = 36,
}

/// An operation that an operator requests from the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Operation {
    /// Give the motors power as soon as everything is in order.
    Arm = 1,
    /// Take the power away.
    Disarm = 2,
    /// Clear a fault; armed mechanisms stay armed.
    Reset = 3,
    /// Move actuators outside their limits slowly back inside, then remove the power.
    Return = 4,
    /// Believe the positions of motors that differ from the last known ones.
    Confirm = 5,
}

/// State of single actuators, as bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Flag {
    /// The effort was limited.
    EffortLimited = 1,
    /// The position was limited.
    PositionLimited = 1 << 1,
    /// The velocity was limited, or the position was to change faster than that.
    VelocityLimited = 1 << 2,
    /// The effort was to change faster than it may.
    RateLimited = 1 << 3,
    /// Gains and efforts still grow after arming.
    Ramping = 1 << 4,
    /// Commands are late: the actuator is damped.
    Damped = 1 << 5,
    /// The measurement is missing or too old.
    Stale = 1 << 6,
    /// The motor reports a fault.
    MotorFault = 1 << 7,
    /// The motor has power.
    Powered = 1 << 8,
    /// No motor drives it.
    NoMotor = 1 << 9,
    /// The effort is reduced because the motor is hot.
    Derated = 1 << 10,
    /// The actuator is brought to a standstill.
    Stopping = 1 << 11,
    /// An effort that pushes outwards beyond a position limit was taken away.
    OutwardLimited = 1 << 12,
    /// The configuration waives the commissioning of the robot.
    Uncommissioned = 1 << 13,
    /// Nothing tells a frozen encoder from a joint at rest.
    FrozenUndetectable = 1 << 14,
    /// The motor is back at another position than the last known one.
    PositionChanged = 1 << 15,
}

#[cfg(test)]
mod tests {
    use sarrus_client::actuators as wire;

    use super::*;

    /// `OtherMechanism` of `other_mechanism`.
    fn variant(name: &str) -> String {
        let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
        name.split('_').map(capital).collect()
    }

    #[test]
    fn numbers_and_names_are_those_of_the_wire() {
        let source = include_str!("actuators.rs");
        let is_there = |name: &str, code: u32| {
            let line = format!("    {} = {code},\n", variant(name));
            assert!(source.contains(&line), "no {line}");
        };
        wire::MechanismState::ALL.iter().for_each(|x| is_there(x.name(), *x as u32));
        wire::Reason::ALL.iter().for_each(|x| is_there(x.name(), *x as u32));
        wire::Operation::ALL.iter().for_each(|x| is_there(x.name(), *x as u32));
        assert_eq!(MechanismState::Stopping as usize + 1, wire::MechanismState::ALL.len());
        assert_eq!(Reason::ExternalForce as usize + 1, wire::Reason::ALL.len());
        assert_eq!(Operation::Confirm as usize, wire::Operation::ALL.len());
        for (bit, name) in wire::flag::NAMES.iter().enumerate() {
            let number = if bit == 0 { "1".to_owned() } else { format!("1 << {bit}") };
            let line = format!("    {} = {number},\n", variant(name));
            assert!(source.contains(&line), "no {line}");
        }
    }
}
