//! Rights on this computer: real-time priorities, processor time for them, locked memory.

use rustix::process::{Resource, getrlimit};

use super::Finding;
use sarrus_can_run::realtime::{lock_memory, permits_priority};

/// Part of the time that real-time threads should have at least.
const LEAST_SHARE: f64 = 0.9;

/// Settings of the kernel and limits of this process.
pub(super) struct Machine {
    /// `RLIMIT_RTPRIO`; `None` without a limit.
    pub(super) priority: Option<String>,
    /// Whether a thread gets a real-time priority.
    pub(super) permits_priority: bool,
    /// `kernel.sched_rt_runtime_us` and `kernel.sched_rt_period_us`.
    pub(super) share: Option<(i64, i64)>,
    /// Why memory cannot be locked.
    pub(super) memory: Option<String>,
}

impl Machine {
    /// This computer, for this user. Locks this program's memory to see whether that can be done.
    pub(super) fn here() -> Machine {
        let number = |name: &str| {
            let text = std::fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok()?;
            text.trim().parse::<i64>().ok()
        };
        Machine {
            priority: getrlimit(Resource::Rtprio).current.map(|most| most.to_string()),
            permits_priority: permits_priority(),
            share: number("sched_rt_runtime_us").zip(number("sched_rt_period_us")),
            memory: lock_memory(),
        }
    }

    pub(super) fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if !self.permits_priority {
            let limit = self.priority.as_deref().unwrap_or("not known");
            findings.push(Finding::new(
                "real-time rights",
                format!(
                    "no SCHED_FIFO, RLIMIT_RTPRIO is {limit}, expected the priority of `run` or \
                     more; a line `USER - rtprio 95` in /etc/security/limits.conf, or LimitRTPRIO= \
                     in the unit"
                ),
            ));
        }
        if let Some((runtime, period)) = self.share
            && runtime >= 0
            && (runtime as f64) < LEAST_SHARE * period as f64
        {
            findings.push(Finding::new(
                "real-time share",
                format!(
                    "{runtime} of {period} µs: threads under SCHED_FIFO are stopped then, expected \
                     {:.0} % or more; `sysctl kernel.sched_rt_runtime_us=-1`",
                    LEAST_SHARE * 100.0
                ),
            ));
        }
        findings.extend(self.memory.as_ref().map(|why| Finding::new("locked memory", why)));
        findings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_this_computer_refuses_is_named_and_a_good_one_has_no_findings() {
        let good = || Machine {
            priority: Some("95".to_owned()),
            permits_priority: true,
            share: Some((950_000, 1_000_000)),
            memory: None,
        };
        assert_eq!(good().findings(), []);
        assert_eq!(Machine { share: Some((-1, 1_000_000)), ..good() }.findings(), []);
        for (machine, check, word) in [
            (
                Machine { permits_priority: false, priority: Some("0".to_owned()), ..good() },
                "real-time rights",
                "RLIMIT_RTPRIO is 0, expected",
            ),
            (Machine { share: Some((0, 1_000_000)), ..good() }, "real-time share", "0 of 1000000"),
            (
                Machine { memory: Some("memory is not locked: 8".to_owned()), ..good() },
                "locked memory",
                "not locked",
            ),
        ] {
            let findings = machine.findings();
            assert_eq!(findings.len(), 1, "{findings:?}");
            assert_eq!(findings[0].check, check);
            assert!(findings[0].text.contains(word), "{findings:?}");
        }
    }
}
