//! libsarrus: the Rust client for C and C++.
//!
//! Its header is `client/c/include/sarrus.h`. cbindgen writes it from the comments in this crate,
//! which therefore address readers of C, and from the payloads of bridges in `sarrus-proto`. Each
//! function of the header calls the method of [`sarrus_client`] with the same name. Handles are
//! boxes, options are plain structures, and a failure is a [`StatusCode`] with a text that is kept
//! for each thread.
#![allow(clippy::missing_safety_doc, reason = "the header states the rules for all pointers")]

mod border;
mod failure;
mod text;

// the order of the header
pub mod status;

pub mod names;

pub mod options;

pub mod robot;

pub mod model;

pub mod plan;

pub mod direct;

pub mod actuators;

// read by cbindgen alone: the payloads of a bridge, which C has as they travel
#[cfg(cbindgen)]
#[path = "../../../proto/src/actuators.rs"]
mod payloads;

pub mod bridge;

pub use status::StatusCode;
