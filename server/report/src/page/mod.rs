//! The page: sections of figures, tables and stress cases, written as HTML, JSON and CSV.
//!
//! Errors are by size, max |x − reference| / max(|reference| of that quantity, tiny). An error of
//! exactly zero is drawn at [`DRAWN_FOR_ZERO`] or lower, with a tick of its own.

mod data;
mod figure;
pub(crate) mod files;
mod html;
pub(crate) mod pareto;
mod picture;
mod scale;
mod section;
#[cfg(test)]
mod tests;

pub use self::figure::{Axis, DRAWN_FOR_ZERO, Figure, Point, Series};
pub(crate) use self::pareto::{PEERS, PROGRAMS, exponent, is_peer, pareto_front};
pub use self::section::{Assessment, Case, Report, Section, Table};
pub(crate) use self::section::{columns, command};
