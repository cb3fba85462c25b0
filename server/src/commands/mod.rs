//! One file or folder for each command.

pub(crate) mod ask;
pub(crate) mod check;
pub(crate) mod completions;
pub(crate) mod demo;
pub(crate) mod doctor;
#[cfg(feature = "generate")]
pub(crate) mod generate;
pub(crate) mod kernel;
pub(crate) mod man;
pub(crate) mod output;
pub(crate) mod progress;
pub(crate) mod replay;
#[cfg(feature = "report")]
pub(crate) mod report;
pub(crate) mod robot;
pub(crate) mod robots;
pub(crate) mod serve;
#[cfg(feature = "simulate")]
pub(crate) mod simulate;
pub(crate) mod tidy;
pub(crate) mod top;
