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
mod query;
mod remote;
mod robot;
mod wait;

pub use bridge::{Controller, Observer, now_ns};
pub use describe::describe;
pub use error::{ConnectError, Error};
pub use options::{ConnectOptions, Transport, WaitStrategy};
pub use query::QueryBuilder;
pub use robot::{PlanId, Prepared, Robot};
pub use sarrus_dynamics::Answer;
pub use sarrus_models::{LoadError, Options, Source};
pub use sarrus_proto::message::Statistics;
pub use sarrus_proto::{
    Domain, Field, FieldSet, Layout, ModelInfo, Query, QueryError, Request, Status, Warnings,
};
pub use sarrus_proto::{actuators, watch};
