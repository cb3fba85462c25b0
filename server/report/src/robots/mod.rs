//! The robots of the report, their questions and their states.

pub mod catalogue;
pub mod chain;
pub mod question;
pub mod random;
pub mod small;
pub mod states;
mod texts;

pub use self::catalogue::{Subject, Variant};
pub use self::question::{Question, Start};
pub use self::states::{Robot, State, packed};
