//! The values of a configuration, checked.

use std::sync::Arc;

use sarrus_dynamics::Model;
use sarrus_models::{Diagnostic, LoadError, Loaded, Source};
use sarrus_proto::actuators::Reason;

use super::commissioned::Commissioning;
use super::values::{EncoderConfig, MechanismStop, MonitorBounds};
use crate::drive::{Drive, Mode, Watchdog};
use crate::frame::Id;
use crate::mapping::Mapping;
use crate::protocol::{Common, Protocol, Settings};

/// Buses, motors and rules of one robot.
#[derive(Debug)]
#[non_exhaustive]
pub struct Configuration {
    /// The robot whose actuators they are; `None` without a model.
    pub robot: Option<String>,
    /// The source of the robot; `None` without a model.
    pub source: Option<Source>,
    /// Fingerprint of the model; 0 without one.
    pub fingerprint: u64,
    /// The robot's model; `None` without one.
    pub model: Option<Arc<Model>>,
    /// Bounds beyond which the model finds a fault.
    pub model_rules: ModelRules,
    /// Names of the actuators, in the order of u (n_u).
    pub actuators: Vec<String>,
    /// The closed mechanism that each actuator acts on (n_u); actuators of one number stop
    /// together.
    pub mechanisms: Vec<usize>,
    /// Cycles in a second `[Hz]`.
    pub rate_hz: f64,
    /// Timeouts.
    pub timeouts: Timeouts,
    /// Gains and efforts grow to their full size in this time after arming `[ns]`.
    pub ramp_ns: u64,
    /// Scope of a stop when a motor fails.
    pub stop: Stop,
    /// How each mechanism is stopped, by its number in `mechanisms`.
    pub stops: Vec<MechanismStop>,
    /// The buses.
    pub buses: Vec<BusConfig>,
    /// The motors, in the order of the file.
    pub motors: Vec<MotorConfig>,
    /// Encoders besides those of the motors.
    pub encoders: Vec<EncoderConfig>,
    /// Whether the robot's motors were commissioned, and the file of the record beside this one.
    pub commissioning: Commissioning,
    /// See `commissioning`.
    pub record_file: String,
    /// Warnings of the file.
    pub warnings: Vec<Diagnostic>,
}

/// Timeouts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timeouts {
    /// T1: commands older than this bring damping `[ns]`.
    pub damping_ns: u64,
    /// T2: commands older than this bring a stop `[ns]`.
    pub disable_ns: u64,
    /// A motor that has not measured for this time has failed `[ns]`; see
    /// [`Configuration::feedback_ns`].
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
    /// Part of `limits.effort` that an observed external force may ask of an actuator; 0 where
    /// none is observed.
    pub external: f64,
    /// The least clearance from a singular pose, from 0 to 1 at the mechanism's best pose; 0 where
    /// it is not assessed.
    pub clearance: f64,
}

/// Scope of a stop when a motor fails.
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
    /// Common settings of all drives.
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
    /// Swing of a dither of its set-points; 0 without one `[N m, N]`, in the mode position `[rad,
    /// m]`.
    pub dither: f64,
    /// Where it may rest without power `[rad, m]`.
    pub rest: Option<f64>,
    /// Bounds beyond which its measurements are doubted.
    pub monitors: MonitorBounds,
}

/// Limits of an actuator; infinite for one without a motor.
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
    /// No limits.
    pub const NONE: Limits = Limits {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
        effort_rate: f64::INFINITY,
    };

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

/// The heaviest inertia that a stop brakes, for its damping `[s]`.
const HEAVIEST: f64 = 0.4;

impl MotorConfig {
    /// The numbers of its identifiers, its own and those that several motors may use.
    pub fn numbers(&self) -> impl Iterator<Item = u32> {
        let shared = self.drive.shared_identifiers().into_iter().map(|shared| shared.id);
        self.drive.identifiers().into_iter().chain(shared).map(Id::number)
    }

    /// The largest damping that the motor can be given, which the spring goes with.
    pub(crate) fn most_damping(&self) -> f64 {
        match self.common.mode {
            Mode::Impedance => {
                let Mapping { gear, torque_constant, .. } = self.mapping;
                let [_, largest] = self.drive.largest_gains();
                largest * gear * gear * torque_constant
            }
            _ => f64::INFINITY,
        }
    }

    /// The deceleration that a stop has at least, τ_max / J with the heaviest inertia that its
    /// damping brakes, J = 0.4 s · d, or which the limits' own does `[rad/s², m/s²]`.
    pub(crate) fn braking(&self) -> f64 {
        self.limits.effort / (HEAVIEST * self.stop_damping().max(self.limits.damping()))
    }

    /// The damping with which the motor is stopped.
    pub fn stop_damping(&self) -> f64 {
        match self.common.mode {
            // whose damper has the rate of the bridge, and is no better for being stronger
            Mode::Torque if self.damping > 0.0 => self.damping,
            _ => self.damping.max(self.limits.damping()).min(self.most_damping()),
        }
    }

    /// The fault of the motor's own watchdog, as last reported; with one it must get no power.
    pub fn missing_watchdog(&self) -> Option<Reason> {
        self.wrong_watchdog(self.drive.state().watchdog)
    }

    /// The fault of a reported watchdog.
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

    /// Place of the actuator of a name.
    pub fn actuator(&self, name: &str) -> Option<usize> {
        self.actuators.iter().position(|known| known == name)
    }

    /// Cycles without an answer that are no silence: of frames lost with 2 % in each direction, so
    /// many in a row come once in 10¹¹ cycles.
    const LEAST_CYCLES: u64 = 8;

    /// Time between two cycles `[ns]`.
    pub fn period_ns(&self) -> u64 {
        (1e9 / self.rate_hz) as u64
    }

    /// A motor that has not measured for this time has failed: `feedback_ms`, and at least so many
    /// cycles that lost frames of a sound bus are no silence `[ns]`.
    pub fn feedback_ns(&self) -> u64 {
        self.timeouts.feedback_ns.max(Self::LEAST_CYCLES * self.period_ns())
    }

    /// A copy without its motors, whose drives belong to one bridge. Allocates.
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
            commissioning: self.commissioning.clone(),
            record_file: self.record_file.clone(),
            warnings: self.warnings.clone(),
            ..*self
        }
    }

    /// How many mechanisms there are.
    pub fn n_mechanisms(&self) -> usize {
        self.mechanisms.iter().max().map_or(0, |last| last + 1)
    }
}
