//! Processors: number, governor, idle states, isolation.

use std::collections::BTreeMap;

use super::Finding;
use super::files::{Files, processors, unreadable};

const CPU: &str = "sys/devices/system/cpu";
/// Longest wake-up of restrained idle states `[µs]`.
const WAKE_US: u64 = 10;

/// The numbers of the running processors.
fn online(files: &Files) -> Option<Vec<usize>> {
    processors(&files.text(&format!("{CPU}/online"))?)
}

pub(super) fn count(files: &Files) -> Vec<Finding> {
    let path = format!("{CPU}/online");
    let Some(text) = files.text(&path) else { return Vec::new() };
    match processors(&text).map(|online| online.len()) {
        None | Some(0) => vec![unreadable("processors", &path, &text, "a list such as 0-7")],
        Some(n @ (1 | 2)) => vec![Finding::new(
            "processors",
            n.to_string(),
            "3 or more",
            "one each for the server, a client and the rest; until then serve with --wait sleep",
        )],
        Some(_) => Vec::new(),
    }
}

/// One `(cpu0 … 7, text)` for each text of several processors.
fn grouped(found: Vec<(usize, String)>) -> Vec<(String, String)> {
    let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (cpu, text) in found {
        groups.entry(text).or_default().push(cpu);
    }
    let named = |(text, cpus): (String, Vec<usize>)| {
        let names = match cpus.as_slice() {
            [first, .., last] => format!("cpu{first} … {last}"),
            only => format!("cpu{}", only[0]),
        };
        (names, text)
    };
    groups.into_iter().map(named).collect()
}

pub(super) fn governor(files: &Files) -> Vec<Finding> {
    let mut slow = Vec::new();
    for cpu in online(files).unwrap_or_default() {
        // virtual machines have none
        let governor = files.text(&format!("{CPU}/cpu{cpu}/cpufreq/scaling_governor"));
        slow.extend(governor.filter(|governor| governor != "performance").map(|one| (cpu, one)));
    }
    let finding = |(cpus, governor): (String, String)| {
        let good = governor.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_');
        if !good || governor.is_empty() {
            return unreadable("governor", "…/scaling_governor", &governor, "a governor's name");
        }
        Finding::new(
            "governor",
            format!("{cpus}: {governor}"),
            "performance",
            "`cpupower frequency-set -g performance`",
        )
    };
    grouped(slow).into_iter().map(finding).collect()
}

pub(super) fn idle_states(files: &Files) -> Vec<Finding> {
    // a process that holds /dev/cpu_dma_latency restrains all processors
    if let Some(bytes) = files.bytes("dev/cpu_dma_latency")
        && let Ok(latency) = <[u8; 4]>::try_from(bytes.as_slice()).map(i32::from_ne_bytes)
        && (0..=WAKE_US as i32).contains(&latency)
    {
        return Vec::new();
    }
    let mut deep = Vec::new();
    let mut findings = Vec::new();
    for cpu in online(files).unwrap_or_default() {
        let folder = format!("{CPU}/cpu{cpu}/cpuidle");
        let mut deepest: Option<(u64, String)> = None;
        for state in files.names(&folder).iter().filter(|name| name.starts_with("state")) {
            let text = |name: &str| files.text(&format!("{folder}/{state}/{name}"));
            if text("disable").is_some_and(|disabled| disabled != "0") {
                continue;
            }
            let Some(latency) = text("latency") else { continue };
            let Ok(latency) = latency.parse() else {
                let path = format!("{folder}/{state}/latency");
                findings.push(unreadable("idle states", &path, &latency, "µs"));
                continue;
            };
            if latency > WAKE_US && deepest.as_ref().is_none_or(|(known, _)| latency > *known) {
                deepest = Some((latency, text("name").unwrap_or_else(|| state.clone())));
            }
        }
        deep.extend(deepest.map(|(us, name)| (cpu, format!("{name}, {us} µs to wake"))));
    }
    let finding = |(cpus, state): (String, String)| {
        Finding::new(
            "idle states",
            format!("{cpus}: {state}"),
            format!("at most {WAKE_US} µs"),
            "`cpupower idle-set -D 10`, or a process that holds /dev/cpu_dma_latency at 0; a \
             thread that polls (--wait busy) does not sleep",
        )
    };
    findings.extend(grouped(deep).into_iter().map(finding));
    findings
}

