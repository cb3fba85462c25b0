//! Payloads between controllers and the CAN bridge: commands and states of all actuators, in the
//! order of u.
//!
//! The payloads are plain fixed-size values; with the feature `transport` they travel through the
//! services of `bridge`.

use crate::wire_enum::wire_enum;

/// An operation on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct OperatorRequest {
    /// Time of the request, by the monotonic clock of this machine `[ns]`.
    pub stamp_ns: u64,
    /// An [`Operation`].
    pub operation: u32,
    /// 0 for all mechanisms, else 1 + the index in u of an actuator of the addressed one.
    pub actuator: u32,
}

/// Most actuators of a robot.
pub const MAX_ACTUATORS: usize = 64;

wire_enum! {
    /// State of a mechanism, and of the bridge as a whole.
    MechanismState: u32 {
        /// Its motors have no power.
        Disabled = 0, "disabled";
        /// It is requested to arm, and waits for a missing condition or for its motors.
        Arming = 1, "arming";
        /// Its motors follow the commands.
        Enabled = 2, "enabled";
        /// Something failed: its motors have no power until an operator resets it.
        Fault = 3, "fault";
        /// Its motors are brought to a standstill, and then lose power.
        Stopping = 4, "stopping";
    }
}

wire_enum! {
    /// Why a mechanism is in its state.
    Reason: u32 {
        /// Nothing to report.
        None = 0, "none";
        /// An operator or a controller disarmed it.
        Disarmed = 1, "disarmed";
        /// No command came for longer than T2.
        CommandLost = 2, "command_lost";
        /// The bridge itself was stopped for longer than T2, or heard no motor for `feedback_ms`
        /// because it was late itself.
        Stalled = 3, "stalled";
        /// No command came since the request to arm.
        NoCommand = 4, "no_command";
        /// A motor has no offset in the configuration.
        NotCalibrated = 5, "not_calibrated";
        /// A motor's watchdog is off.
        WatchdogOff = 6, "watchdog_off";
        /// A motor's watchdog was not read, so it counts as off.
        WatchdogUnknown = 7, "watchdog_unknown";
        /// A motor does not measure, or has stopped measuring.
        FeedbackStale = 8, "feedback_stale";
        /// A motor reports a fault.
        MotorFault = 9, "motor_fault";
        /// A motor lost power while it was to be enabled.
        PowerLost = 10, "power_lost";
        /// Motors did not take power in time.
        ArmingTimeout = 11, "arming_timeout";
        /// The bus is error-passive.
        BusPassive = 12, "bus_passive";
        /// The bus is off.
        BusOff = 13, "bus_off";
        /// Earlier frames still wait to be sent.
        Backlog = 14, "backlog";
        /// Another mechanism failed, and the robot stops as a whole.
        OtherMechanism = 15, "other_mechanism";
        /// A motor's watchdog is longer than the configured one.
        WatchdogLong = 16, "watchdog_long";
        /// An actuator is beyond its position limit and moves outwards.
        PositionLimit = 17, "position_limit";
        /// An actuator is faster than its limit.
        VelocityLimit = 18, "velocity_limit";
        /// An actuator lags behind its set-point.
        FollowingError = 19, "following_error";
        /// A motor reports an effort that differs from the commanded one.
        EffortMismatch = 20, "effort_mismatch";
        /// A motor repeats one position while it must have moved.
        FeedbackFrozen = 21, "feedback_frozen";
        /// A position changed by more than the speed allows.
        FeedbackJump = 22, "feedback_jump";
        /// A motor answers old requests.
        FeedbackLate = 23, "feedback_late";
        /// A motor sent more answers than requests.
        SecondAnswer = 24, "second_answer";
        /// Another sender uses the bridge's own identifiers.
        SecondMaster = 25, "second_master";
        /// A motor is too hot.
        OverTemperature = 26, "over_temperature";
        /// An actuator is outside its limits, where arming is refused.
        OutsideLimits = 27, "outside_limits";
        /// An independent coordinate of the mechanism is beyond its limit.
        MechanismLimit = 28, "mechanism_limit";
        /// No pose of the mechanism has the measured positions.
        Unreachable = 29, "unreachable";
        /// The mechanism is too near to a singular pose.
        NearSingular = 30, "near_singular";
        /// Encoders of one closed loop contradict each other.
        LoopResidual = 31, "loop_residual";
        /// Reported efforts contradict the inverse dynamics of the model.
        ModelEffort = 32, "model_effort";
        /// An actuator moves, and power is given at rest only.
        Moving = 33, "moving";
        /// The configuration names a robot, and no record of its commissioning fits.
        NotCommissioned = 34, "not_commissioned";
        /// A motor is back at another position than the last known one: an operator confirms it.
        PositionChanged = 35, "position_changed";
        /// Something pushes a mechanism harder than its threshold.
        ExternalForce = 36, "external_force";
    }
}

