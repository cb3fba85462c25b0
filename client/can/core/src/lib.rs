//! The CAN bridge of sarrus: what turns actuator commands into motor frames and motor frames into
//! actuator state.
//!
//! No I/O, no clock: frames and times are arguments, and frames are results. Nothing allocates
//! after set-up.
#![forbid(unsafe_code)]

pub mod bits;
pub mod bridge;
pub mod config;
pub mod drive;
pub mod frame;
pub mod interface;
pub mod load;
pub mod log;
pub mod mapping;
pub mod motor;
pub mod protocol;
mod settings;
pub mod slcan;
pub mod telemetry;
