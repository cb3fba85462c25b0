//! Rust client of sarrus: dynamics of a robot in this process or on a server, and the CAN bridge.
//!
//! [`Robot::connect`] attaches to a robot on a server; [`Robot::load`] and [`Robot::from_model`]
//! create one in this process. Both have the same methods and return the same bits.
//! [`Robot::inverse_dynamics`] and its neighbours cover the common requests; [`Robot::query`]
//! prepares any other. If a server restarts with the same model, its clients reconnect
//! automatically. [`Controller`] sends commands to a CAN bridge and [`Observer`] monitors one.

mod batch;
mod bridge;
mod control;
mod describe;
mod direct;
mod error;
mod head;
mod interrupt;
#[cfg(feature = "kernels")]
mod kernels;
mod life;
mod local;
mod options;
mod plan;
pub mod processor;
mod query;
mod remote;
mod robot;
mod session;
mod view;
mod wait;

pub use bridge::{Controller, Observer, now_ns};
pub use describe::describe;
pub use error::{ConnectError, Error};
pub use head::Times;
pub use interrupt::interruptible;
#[cfg(feature = "kernels")]
pub use kernels::{AnsweredBy, KernelError, Kernels};
pub use life::{Life, ProcessState};
pub use options::{ConnectOptions, Transport, WaitStrategy};
pub use plan::{PlanId, Prepared};
pub use query::{QueryBuilder, UnknownName};
pub use robot::Robot;
pub use sarrus_dynamics::description;
pub use sarrus_dynamics::{
    CompileError, Compiled, CutBuilder, CutJoint, DescriptionBuilder, JointBuilder, LinkId, Model,
};
pub use sarrus_models::{LoadError, Lock, Options, Source};
pub use sarrus_proto::control::Holder;
pub use sarrus_proto::message::{ClientStatistics, Statistics};
pub use sarrus_proto::{
    Answer, Axes, Domain, FailedState, Field, FieldSet, Layout, ModelInfo, Query, QueryError,
    QueryOptions, Request, Status, TaskParts, Warning, Warnings,
};
pub use sarrus_proto::{actuators, watch, wire_enum};
pub use view::ServerView;

/// Result of attaching to a server and of calls on its control socket.
type Outcome<T = ()> = Result<T, ConnectError>;

/// The page for users: its programs are compiled, and run where they need no server.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
