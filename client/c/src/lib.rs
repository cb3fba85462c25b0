//! libsarrus: the Rust client for C and C++.
//!
//! What C sees of it is `client/c/include/sarrus.h`, which cbindgen writes from the comments here:
//! they speak to readers of C. Each function of the header is [`sarrus_client`]'s method of the
//! same name. Handles are boxes, options are plain structures, and a failure is a [`StatusCode`]
//! with a text that stays with the thread.
#![allow(clippy::missing_safety_doc, reason = "what holds for all pointers is said in the header")]

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

pub mod bridge;

pub use status::StatusCode;
