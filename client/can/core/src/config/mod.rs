//! One robot's buses and motors, read from a YAML file and checked against the robot's model.
//!
//! ```yaml
//! # a bundled robot, or `urdf: FILE` with `submechanisms: FILE`; without either the motors name
//! # the actuators
//! robot: rh5v2_upper_body
//! commissioning: arm.commissioned  # the record that arming demands, or `none`
//! rate_hz: 500
//! timeouts: {damping_ms: 20, disable_ms: 100, feedback_ms: 20}
//! monitors: {temperature: 100}   # from where on measurements are doubted; each may be `off`
//! ramp_ms: 500              # gains and efforts grow to their full size in this time after arming
//! stop: mechanism           # or `robot`: the scope of a stop when a motor fails
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
mod commissioned;
mod configuration;
mod encoders;
#[cfg(feature = "files")]
mod files;
mod keys;
mod monitors;
mod motors;
mod plausible;
mod read;
mod reader;
mod stops;
mod values;

pub use commissioned::Commissioning;
pub use configuration::{
    BusConfig, Configuration, Limits, ModelRules, MotorConfig, Stop, Surroundings, Timeouts,
};
#[cfg(feature = "files")]
pub use files::ConfigurationError;
pub use sarrus_proto::actuators::MAX_ACTUATORS;
pub use sarrus_proto::watch::MAX_BUSES;
pub use values::{EncoderConfig, MechanismStop, MonitorBounds, StopFunction};
