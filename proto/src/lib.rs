//! The wire contract of sarrus.
//!
//! Without the feature `transport` this crate is the vocabulary of the mathematics and the wire,
//! and has no dependencies: requests ([`Request`], [`Field`], [`Query`]), the packing of numbers
//! ([`Layout`]), the outcome of a request ([`Status`], [`Warnings`]) and the description of a robot
//! ([`ModelInfo`]). The feature adds the control socket and the shared memory.

pub mod actuators;
mod answer;
pub mod counts;
mod field;
mod fields;
mod fnv;
mod info;
mod layout;
mod query;
mod request;
mod rows;
mod status;
pub mod watch;
mod wire_enum;

#[cfg(feature = "transport")]
pub mod batch;
#[cfg(feature = "transport")]
pub mod board;
#[cfg(feature = "transport")]
pub mod bridge;
#[cfg(feature = "transport")]
pub mod checksum;
#[cfg(feature = "transport")]
pub mod control;
#[cfg(feature = "transport")]
mod domain;
#[cfg(feature = "transport")]
pub mod heartbeat;
#[cfg(feature = "transport")]
pub mod lane;
#[cfg(feature = "transport")]
mod mapping;
#[cfg(feature = "transport")]
pub mod message;
#[cfg(feature = "transport")]
mod node;
#[cfg(feature = "transport")]
pub mod run;
#[cfg(feature = "transport")]
pub mod service;
#[cfg(feature = "transport")]
pub mod socket;
#[cfg(feature = "transport")]
pub mod supervision;

pub use answer::{Answer, FailedState};
pub use field::{FieldSet, MAX_SOLUTIONS, TASK_NUMBERS};
pub use field::{MOST_VERTEX_COORDINATES, MOST_VERTICES, most_vertices};
pub use fields::{FIELDS, Field, FieldEntry};
pub use fnv::fnv1a_64;
pub use info::{ClosureInfo, ClosureKind, JointLimits, ModelInfo, TreeJoint};
pub use layout::{Layout, Sizes, Slot};
pub use query::{Axes, Query, QueryError, QueryOptions, Tolerance};
pub use query::{MAX_CONTACTS, MAX_DIRECTIONS, MAX_FRAMES, MAX_JOINT_RUNS, MAX_WRENCHES};
pub use request::{OF_ACTUATOR_FORCES, Request, TaskParts};
pub use rows::Rows;
pub use status::{Status, Warning, Warnings};

#[cfg(feature = "transport")]
pub use domain::{Domain, DomainError, DomainNode, MAX_NAME, ServerName};
#[cfg(feature = "transport")]
pub use mapping::{KeptWords, LeftWords, open_own, process_number};
#[cfg(feature = "transport")]
pub use message::PROTOCOL_VERSION;
#[cfg(feature = "transport")]
pub use node::Node;
