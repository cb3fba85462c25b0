//! Reports of sarrus on itself: error against run time on the same models and states.
//!
//! [`run()`] measures the sections of a report (error against run time, time integration, stress
//! cases) and writes them as a page that opens offline, with its data as JSON and CSV. [`robots`],
//! [`mod@reference`] and [`measure`] serve programs that measure more.
//!
//! Each module depends only on those above it:
//!
//! ```text
//! csv_rows   rows of cells as CSV                       measure    machine, times, progress
//! robots     robots, questions, states
//! page       figures, sections, HTML, JSON, CSV          reference  the same in double-double
//! peer       other engines on the same states
//! accuracy   parts   generated   integration   stress    one section each
//! run        all sections into a folder
//! ```

mod accuracy;
pub mod csv_rows;
#[cfg(feature = "generate")]
mod generated;
pub mod integration;
pub mod measure;
pub mod page;
mod parts;
pub mod peer;
pub mod reference;
pub mod robots;
mod run;
mod stress;

pub use self::run::{Options, names, run, synonyms};

/// Result of measuring and writing a report; the error names the reason.
pub type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;
