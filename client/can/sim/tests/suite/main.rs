//! Drives and simulated motors against each other.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that fails panics"
)]

mod attack_table;
mod attacks;
mod authors;
mod chance;
mod cia402;
mod closed_loop;
mod disorder;
mod fault_logs;
mod limits;
mod moteus;
mod motors;
mod replay;
mod robots;
mod soak;
mod stops;
mod strangers;
mod support;
mod swing;
mod world;
