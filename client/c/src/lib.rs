//! libsarrus: the Rust client for C and C++.
//!
//! Its header is `client/c/include/sarrus.h`. cbindgen writes it from the comments in this crate,
//! which therefore address readers of C, and from the numbers and payloads of `sarrus-proto` that
//! travel. Each function of the header calls the method of [`sarrus_client`] with the same name.
//! Handles are boxes, options are plain structures, and a failure is a [`StatusCode`] with a text
//! that is kept for each thread.
#![allow(clippy::missing_safety_doc, reason = "the header states the rules for all pointers")]

mod border;
mod failure;

pub mod bridge;
pub mod direct;
pub mod model;
pub mod names;
pub mod options;
pub mod plan;
pub mod robot;
pub mod status;

pub use status::StatusCode;