wire_enum! {
    /// An operator's request to the bridge.
    Operation: u32 {
        /// Give the motors power as soon as all conditions hold.
        Arm = 1, "arm";
        /// Remove power.
        Disarm = 2, "disarm";
        /// Clear a fault; armed mechanisms stay armed.
        Reset = 3, "reset";
        /// Move actuators outside their limits back inside, slowly, then remove power.
        Return = 4, "return";
        /// Believe the positions of motors that differ from the last known ones.
        Confirm = 5, "confirm";
    }
}

/// Declares flags: each line is the documentation, the constant, its bit and its name.
macro_rules! flags {
    ($($(#[$doc:meta])* $flag:ident = $bit:literal, $name:literal;)*) => {
        $($(#[$doc])* pub const $flag: u32 = 1 << $bit;)*

        /// Name of each bit, from the lowest.
        pub const NAMES: &[&str] = &[$($name),*];
    };
}

/// Flags of single actuators, as bits.
pub mod flag {
    flags! {
        /// The effort was limited.
        EFFORT_LIMITED = 0, "effort_limited";
        /// The position was limited.
        POSITION_LIMITED = 1, "position_limited";
        /// The velocity was limited, or the commanded position changes faster than the limit.
        VELOCITY_LIMITED = 2, "velocity_limited";
        /// The commanded effort changes faster than its limit.
        RATE_LIMITED = 3, "rate_limited";
        /// Gains and efforts still grow after arming.
        RAMPING = 4, "ramping";
        /// Commands are late: the actuator is damped.
        DAMPED = 5, "damped";
        /// The measurement is missing or too old.
        STALE = 6, "stale";
        /// The motor reports a fault.
        MOTOR_FAULT = 7, "motor_fault";
        /// The motor has power.
        POWERED = 8, "powered";
        /// No motor drives it.
        NO_MOTOR = 9, "no_motor";
        /// The effort is reduced because the motor is hot.
        DERATED = 10, "derated";
        /// The actuator is brought to a standstill.
        STOPPING = 11, "stopping";
        /// An effort that pushes outwards beyond a position limit was removed.
        OUTWARD_LIMITED = 12, "outward_limited";
        /// The configuration waives the commissioning of the robot.
        UNCOMMISSIONED = 13, "uncommissioned";
        /// Nothing tells a frozen encoder from a joint at rest.
        FROZEN_UNDETECTABLE = 14, "frozen_undetectable";
        /// The motor is back at another position than the last known one.
        POSITION_CHANGED = 15, "position_changed";
    }

    /// The names of the bits that are set, from the lowest.
    pub fn names(bits: u32) -> Vec<&'static str> {
        let named = NAMES.iter().enumerate();
        named.filter(|(bit, _)| bits >> bit & 1 == 1).map(|(_, name)| *name).collect()
    }
}

/// One command for all actuators of a robot, in the order of u.
///
/// An actuator follows τ = effort + stiffness (position − measured) + damping (velocity −
/// measured), as far as its motor's mode allows. A controller that sends the command fills in
/// sequence, stamp and fingerprint.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ActuatorCommand {
    /// Increases with each command; any other command is rejected.
    pub sequence: u64,
    /// Time at which the command was computed, by the monotonic clock of this machine `[ns]`.
    pub stamp_ns: u64,
    /// Fingerprint of the model behind the command; 0 if the bridge has no model.
    pub fingerprint: u64,
    /// Number of actuators (n_u).
    pub n_u: u64,
    /// Position `[rad, m]`.
    pub position: [f64; MAX_ACTUATORS],
    /// Velocity `[rad/s, m/s]`.
    pub velocity: [f64; MAX_ACTUATORS],
    /// Moment or force, τ_u `[N m, N]`.
    pub effort: [f64; MAX_ACTUATORS],
    /// Stiffness `[N m/rad, N/m]`, at least 0.
    pub stiffness: [f64; MAX_ACTUATORS],
    /// Damping `[N m s/rad, N s/m]`, at least 0.
    pub damping: [f64; MAX_ACTUATORS],
}

impl Default for ActuatorCommand {
    fn default() -> ActuatorCommand {
        let zero = [0.0; MAX_ACTUATORS];
        ActuatorCommand {
            sequence: 0,
            stamp_ns: 0,
            fingerprint: 0,
            n_u: 0,
            position: zero,
            velocity: zero,
            effort: zero,
            stiffness: zero,
            damping: zero,
        }
    }
}

impl ActuatorCommand {
    /// Its lists with their names.
    pub fn lists(&mut self) -> [(&'static str, &mut [f64; MAX_ACTUATORS]); 5] {
        [
            ("position", &mut self.position),
            ("velocity", &mut self.velocity),
            ("effort", &mut self.effort),
            ("stiffness", &mut self.stiffness),
            ("damping", &mut self.damping),
        ]
    }
}

/// The state of all actuators after a cycle of the bridge, in the order of u.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ActuatorState {
    /// Number of the cycle.
    pub sequence: u64,
    /// Time of the cycle, by the monotonic clock of this machine `[ns]`.
    pub stamp_ns: u64,
    /// Fingerprint of the model; 0 without one.
    pub fingerprint: u64,
    /// Number of actuators (n_u).
    pub n_u: u64,
    /// Sequence of the last accepted command.
    pub command: u64,
    /// The worst of the mechanisms, a [`MechanismState`].
    pub state: u32,
    /// Why, a [`Reason`].
    pub reason: u32,
    /// The [`MechanismState`] of each actuator's mechanism.
    pub states: [u32; MAX_ACTUATORS],
    /// Why, a [`Reason`] each.
    pub reasons: [u32; MAX_ACTUATORS],
    /// Bits of [`flag`].
    pub flags: [u32; MAX_ACTUATORS],
    /// The motors' own codes of their faults; 0 without one.
    pub faults: [u32; MAX_ACTUATORS],
    /// Time of each measurement, by the monotonic clock `[ns]`; 0 for none.
    pub measured_ns: [u64; MAX_ACTUATORS],
    /// Position `[rad, m]`; NaN before the first measurement, here and below.
    pub position: [f64; MAX_ACTUATORS],
    /// Velocity `[rad/s, m/s]`.
    pub velocity: [f64; MAX_ACTUATORS],
    /// Moment or force `[N m, N]`.
    pub effort: [f64; MAX_ACTUATORS],
    /// Temperature of the motor `[°C]`.
    pub temperature: [f64; MAX_ACTUATORS],
}

impl Default for ActuatorState {
    fn default() -> ActuatorState {
        let unknown = [f64::NAN; MAX_ACTUATORS];
        ActuatorState {
            sequence: 0,
            stamp_ns: 0,
            fingerprint: 0,
            n_u: 0,
            command: 0,
            state: MechanismState::Disabled as u32,
            reason: Reason::None as u32,
            states: [0; MAX_ACTUATORS],
            reasons: [0; MAX_ACTUATORS],
            flags: [0; MAX_ACTUATORS],
            faults: [0; MAX_ACTUATORS],
            measured_ns: [0; MAX_ACTUATORS],
            position: unknown,
            velocity: unknown,
            effort: unknown,
            temperature: unknown,
        }
    }
}