pub(super) fn isolated(files: &Files) -> Vec<Finding> {
    // neither of two processors can be isolated
    let Some(last) = online(files).filter(|online| online.len() >= 3).and_then(|mut all| all.pop())
    else {
        return Vec::new();
    };
    let mut lists = Vec::new();
    for (check, name) in [("isolated processors", "isolated"), ("ticks", "nohz_full")] {
        let path = format!("{CPU}/{name}");
        let Some(text) = files.text(&path) else { return Vec::new() };
        // the text of a kernel without the option or its boot parameter
        let text = if text == "(null)" { String::new() } else { text };
        match processors(&text) {
            Some(list) => lists.push(list),
            None => return vec![unreadable(check, &path, &text, "a list such as 2-3")],
        }
    }
    let boot = "the boot parameters";
    match lists.as_slice() {
        [isolated, _] if isolated.is_empty() => vec![Finding::new(
            "isolated processors",
            "none",
            "one for the answering thread",
            format!("{boot} `isolcpus={last} nohz_full={last}`, then `sarrus serve --cpu {last}`"),
        )],
        [isolated, quiet] if isolated.iter().any(|cpu| !quiet.contains(cpu)) => {
            let list: Vec<String> = isolated.iter().map(usize::to_string).collect();
            let list = list.join(",");
            vec![Finding::new(
                "ticks",
                format!("isolated processors {list} are interrupted by the kernel's ticks"),
                "none",
                format!("{boot} `nohz_full={list} rcu_nocbs={list}`"),
            )]
        }
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::judge;
    use super::*;

    const ONLINE: (&str, &str) = ("sys/devices/system/cpu/online", "0-3\n");

    fn cpu(path: &str) -> String {
        format!("{CPU}/{path}")
    }

    #[test]
    fn processors_are_counted() {
        let count = |text| judge(count, &[(&cpu("online"), text)]);
        assert_eq!(count("0-2"), [""; 0]);
        assert_eq!(count("0-1").len(), 1);
        assert!(count("0-1")[0].starts_with("processors: 2, expected 3 or more; one each"));
        assert!(count("mostly")[0].starts_with("processors: /sys/devices/system/cpu/online reads"));
        assert_eq!(judge(super::count, &[]), [""; 0]);
    }

    #[test]
    fn governors_are_named_once_for_all_processors_that_have_them() {
        let files = [0, 1, 2, 3].map(|k| cpu(&format!("cpu{k}/cpufreq/scaling_governor")));
        let mut all = vec![ONLINE];
        all.extend(files.iter().map(|path| (path.as_str(), "powersave\n")));
        let found = judge(governor, &all);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("governor: cpu0 … 3: powersave, expected performance;"));
        assert!(judge(governor, &[ONLINE, (&files[0], "\u{1}3;")])[0].contains("reads `3;`"));
        assert_eq!(judge(governor, &[ONLINE, (&files[0], "performance")]), [""; 0]);
        assert_eq!(judge(governor, &[ONLINE]), [""; 0]);
    }

    #[test]
    fn the_deepest_idle_state_that_is_not_switched_off_counts() {
        let path = |state: u32, name: &str| cpu(&format!("cpu1/cpuidle/state{state}/{name}"));
        let paths = [path(0, "latency"), path(1, "latency"), path(1, "name"), path(1, "disable")];
        let [poll, deep, name, disable] = paths.each_ref().map(String::as_str);
        let files = [ONLINE, (poll, "0"), (deep, "133"), (name, "C6"), (disable, "0")];
        let found = judge(idle_states, &files);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("idle states: cpu1: C6, 133 µs to wake, expected at most"));
        let held = [&files[..], &[("dev/cpu_dma_latency", "\0\0\0\0")]].concat();
        assert_eq!(judge(idle_states, &held), [""; 0]);
        assert_eq!(judge(idle_states, &[ONLINE, (deep, "133"), (disable, "1")]), [""; 0]);
        assert!(judge(idle_states, &[ONLINE, (deep, "soon")])[0].contains("reads `soon`"));
        assert_eq!(judge(idle_states, &[ONLINE]), [""; 0]);
    }

    #[test]
    fn of_three_processors_one_can_be_isolated() {
        let isolated_path = cpu("isolated");
        let quiet_path = cpu("nohz_full");
        let judge = |online, list, quiet| {
            let files = [(&*cpu("online"), online), (&*isolated_path, list), (&*quiet_path, quiet)];
            judge(isolated, &files)
        };
        assert!(judge("0-3", "\n", "(null)\n")[0].contains("isolcpus=3 nohz_full=3"));
        assert!(judge("0-3", "2-3", "3")[0].starts_with("ticks: isolated processors 2,3 are"));
        assert_eq!(judge("0-3", "3", "3"), [""; 0]);
        assert_eq!(judge("0-1", "", ""), [""; 0]);
        assert!(judge("0-3", "none", "")[0].contains("reads `none`"));
        assert_eq!(super::super::tests::judge(isolated, &[ONLINE]), [""; 0]);
    }
}
