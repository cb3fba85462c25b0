//! The helper of the checks' tests.

use std::fs;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use super::{Check, line};

static FOLDERS: AtomicU32 = AtomicU32::new(0);

/// The findings of a check, as lines, in a folder with these files.
pub(super) fn judge(check: Check, files: &[(&str, &str)]) -> Vec<String> {
    let number = FOLDERS.fetch_add(1, Relaxed);
    let root = std::env::temp_dir().join(format!("sarrus-doctor-{}-{number}", std::process::id()));
    fs::create_dir(&root).unwrap();
    for (path, text) in files {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let found = check(&root).iter().map(line).collect();
    fs::remove_dir_all(&root).unwrap();
    found
}
