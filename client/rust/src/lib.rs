//! Client of the sarrus server.
//!
//! [`Robot`] is all there is to know: connect by name, [`Robot::prepare`] what is wanted,
//! [`Robot::ask`] as often as needed. When the server is killed and started again with the same
//! model, the client goes on by itself.

mod bridge;
mod control;
mod describe;
mod error;
mod local;
mod options;
mod remote;
mod robot;
mod wait;
mod wish;

pub use bridge::{Controller, Observer, now_ns};
pub use describe::describe;
pub use error::{ConnectError, Error};
pub use options::{ConnectOptions, Door, Patience};
pub use robot::{PlanId, Prepared, Robot};
pub use sarrus_dynamics::Answer;
pub use sarrus_models::{LoadError, Options, Source};
pub use sarrus_proto::message::Statistics;
pub use sarrus_proto::{
    Domain, Field, FieldSet, Layout, ModelInfo, Request, Status, Wanted, WantedError, Warnings,
};
pub use sarrus_proto::{actuators, watch};
pub use wish::Wish;
