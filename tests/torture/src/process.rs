//! Files, descriptors and state of other processes, as seen from outside.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use rustix::process::{Pid, Signal, kill_process};
use sarrus_proto::Domain;

/// The kernel's folder of named shared memory.
pub const SHARED_MEMORY: &str = "/dev/shm";

/// Sends a signal to a process.
pub fn send_signal(process: u32, signal: Signal) {
    if let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) {
        let _ = kill_process(pid, signal);
    }
}

/// The letter for the state of a process in `/proc/ID/stat`.
pub fn state_of(process: u32) -> Option<char> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    text.rsplit(')').next()?.trim_start().chars().next()
}

/// The number of open descriptors of a process.
pub fn descriptors(process: u32) -> usize {
    fs::read_dir(format!("/proc/{process}/fd")).map_or(0, Iterator::count)
}

/// The number of batch areas that a process has mapped.
pub fn batch_areas(process: u32) -> usize {
    let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
    maps.lines().filter(|line| line.contains("sarrus-batch")).count()
}

/// The files in shared memory whose names begin with `prefix`.
pub fn shared_files(prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    let ours = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix)));
    ours.map(|entry| entry.path()).collect()
}

/// The files of a domain: its root, everything below it, and its shared memory.
pub fn files_of(domain: &Domain) -> BTreeSet<PathBuf> {
    fn walk(folder: &Path, found: &mut BTreeSet<PathBuf>) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            walk(&entry.path(), found);
            found.insert(entry.path());
        }
    }
    let root = domain.root();
    let mut found = BTreeSet::new();
    if root.exists() {
        found.insert(root.to_owned());
    }
    walk(root, &mut found);
    found.extend(shared_files(&domain.prefix()));
    found
}

/// Removes the files of a domain.
pub fn remove_files_of(domain: &Domain) {
    for path in files_of(domain).into_iter().rev() {
        let _ = if path.is_dir() { fs::remove_dir(&path) } else { fs::remove_file(&path) };
    }
}
