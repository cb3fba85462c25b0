//! One robot's buses and motors, read from a YAML file and checked against the robot's model.
//!
//! ```yaml
//! # a bundled robot, or `urdf: FILE` with `submechanisms: FILE`; without either the motors name
//! # the actuators
//! robot: rh5v2_upper_body
//! rate_hz: 500
//! timeouts: {damping_ms: 20, disable_ms: 100, feedback_ms: 20}
//! monitors: {temperature: 100}   # from where on measurements are doubted; each may be `off`
//! ramp_ms: 500              # gains and efforts grow to their full size in this time after arming
//! stop: mechanism           # or `robot`: what stops when a motor fails
//! model: {effort: 0.3, clearance: 0.2}  # how far the robot may be from its model
//! stop_function: ss1        # how it stops: to a standstill within `stop_ms`, then no torque
//! stop_ms: 500
//! mechanisms:               # those that stop otherwise, each named by one of its actuators
//! - {actuator: ALElbowAct, stop_function: lower, hold_ms: 5000, lower_velocity: 0.02}
//! buses:
//! - {name: left_arm, interface: socketcan, channel: can0, bitrate: 1000000}
//! motors:
//! - actuator: ALElbowAct
//!   bus: left_arm
//!   drive: {protocol: mit, variant: damiao, id: 4, reply_id: 20, position_range: 12.5, ...}
//!   sign: -1
//!   gear: 3141.6
//!   offset: 0.12
//!   limits: {position: [-0.2, 0.2], velocity: 0.5, effort: 2000, effort_rate: 50000}
//!   damping: 30
//!   watchdog_ms: 50
//! ```

pub mod bus_load;
mod check;
mod encoders;
#[cfg(feature = "files")]
mod files;
mod keys;
mod monitors;
mod motors;
mod plausible;
mod read;
mod stops;

pub use encoders::EncoderConfig;
#[cfg(feature = "files")]
pub use files::ConfigurationError;
pub use monitors::MonitorBounds;
pub use stops::{MechanismStop, StopFunction};

use std::sync::Arc;

use crate::drive::{Drive, Watchdog};
use crate::mapping::Mapping;
use crate::protocol::{Common, Protocol, Settings};
use sarrus_dynamics::Model;
use sarrus_models::{Diagnostic, LoadError, Loaded, Source};
pub use sarrus_proto::actuators::MAX_ACTUATORS;
use sarrus_proto::actuators::Reason;
pub use sarrus_proto::watch::MAX_BUSES;

/// Buses, motors and rules of one robot.
#[derive(Debug)]
#[non_exhaustive]
pub struct Configuration {
    /// The robot whose actuators they are; `None` without a model.
    pub robot: Option<String>,
    /// Where the robot comes from; `None` without a model.
    pub source: Option<Source>,
    /// Fingerprint of the model; 0 without one.
    pub fingerprint: u64,
    /// The robot's model; `None` without one.
    pub model: Option<Arc<Model>>,
    /// From when on the model finds something wrong.
    pub model_rules: ModelRules,
    /// Names of the actuators, in the order of u (n_u).
    pub actuators: Vec<String>,
    /// The closed mechanism that each actuator acts on (n_u); actuators of one number stop
    /// together.
    pub mechanisms: Vec<usize>,
    /// Cycles in a second `[Hz]`.
    pub rate_hz: f64,
    /// Times after which something is done.
    pub timeouts: Timeouts,
    /// Gains and efforts grow to their full size in this time after arming `[ns]`.
    pub ramp_ns: u64,
    /// What stops when a motor fails.
    pub stop: Stop,
    /// How each mechanism is stopped, by its number in `mechanisms`.
    pub stops: Vec<MechanismStop>,
    /// The buses.
    pub buses: Vec<BusConfig>,
    /// The motors, in the order of the file.
    pub motors: Vec<MotorConfig>,
    /// Encoders besides those of the motors.
    pub encoders: Vec<EncoderConfig>,
    /// What may stay but should be known.
    pub warnings: Vec<Diagnostic>,
}

/// Times after which something is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// T1: commands older than this bring damping `[ns]`.
    pub damping_ns: u64,
    /// T2: commands older than this bring a stop `[ns]`.
    pub disable_ns: u64,
    /// A motor that has not measured for this time has failed `[ns]`.
    pub feedback_ns: u64,
    /// Arming that takes longer has failed `[ns]`.
    pub arming_ns: u64,
}

/// From when on the model finds something wrong with a mechanism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelRules {
    /// Part of `limits.effort` by which reported efforts may differ from those of the model; 0
    /// where they are not compared.
    pub effort: f64,
    /// The least clearance from a singular pose, from 0 to 1 at the mechanism's best pose; 0 where
    /// it is not assessed.
    pub clearance: f64,
}

/// What stops when a motor fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// All actuators of the closed mechanism.
    Mechanism,
    /// The whole robot.
    Robot,
}

