//! One motor and what the bridge knows of it.

use sarrus_proto::actuators::Reason;

use super::stop::Reference;
use crate::config::MotorConfig;
use crate::drive::{Measurement, Mode, Watchdog};
use crate::mapping::ActuatorMeasurement;

/// A motor.
#[derive(Debug)]
pub(super) struct Motor {
    pub(super) config: MotorConfig,
    pub(super) measured: ActuatorMeasurement,
    /// When it last measured `[ns]`.
    pub(super) measured_ns: Option<u64>,
    /// It answers; its drive has something to forget.
    is_known: bool,
    /// When it was last asked `[ns]`; `None` once it has answered.
    pub(super) sent_ns: Option<u64>,
    /// Bits of what was limited in the last set-point.
    pub(super) flags: u32,
    /// Where it was when it began to follow, or when commands became late `[rad, m]`.
    pub(super) hold: f64,
    /// How far its spring was drawn when commands became late `[rad, m]`.
    deflection: f64,
    /// The last set-point's position and effort.
    pub(super) last_position: f64,
    pub(super) last_effort: f64,
    /// What keeps it still against gravity, by the model; 0 without one `[N m, N]`.
    pub(super) gravity: f64,
    /// Damping of stops: the configured one, or more where that could not stop `[N m s/rad, N
    /// s/m]`.
    pub(super) stop_damping: f64,
    pub(super) stop: Reference,
}

impl Motor {
    pub(super) fn new(config: MotorConfig) -> Motor {
        let stop_damping = match config.common.mode {
            // whose damper has the rate of the bridge, and is no better for being stronger
            Mode::Torque if config.damping > 0.0 => config.damping,
            _ => config.damping.max(config.limits.damping()),
        };
        Motor {
            config,
            measured: ActuatorMeasurement::NONE,
            measured_ns: None,
            is_known: false,
            sent_ns: None,
            flags: 0,
            hold: 0.0,
            deflection: 0.0,
            last_position: 0.0,
            last_effort: 0.0,
            gravity: 0.0,
            stop_damping,
            stop: Reference::default(),
        }
    }

    /// Takes a measurement with a position; gives the time since the motor was asked `[ns]`, once.
    pub(super) fn measured(&mut self, now_ns: u64, measured: &Measurement) -> Option<u64> {
        if !measured.position.is_finite() {
            return None;
        }
        self.measured = self.config.mapping.to_actuator(measured);
        (self.measured_ns, self.is_known) = (Some(now_ns), true);
        self.sent_ns.take().map(|sent| now_ns.saturating_sub(sent))
    }

    pub(super) fn is_stale(&self, now_ns: u64, feedback_ns: u64) -> bool {
        self.measured_ns.is_none_or(|measured| now_ns.saturating_sub(measured) > feedback_ns)
    }

    /// A motor that no longer answers may come back without what it was given.
    pub(super) fn forget_if_stale(&mut self, now_ns: u64, feedback_ns: u64) {
        if self.is_known && self.is_stale(now_ns, feedback_ns) {
            self.is_known = false;
            self.config.drive.forget();
        }
    }

    /// Where it is, as far as it ever said.
    pub(super) fn place(&self) -> f64 {
        if self.measured.position.is_finite() { self.measured.position } else { self.hold }
    }

    /// Goes over a time that a log leaves out.
    pub(super) fn resume_log(&mut self, now_ns: u64) {
        self.measured_ns = self.measured_ns.map(|_| now_ns);
        self.sent_ns = None;
        self.hold();
    }

    /// Begins to follow from where it is.
    pub(super) fn hold(&mut self) {
        self.hold = self.place();
        (self.last_position, self.last_effort) = (self.hold, 0.0);
    }

    /// Commands became late.
    pub(super) fn late(&mut self) {
        self.hold = self.place();
        self.deflection = match self.config.common.mode {
            Mode::Impedance | Mode::Torque => self.last_position - self.hold,
            // whose controllers hold loads by themselves
            Mode::Position | Mode::Velocity => 0.0,
        };
    }

    /// Commands came back: the way to the desired position begins where the actuator is, or as far
    /// on the way as its spring was drawn before, so that a load is held as before.
    pub(super) fn resume(&mut self, desired: f64) {
        let place = self.place();
        self.last_position =
            (place + self.deflection).max(place.min(desired)).min(place.max(desired));
    }

    /// Why it cannot be armed, however long one waits.
    pub(super) fn never_ready(&self) -> Option<Reason> {
        match self.config.drive.state().watchdog {
            _ if !self.config.is_calibrated => Some(Reason::NotCalibrated),
            Watchdog::Unreadable => self.config.missing_watchdog(),
            _ => None,
        }
    }

    /// What arming still waits for.
    pub(super) fn missing(&self, now_ns: u64, feedback_ns: u64) -> Option<Reason> {
        let state = self.config.drive.state();
        if self.is_stale(now_ns, feedback_ns) {
            return Some(Reason::FeedbackStale);
        }
        if state.fault != 0 {
            return Some(Reason::MotorFault);
        }
        self.config.missing_watchdog()
    }
}
