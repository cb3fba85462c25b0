//! The kernel: preemption, the share of real-time threads, huge pages.

use std::path::Path;

use super::{Finding, text};

pub(super) fn preemption(root: &Path) -> Vec<Finding> {
    let Some(version) = text(root, "proc/version") else { return Vec::new() };
    let is_realtime = version.split_whitespace().any(|word| word == "PREEMPT_RT")
        || text(root, "sys/kernel/realtime").as_deref() == Some("1");
    if is_realtime {
        return Vec::new();
    }
    vec![Finding::new(
        "kernel",
        "no PREEMPT_RT",
        "PREEMPT_RT",
        "a real-time kernel (`linux-image-rt-amd64`, `linux-lowlatency`); without one the longest \
         answer is the kernel's",
    )]
}

/// Whether a release such as `6.12.3-rt` is at least the wanted one; none for another text.
fn at_least(release: &str, wanted: (u32, u32)) -> Option<bool> {
    let mut parts = release.split(['.', '-', '+']);
    let major = parts.next()?.parse().ok()?;
    Some((major, parts.next()?.parse().ok()?) >= wanted)
}

pub(super) fn realtime_share(root: &Path) -> Vec<Finding> {
    let number = |name: &str| text(root, &format!("proc/sys/kernel/{name}"))?.parse::<i64>().ok();
    let Some(runtime) = number("sched_rt_runtime_us") else { return Vec::new() };
    let period = number("sched_rt_period_us").unwrap_or(1_000_000);
    // from 6.12 on the limit applies only if other threads would starve
    let release = text(root, "proc/sys/kernel/osrelease").unwrap_or_default();
    let is_new = at_least(&release, (6, 12)).unwrap_or(false);
    if runtime < 0 || runtime >= period || is_new && runtime > 0 {
        return Vec::new();
    }
    vec![Finding::new(
        "real-time share",
        format!("{runtime} of {period} µs: a thread that polls under SCHED_FIFO is stopped then"),
        "no limit",
        "`sysctl kernel.sched_rt_runtime_us=-1`, or --wait sleep",
    )]
}

pub(super) fn huge_pages(root: &Path) -> Vec<Finding> {
    let path = "sys/kernel/mm/transparent_hugepage/enabled";
    if !text(root, path).is_some_and(|text| text.contains("[always]")) {
        return Vec::new();
    }
    vec![Finding::new(
        "huge pages",
        "always: pages are moved while programs run",
        "madvise or never",
        format!("`echo madvise > /{path}`, or the boot parameter transparent_hugepage=madvise"),
    )]
}

#[cfg(test)]
mod tests {
    use super::super::tests::judge;
    use super::*;

    #[test]
    fn a_kernel_without_preempt_rt_is_a_finding() {
        let version = |text| judge(preemption, &[("proc/version", text)]);
        assert_eq!(version("Linux version 6.12.9 #1 SMP PREEMPT_RT Mon"), [""; 0]);
        assert_eq!(version("Linux version 6.1 #1 SMP PREEMPT_DYNAMIC").len(), 1);
        let files = [("proc/version", "Linux 5.4-rt"), ("sys/kernel/realtime", "1\n")];
        assert_eq!(judge(preemption, &files), [""; 0]);
        assert_eq!(judge(preemption, &[]), [""; 0]);
    }

    #[test]
    fn a_thread_that_polls_is_stopped_by_older_kernels() {
        let share = |runtime, release| {
            let files = [
                ("proc/sys/kernel/sched_rt_runtime_us", runtime),
                ("proc/sys/kernel/sched_rt_period_us", "1000000\n"),
                ("proc/sys/kernel/osrelease", release),
            ];
            judge(realtime_share, &files)
        };
        assert!(share("950000\n", "6.1.0-13-amd64")[0].starts_with("real-time share: 950000 of"));
        assert_eq!(share("950000", "6.12.1"), [""; 0]);
        assert_eq!(share("950000", "garbage").len(), 1);
        assert_eq!(share("0", "6.18.1").len(), 1);
        assert_eq!(share("-1", "5.10.0"), [""; 0]);
        assert_eq!(share("1000000", "5.10.0"), [""; 0]);
        assert_eq!(share("most", "5.10.0"), [""; 0]);
        assert_eq!(judge(realtime_share, &[]), [""; 0]);
    }

    #[test]
    fn the_choice_of_huge_pages_is_in_brackets() {
        let pages =
            |text| judge(huge_pages, &[("sys/kernel/mm/transparent_hugepage/enabled", text)]);
        assert!(pages("[always] madvise never\n")[0].starts_with("huge pages: always"));
        assert_eq!(pages("always [madvise] never"), [""; 0]);
        assert_eq!(judge(huge_pages, &[]), [""; 0]);
    }
}
