//! The machine of a run.

use rustix::thread::sched_getaffinity;

use crate::Outcome;

/// The processors' name, the number of those that this process may use, and their other load.
///
/// # Errors
///
/// A system that does not report the allowed processors.
pub fn machine() -> Outcome<String> {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let info = read("/proc/cpuinfo");
    let model = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map_or("unknown processor", |pair| pair.1);
    let count = sched_getaffinity(None)?.count();
    let load = read("/proc/loadavg");
    let load = load.split(' ').next().unwrap_or("unknown");
    Ok(format!("{model}, {count} processors; load at the end {load}"))
}