/// A bus.
#[derive(Clone, Debug, PartialEq)]
pub struct BusConfig {
    /// Name in this configuration.
    pub name: String,
    /// How it is reached, in python-can's words: `socketcan`, `slcan`, `pcan`, ….
    pub interface: String,
    /// Which of them: `can0`, `/dev/ttyACM0`, ….
    pub channel: String,
    /// Bit rate `[bit/s]`.
    pub bitrate: u32,
    /// Bit rate of the data of FD frames `[bit/s]`; `None` for a classic bus.
    pub data_bitrate: Option<u32>,
}

/// A motor and the actuator that it drives.
#[derive(Debug)]
pub struct MotorConfig {
    /// Place of the actuator in u.
    pub actuator: usize,
    /// Place of the bus.
    pub bus: usize,
    /// Its protocol.
    pub protocol: &'static Protocol,
    /// Settings of the protocol.
    pub settings: Settings,
    /// What all drives are made from.
    pub common: Common,
    /// The bridge's half of the talk with it.
    pub drive: Box<dyn Drive>,
    /// From actuator to motor.
    pub mapping: Mapping,
    /// The offset stands in the file: the motor knows where the robot is.
    pub is_calibrated: bool,
    /// The motor's watchdog is taken on trust where its protocol cannot read it.
    pub watchdog_believed: bool,
    /// Limits of the actuator.
    pub limits: Limits,
    /// Damping while commands are late `[N m s/rad, N s/m]`; where the file has none it is
    /// [`Limits::damping`].
    pub damping: f64,
    /// From where on what it measures is doubted.
    pub monitors: MonitorBounds,
}

/// Limits of an actuator; infinite where there is none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least position `[rad, m]`.
    pub lower: f64,
    /// Greatest position `[rad, m]`.
    pub upper: f64,
    /// Greatest speed of a set-point `[rad/s, m/s]`.
    pub velocity: f64,
    /// Greatest effort `[N m, N]`.
    pub effort: f64,
    /// Greatest change of the effort in time `[N m/s, N/s]`.
    pub effort_rate: f64,
}

impl Limits {
    /// Speed that the greatest effort is to brake where no limit is known `[rad/s, m/s]`.
    const SPEED: f64 = 10.0;

    /// The greatest velocity, ten units in a second where there is no limit `[rad/s, m/s]`.
    pub fn speed(&self) -> f64 {
        if self.velocity.is_finite() { self.velocity } else { Self::SPEED }
    }

    /// A damping that brakes [`Limits::speed`] with the greatest effort `[N m s/rad, N s/m]`.
    pub fn damping(&self) -> f64 {
        self.effort / self.speed()
    }
}

impl MotorConfig {
    /// What is wrong with the motor's own watchdog, as far as it has reported; without one nothing
    /// may give it power.
    pub fn missing_watchdog(&self) -> Option<Reason> {
        self.wrong_watchdog(self.drive.state().watchdog)
    }

    /// The same of what was reported.
    pub(crate) fn wrong_watchdog(&self, watchdog: Watchdog) -> Option<Reason> {
        // some protocols count in steps of ten
        let longest = self.common.watchdog_ms.next_multiple_of(10);
        match watchdog {
            Watchdog::Off | Watchdog::Set(0) => Some(Reason::WatchdogOff),
            Watchdog::Set(ms) if ms > longest => Some(Reason::WatchdogLong),
            Watchdog::Unknown => Some(Reason::WatchdogUnknown),
            Watchdog::Unreadable if !self.watchdog_believed => Some(Reason::WatchdogUnknown),
            Watchdog::Set(_) | Watchdog::Unreadable => None,
        }
    }
}

/// The files beside a configuration, and its robot: how [`Configuration::read`] gets at them.
pub struct Surroundings<'a> {
    /// The content of a file beside the configuration, or why there is none.
    pub file: &'a dyn Fn(&str) -> Result<String, String>,
    /// The robot of a source; paths in it are as the configuration has them.
    pub robot: &'a dyn Fn(&Source) -> Result<Loaded, LoadError>,
}

impl Configuration {
    /// Place of the bus of a name.
    pub fn bus(&self, name: &str) -> Option<usize> {
        self.buses.iter().position(|bus| bus.name == name)
    }

    /// Time between two cycles `[ns]`.
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz) as u64
    }

    /// The same without its motors, whose drives are one bridge's alone. Allocates.
    pub fn without_motors(&self) -> Configuration {
        Configuration {
            robot: self.robot.clone(),
            source: self.source.clone(),
            model: self.model.clone(),
            actuators: self.actuators.clone(),
            mechanisms: self.mechanisms.clone(),
            stops: self.stops.clone(),
            buses: self.buses.clone(),
            motors: Vec::new(),
            encoders: self.encoders.clone(),
            warnings: self.warnings.clone(),
            ..*self
        }
    }

    /// How many mechanisms there are.
    pub fn n_mechanisms(&self) -> usize {
        self.mechanisms.iter().max().map_or(0, |last| last + 1)
    }
}
