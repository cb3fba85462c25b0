//! Processors: governor, idle states, isolation.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use super::{Finding, text};

const CPU: &str = "sys/devices/system/cpu";
/// Longest wake-up of restrained idle states `[µs]`.
const WAKE_US: i32 = 10;

/// The numbers of a list of processors such as `0-3,5`.
fn processors(text: &str) -> Option<Vec<usize>> {
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

/// The processors of one of the kernel's lists, none of a text that is no list; `None` without the
/// file.
fn listed(root: &Path, name: &str) -> Option<Vec<usize>> {
    let list = text(root, &format!("{CPU}/{name}"))?;
    Some(processors(&list).unwrap_or_default())
}

/// `cpu0 … 7: text` for each text of several processors.
fn grouped(found: impl Iterator<Item = (usize, String)>) -> impl Iterator<Item = String> {
    let mut groups: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for (cpu, text) in found {
        groups.entry(text).or_insert([cpu; 2])[1] = cpu;
    }
    groups.into_iter().map(|(text, [first, last])| match first == last {
        true => format!("cpu{first}: {text}"),
        false => format!("cpu{first} … {last}: {text}"),
    })
}

pub(super) fn governor(root: &Path) -> Vec<Finding> {
    // virtual machines have none
    let slow = |cpu: usize| {
        let governor = text(root, &format!("{CPU}/cpu{cpu}/cpufreq/scaling_governor"))?;
        (governor != "performance").then_some((cpu, governor))
    };
    let help = "`cpupower frequency-set -g performance`";
    let online = listed(root, "online").unwrap_or_default();
    grouped(online.into_iter().filter_map(slow))
        .map(|found| Finding::new("governor", found, "performance", help))
        .collect()
}

pub(super) fn idle_states(root: &Path) -> Vec<Finding> {
    // a process that holds /dev/cpu_dma_latency restrains all processors
    let held = fs::read(root.join("dev/cpu_dma_latency")).ok();
    let held = held.and_then(|bytes| bytes.try_into().ok()).map(i32::from_ne_bytes);
    if held.is_some_and(|latency| (0..=WAKE_US).contains(&latency)) {
        return Vec::new();
    }
    let deepest = |cpu: usize| {
        let of = |state: usize, name: &str| {
            text(root, &format!("{CPU}/cpu{cpu}/cpuidle/state{state}/{name}"))
        };
        let states = (0..).map_while(|state| Some((of(state, "latency")?.parse().ok()?, state)));
        let is_off = |state| of(state, "disable").is_some_and(|disabled| disabled != "0");
        let (us, state): (i32, usize) = states.filter(|(_, state)| !is_off(*state)).max()?;
        let name = of(state, "name").unwrap_or_else(|| format!("state{state}"));
        (us > WAKE_US).then(|| (cpu, format!("{name}, {us} µs to wake")))
    };
    let finding = |found| {
        Finding::new(
            "idle states",
            found,
            format!("at most {WAKE_US} µs"),
            "`cpupower idle-set -D 10`, or a process that holds /dev/cpu_dma_latency at 0; a \
             thread that polls (--wait busy) does not sleep",
        )
    };
    let online = listed(root, "online").unwrap_or_default();
    grouped(online.into_iter().filter_map(deepest)).map(finding).collect()
}

pub(super) fn isolated(root: &Path) -> Vec<Finding> {
    let [online, isolated, quiet] = ["online", "isolated", "nohz_full"].map(|of| listed(root, of));
    // with two processors neither can be isolated
    let (Some([_, _, .., last]), Some(isolated), Some(quiet)) =
        (online.as_deref(), isolated, quiet)
    else {
        return Vec::new();
    };
    let boot = "the boot parameters";
    if isolated.is_empty() {
        return vec![Finding::new(
            "isolated processors",
            "none",
            "one for the answering thread",
            format!("{boot} `isolcpus={last} nohz_full={last}`, then `sarrus serve --cpu {last}`"),
        )];
    }
    if isolated.iter().all(|cpu| quiet.contains(cpu)) {
        return Vec::new();
    }
    let list: Vec<String> = isolated.iter().map(usize::to_string).collect();
    let list = list.join(",");
    vec![Finding::new(
        "ticks",
        format!("isolated processors {list} are interrupted by the kernel's ticks"),
        "none",
        format!("{boot} `nohz_full={list} rcu_nocbs={list}`"),
    )]
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
    fn lists_of_processors_are_read() {
        assert_eq!(processors("0-3,5\n"), Some(vec![0, 1, 2, 3, 5]));
        assert_eq!(processors(""), Some(vec![]));
        for garbage in ["a", "3-1", "1-", "0-99999999999", "1;2"] {
            assert_eq!(processors(garbage), None, "{garbage}");
        }
    }

    #[test]
    fn governors_are_named_once_for_all_processors_that_have_them() {
        let files = [0, 1, 2, 3].map(|k| cpu(&format!("cpu{k}/cpufreq/scaling_governor")));
        let mut all = vec![ONLINE];
        all.extend(files.iter().map(|path| (path.as_str(), "powersave\n")));
        let found = judge(governor, &all);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("governor: cpu0 … 3: powersave, expected performance;"));
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
        let off = [ONLINE, (poll, "0"), (deep, "133"), (disable, "1")];
        assert_eq!(judge(idle_states, &off), [""; 0]);
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
        assert_eq!(super::super::tests::judge(isolated, &[ONLINE]), [""; 0]);
    }
}
