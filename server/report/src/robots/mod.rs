//! The robots of the report, their questions and their states.

pub mod catalogue;
pub mod chain;
pub(crate) mod planned;
pub mod question;
pub mod random;
mod rare;
pub mod small;
pub mod states;

pub use self::catalogue::{Own, Subject, Variant};
pub(crate) use self::planned::Planned;
pub(crate) use self::question::links_by_bodies;
pub use self::question::{Question, Start};
pub use self::states::{Robot, State, packed, within_limits};
