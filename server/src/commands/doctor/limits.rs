//! Limits of this user's processes: real-time priorities, locked memory, open files.

use sarrus_server::system::limits::{CAP_IPC_LOCK, CAP_SYS_NICE, has_capability, soft_limit};

use super::Finding;
use super::files::{Files, unreadable};

const LIMITS: &str = "proc/self/limits";

/// A limit and the least value that a server needs.
pub(super) struct Need {
    check: &'static str,
    /// The name of its line in `/proc/self/limits`.
    line: &'static str,
    variable: &'static str,
    unit: &'static str,
    /// The capability that overrides the limit.
    capability: Option<u32>,
    least: u64,
    expected: &'static str,
    help: &'static str,
}

pub(super) const REALTIME: Need = Need {
    check: "real-time rights",
    line: "Max realtime priority",
    variable: "RLIMIT_RTPRIO",
    unit: "",
    capability: Some(CAP_SYS_NICE),
    least: 1,
    expected: "the priority of --priority or more",
    help: "a line `USER - rtprio 95` in /etc/security/limits.conf, or LimitRTPRIO= in the unit",
};

pub(super) const LOCKED_MEMORY: Need = Need {
    check: "locked memory",
    line: "Max locked memory",
    variable: "RLIMIT_MEMLOCK",
    unit: " bytes",
    capability: Some(CAP_IPC_LOCK),
    least: u64::MAX,
    expected: "unlimited",
    help: "a line `USER - memlock unlimited` in /etc/security/limits.conf, or \
           LimitMEMLOCK=infinity in the unit; --lock-memory needs it",
};

/// Enough for a server with the largest number of lanes.
pub(super) const OPEN_FILES: Need = Need {
    check: "open files",
    line: "Max open files",
    variable: "RLIMIT_NOFILE",
    unit: "",
    capability: None,
    least: 4096,
    expected: "4096 or more",
    help: "`ulimit -n 4096` before `sarrus serve`, or LimitNOFILE= in the unit",
};

pub(super) fn judge(files: &Files, need: &Need) -> Vec<Finding> {
    let Some(text) = files.text(LIMITS) else { return Vec::new() };
    let status = files.text("proc/self/status").unwrap_or_default();
    if need.capability.is_some_and(|bit| has_capability(&status, bit) == Some(true)) {
        return Vec::new();
    }
    match soft_limit(&text, need.line) {
        None => vec![unreadable(need.check, LIMITS, &text, need.line)],
        Some(limit) if limit.permits(need.least) => Vec::new(),
        Some(limit) => {
            let found = format!("{} is {limit}{}", need.variable, need.unit);
            vec![Finding::new(need.check, found, need.expected, need.help)]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::judge;
    use super::*;

    const BAD: &str = "\
Max open files            1024                 1048576              files
Max locked memory         8388608              8388608              bytes
Max realtime priority     0                    0
";
    const GOOD: &str = "\
Max open files            65536                1048576              files
Max locked memory         unlimited            unlimited            bytes
Max realtime priority     95                   95
";
    const ALL: [super::super::Check; 3] = [
        |files| super::judge(files, &REALTIME),
        |files| super::judge(files, &LOCKED_MEMORY),
        |files| super::judge(files, &OPEN_FILES),
    ];

    #[test]
    fn limits_that_stand_in_the_way_are_named() {
        let findings = |limits| ALL.map(|check| judge(check, &[(LIMITS, limits)]).concat());
        let [realtime, memory, files] = findings(BAD);
        assert!(realtime.starts_with("real-time rights: RLIMIT_RTPRIO is 0, expected"));
        assert!(memory.starts_with("locked memory: RLIMIT_MEMLOCK is 8388608 bytes, expected"));
        assert!(files.starts_with("open files: RLIMIT_NOFILE is 1024, expected 4096 or more;"));
        assert_eq!(findings(GOOD), ["", "", ""]);
        assert!(findings("Max dreams 7").iter().all(|line| line.contains("reads `Max dreams 7`")));
        assert_eq!(ALL.map(|check| judge(check, &[]).concat()), ["", "", ""]);
    }

    #[test]
    fn a_capability_overrides_a_limit() {
        let files = [(LIMITS, BAD), ("proc/self/status", "CapEff:\t000001ffffffffff\n")];
        let [realtime, memory, open] = ALL.map(|check| judge(check, &files).len());
        assert_eq!([realtime, memory, open], [0, 0, 1]);
    }
}
