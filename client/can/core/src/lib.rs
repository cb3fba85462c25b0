//! The CAN bridge of sarrus: turns actuator commands into motor frames and motor frames into
//! actuator state.
//!
//! No I/O, no clock: frames and times are arguments, and frames are results. Nothing allocates
//! after set-up. The motors' side of each protocol is `sarrus-can-sim`, the program is
//! `sarrus-can`.

#![forbid(unsafe_code)]

pub mod bit_stuffing;
pub mod bridge;
pub mod cholesky;
pub mod commissioning;
pub mod config;
pub mod drive;
mod event;
#[cfg(feature = "files")]
pub mod fault_files;
pub mod fault_log;
pub mod frame;
pub mod log;
pub mod mapping;
pub mod netlink;
pub mod protocol;
mod settings;
pub mod slcan;
pub mod state;
pub mod telemetry;

pub use config::bus_load;
