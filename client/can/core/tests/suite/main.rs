//! Protocols against independent decoders, golden frames and hostile bytes.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that fails panics"
)]

mod ak_servo;
mod cia402;
mod cybergear;
mod dbc;
mod mit;
mod mit_power;
mod moteus;
mod odrive;
mod rmd;
mod support;
mod vesc;
