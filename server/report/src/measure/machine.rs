//! The machine of a run.

use super::cores::Cores;

/// The processors' name, their number and their other load.
pub fn machine(cores: &Cores) -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let info = read("/proc/cpuinfo");
    let model = info
        .lines()
        .find_map(|line| line.strip_prefix("model name")?.split_once(": "))
        .map_or("unknown processor", |pair| pair.1);
    let load = read("/proc/loadavg");
    format!(
        "{model}, {} processors; load at the end {}",
        cores.count,
        load.split(' ').next().unwrap_or("unknown")
    )
}
