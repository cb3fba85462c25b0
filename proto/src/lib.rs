//! The wire contract of sarrus.
//!
//! Without the feature `transport` this crate is the vocabulary that the mathematics and the wire share and depends on
//! nothing: what can be asked ([`Request`], [`Field`], [`Wanted`]), how numbers are packed ([`Layout`]) and how an
//! answer ends ([`Status`], [`Warnings`]). With it, it also holds the services over shared memory.
#![forbid(unsafe_code)]

mod field;
mod layout;
mod status;
mod wanted;

pub use field::{Field, FieldSet};
pub use layout::{Layout, Sizes, Slot};
pub use status::{Status, Warnings};
pub use wanted::{MAX_FRAMES, MAX_WRENCHES, Request, Wanted, WantedError};
