//! Files of the kernel and of the administrator, below a folder.

use std::fs::{self, Metadata};
use std::io::Read;
use std::path::{Path, PathBuf};

use super::Finding;

/// Bytes of a file that are read.
const LONGEST: u64 = 4 << 20;

/// The folder that stands for the root.
pub(super) struct Files {
    root: PathBuf,
}

impl Files {
    pub(super) fn below(root: &Path) -> Files {
        Files { root: root.to_owned() }
    }

    /// The place of a path, which is given from the root without its first `/`.
    pub(super) fn path(&self, path: &str) -> PathBuf {
        self.root.join(path)
    }

    /// The trimmed text of a file; none of a file that cannot be read.
    pub(super) fn text(&self, path: &str) -> Option<String> {
        let bytes = self.bytes(path)?;
        Some(String::from_utf8_lossy(&bytes).trim().to_owned())
    }

    pub(super) fn bytes(&self, path: &str) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        fs::File::open(self.path(path)).ok()?.take(LONGEST).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    /// The names in a folder, in order.
    pub(super) fn names(&self, path: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(path)).into_iter().flatten().flatten();
        let mut names: Vec<String> =
            entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }

    pub(super) fn metadata(&self, path: &str) -> Option<Metadata> {
        fs::metadata(self.path(path)).ok()
    }

    /// Whether this is the machine itself.
    pub(super) fn is_machine(&self) -> bool {
        self.root == Path::new("/")
    }
}

/// The numbers of a list of processors such as `0-3,5`.
pub(super) fn processors(text: &str) -> Option<Vec<usize>> {
    let mut found = Vec::new();
    for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let [first, last]: [usize; 2] = [first.parse().ok()?, last.parse().ok()?];
        if first > last || last >= 1 << 16 {
            return None;
        }
        found.extend(first..=last);
    }
    Some(found)
}

/// The finding for a text that no known kernel writes.
pub(super) fn unreadable(check: &'static str, path: &str, text: &str, expected: &str) -> Finding {
    let shown: String = text.chars().filter(|letter| !letter.is_control()).take(40).collect();
    Finding::new(
        check,
        format!("/{path} reads `{shown}`"),
        expected,
        "this version cannot judge it: look at it by hand",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_processors_are_read() {
        assert_eq!(processors("0-3,5\n"), Some(vec![0, 1, 2, 3, 5]));
        assert_eq!(processors(""), Some(vec![]));
        for garbage in ["a", "3-1", "1-", "0-99999999999", "1;2"] {
            assert_eq!(processors(garbage), None, "{garbage}");
        }
    }
}
