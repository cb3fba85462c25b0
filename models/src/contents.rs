//! The contents of a robot's files, read but not yet understood.

use std::path::{Path, PathBuf};

use crate::error::LoadError;
use crate::text;

/// The contents of a source, with the names that messages give them.
pub(crate) struct Contents {
    pub(crate) urdf: (String, Vec<u8>),
    pub(crate) submechanisms: Option<(String, Vec<u8>)>,
    /// Where the files lie that the submechanisms name.
    pub(crate) folder: Option<PathBuf>,
}

/// A file's name for messages and its bytes.
pub(crate) fn file(path: &Path) -> Result<(String, Vec<u8>), LoadError> {
    Ok((path.display().to_string(), text::read(path)?))
}
