//! The protocols. To add one: a file here with its [`Protocol`], and its line in [`PROTOCOLS`].

mod ak_servo;
mod cia402;
mod codes;
mod cybergear;
mod dbc;
pub mod fault;
mod keys;
mod mit;
mod moteus;
mod number;
mod odrive;
mod power_up;
mod rmd;
mod scale;
mod turns;
mod vesc;

use sarrus_models::Diagnostics;

pub use self::mit::Variant as MitVariant;
use crate::drive::{Drive, Mode};
pub use crate::settings::{Key, KeyKind, Settings};

/// Settings common to all drives.
#[derive(Clone, Copy, Debug)]
pub struct Common {
    /// Mode of the motor's controller; one of [`Protocol::modes`].
    pub mode: Mode,
    /// Desired watchdog of the motor `[ms]`; 0 leaves it unchanged.
    pub watchdog_ms: u32,
    /// Torque limit `[N m]`, for drives that hold a limit themselves; infinite without one.
    pub torque_limit: f64,
    /// Speed limit `[rad/s]`, for the same drives; infinite without one.
    pub velocity_limit: f64,
    /// Time between two cycles `[ns]`; 0 if unknown.
    pub period_ns: u64,
}

/// A drive; `None` where its settings contradict each other.
pub type Made = Option<Box<dyn Drive>>;

/// A protocol: its name and settings in configurations, and how its drives are made.
#[derive(Debug)]
pub struct Protocol {
    /// Name in configurations.
    pub name: &'static str,
    /// One line for people.
    pub about: &'static str,
    /// Modes that it knows, the default first.
    pub modes: &'static [Mode],
    /// Whether it needs CAN FD.
    pub fd: bool,
    /// Settings besides the common ones.
    pub keys: &'static [Key],
    /// Makes a drive from checked settings; contradictions are reported to the diagnostics.
    pub make: fn(&Settings, Common, &mut Diagnostics) -> Made,
}

/// All protocols.
pub const PROTOCOLS: &[&Protocol] = &[
    &mit::MIT,
    &odrive::ODRIVE,
    &cybergear::CYBERGEAR,
    &moteus::MOTEUS,
    &cia402::CIA402,
    &rmd::RMD,
    &vesc::VESC,
    &ak_servo::AK_SERVO,
    &dbc::DBC,
];

/// The protocol of a name.
pub fn protocol(name: &str) -> Option<&'static Protocol> {
    PROTOCOLS.iter().copied().find(|protocol| protocol.name == name)
}
