//! Protocols against independent decoders, golden frames and hostile bytes.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that fails panics"
)]

mod cia402;
mod cybergear;
mod dbc;
mod mit;
mod moteus;
mod odrive;
mod support;
