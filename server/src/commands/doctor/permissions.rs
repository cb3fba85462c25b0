//! What this user may: real-time priorities, locked memory, open files.

use sarrus_server::system::limits::{
    CAP_IPC_LOCK, CAP_SYS_NICE, Limit, has_capability, soft_limit,
};

use super::Finding;
use super::files::{Files, unreadable};

const LIMITS: &str = "proc/self/limits";
/// Enough for a server with as many lanes as it can have.
const OPEN_FILES: u64 = 4096;

/// A limit by its name, unless a capability overrides it; a finding where there is no such line.
fn limit(
    files: &Files,
    check: &'static str,
    name: &str,
    capability: Option<u32>,
) -> Result<Limit, Vec<Finding>> {
    let text = files.text(LIMITS).ok_or_else(Vec::new)?;
    let status = files.text("proc/self/status").unwrap_or_default();
    if capability.is_some_and(|bit| has_capability(&status, bit) == Some(true)) {
        return Ok(Limit::Unlimited);
    }
    soft_limit(&text, name).ok_or_else(|| vec![unreadable(check, LIMITS, &text, name)])
}

pub(super) fn realtime(files: &Files) -> Vec<Finding> {
    let check = "real-time rights";
    match limit(files, check, "Max realtime priority", Some(CAP_SYS_NICE)) {
        Err(findings) => findings,
        Ok(limit) if limit.permits(1) => Vec::new(),
        Ok(limit) => vec![Finding::new(
            check,
            format!("RLIMIT_RTPRIO is {limit}"),
            "the priority of --priority or more",
            "a line `USER - rtprio 95` in /etc/security/limits.conf, or LimitRTPRIO= in the unit",
        )],
    }
}

pub(super) fn locked_memory(files: &Files) -> Vec<Finding> {
    let check = "locked memory";
    match limit(files, check, "Max locked memory", Some(CAP_IPC_LOCK)) {
        Err(findings) => findings,
        Ok(Limit::Unlimited) => Vec::new(),
        Ok(limit) => vec![Finding::new(
            check,
            format!("RLIMIT_MEMLOCK is {limit} bytes"),
            "unlimited",
            "a line `USER - memlock unlimited` in /etc/security/limits.conf, or \
             LimitMEMLOCK=infinity in the unit; --lock-memory needs it",
        )],
    }
}

pub(super) fn open_files(files: &Files) -> Vec<Finding> {
    let check = "open files";
    match limit(files, check, "Max open files", None) {
        Err(findings) => findings,
        Ok(limit) if limit.permits(OPEN_FILES) => Vec::new(),
        Ok(limit) => vec![Finding::new(
            check,
            format!("RLIMIT_NOFILE is {limit}"),
            format!("{OPEN_FILES} or more"),
            format!("`ulimit -n {OPEN_FILES}` before `sarrus serve`, or LimitNOFILE= in the unit"),
        )],
    }
}

#[cfg(test)]
mod tests {
    use super::super::files::tests::judge;
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

    #[test]
    fn limits_that_stand_in_the_way_are_named() {
        let all = [realtime, locked_memory, open_files];
        let findings = |limits| all.map(|check| judge(check, &[(LIMITS, limits)]).concat());
        let [realtime, memory, files] = findings(BAD);
        assert!(realtime.starts_with("real-time rights: RLIMIT_RTPRIO is 0, expected"));
        assert!(memory.starts_with("locked memory: RLIMIT_MEMLOCK is 8388608 bytes, expected"));
        assert!(files.starts_with("open files: RLIMIT_NOFILE is 1024, expected 4096 or more;"));
        assert_eq!(findings(GOOD), ["", "", ""]);
        assert!(findings("Max dreams 7").iter().all(|line| line.contains("reads `Max dreams 7`")));
        assert_eq!(all.map(|check| judge(check, &[]).concat()), ["", "", ""]);
    }

    #[test]
    fn a_capability_overrides_a_limit() {
        let files = [(LIMITS, BAD), ("proc/self/status", "CapEff:\t000001ffffffffff\n")];
        assert_eq!(judge(realtime, &files), [""; 0]);
        assert_eq!(judge(locked_memory, &files), [""; 0]);
        assert_eq!(judge(open_files, &files).len(), 1);
    }
}
