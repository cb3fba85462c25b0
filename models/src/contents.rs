//! The contents of a robot's files, read but not yet understood.

use std::path::PathBuf;

/// The contents of a source, with the names that messages give them.
#[derive(Clone)]
pub(crate) struct Contents {
    pub(crate) urdf: (String, Vec<u8>),
    pub(crate) submechanisms: Option<(String, Vec<u8>)>,
    /// The folder of the files that the submechanisms name.
    pub(crate) folder: Option<PathBuf>,
}
