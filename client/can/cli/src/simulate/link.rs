//! A link to a pseudo-terminal, at a path that configurations can name.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

/// Removed when it is dropped.
pub(super) struct Link {
    path: PathBuf,
    target: PathBuf,
}

impl Link {
    /// Makes a link, in place of an older one to a pseudo-terminal; nothing else is ever replaced.
    pub(super) fn make(target: &str, path: &Path) -> Result<Link, String> {
        let refused = |why: &str| format!("{} cannot be made: {why}", path.display());
        match std::fs::read_link(path) {
            Ok(old) if old.starts_with("/dev/pts") => {
                std::fs::remove_file(path).map_err(|error| refused(&error.to_string()))?
            }
            Ok(_) => return Err(refused("there is a link to something else")),
            Err(_) if path.exists() => {
                return Err(refused("there is a file of that name; give another one with --link"));
            }
            Err(_) => {}
        }
        symlink(target, path).map_err(|error| refused(&error.to_string()))?;
        Ok(Link { path: path.to_owned(), target: PathBuf::from(target) })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if std::fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}
