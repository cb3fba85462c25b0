//! Processors and policies of the threads, from the flags and the inherited ones.

use super::error::PlacementError;

/// The scheduling policy that a process was started with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Policy {
    /// SCHED_OTHER and the policies below it: every thread gets a share.
    Shared,
    /// SCHED_FIFO or SCHED_RR: runs until it sleeps.
    Realtime,
    /// SCHED_DEADLINE: may start no thread.
    Deadline,
}

impl Policy {
    /// By the number that `sched_getscheduler` gives.
    pub(super) fn of_number(number: u32) -> Policy {
        match number {
            1 | 2 => Policy::Realtime,
            6 => Policy::Deadline,
            _ => Policy::Shared,
        }
    }

    /// By the line `/proc/thread-self/stat`, whose 41st word it is.
    pub(super) fn of_stat(stat: &str) -> Option<Policy> {
        // the second word is a name in brackets and may hold anything
        let (_, rest) = stat.rsplit_once(')')?;
        rest.split_whitespace().nth(38)?.parse().ok().map(Policy::of_number)
    }
}

/// The flags of the command line.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Flags {
    /// The processor of the answering thread.
    pub(crate) cpu: Option<usize>,
    /// Its priority under SCHED_FIFO.
    pub(crate) priority: Option<u8>,
    /// Whether memory is locked.
    pub(crate) lock_memory: bool,
    /// Whether the answering thread polls without pause.
    pub(crate) busy: bool,
}

/// The changes; everything else stays as inherited.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Choice {
    /// The one processor of the answering thread.
    pub(super) cpu: Option<usize>,
    /// Its priority under SCHED_FIFO.
    pub(super) priority: Option<u8>,
    /// The processors of all other threads.
    pub(super) others: Option<Vec<usize>>,
    /// Whether the other threads drop an inherited real-time policy.
    pub(super) others_shared: bool,
}

/// Chooses from the processors and the policy that the process was started with.
///
/// An answering thread that polls under a real-time policy never yields its processor, so the other
/// threads need another one. The inherited list of processors can be widened: only the kernel knows
/// whether `--cpu` may name one outside of it, as it does for isolated processors.
pub(super) fn choose(
    allowed: &[usize],
    policy: Policy,
    flags: Flags,
) -> Result<Choice, PlacementError> {
    if policy == Policy::Deadline {
        return Err(PlacementError::Deadline);
    }
    if let Some(priority) = flags.priority.filter(|priority| !(1..=99).contains(priority)) {
        return Err(PlacementError::PriorityRange(priority));
    }
    let elsewhere: Vec<usize> =
        allowed.iter().copied().filter(|cpu| Some(*cpu) != flags.cpu).collect();

    // does a thread that never pauses leave a processor to the others?
    let is_realtime = flags.priority.is_some() || policy == Policy::Realtime;
    let free = match flags.cpu {
        Some(_) => elsewhere.len(),
        None => allowed.len().saturating_sub(1),
    };
    if flags.busy && is_realtime && free == 0 {
        return Err(PlacementError::Starved {
            cpu: flags.cpu.or(allowed.first().copied()).unwrap_or(0),
            inherited: flags.priority.is_none(),
        });
    }
    let leaves = flags.cpu.is_some() && !elsewhere.is_empty() && elsewhere.len() < allowed.len();
    Ok(Choice {
        cpu: flags.cpu,
        priority: flags.priority,
        others: leaves.then_some(elsewhere),
        others_shared: policy == Policy::Realtime,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flags(cpu: Option<usize>, priority: Option<u8>, busy: bool) -> Flags {
        Flags { cpu, priority, lock_memory: false, busy }
    }

    #[test]
    fn polling_under_a_real_time_policy_leaves_a_processor_or_is_refused() {
        // processors, policy, flags → refused
        let shared = Policy::Shared;
        let realtime = Policy::Realtime;
        let table: [(&[usize], Policy, Flags, bool); 13] = [
            // observed: `taskset -c 0 chrt -f 50 sarrus serve --wait busy`
            (&[0], realtime, flags(None, None, true), true),
            (&[0], realtime, flags(Some(0), None, true), true),
            (&[0], shared, flags(None, Some(80), true), true),
            (&[0], shared, flags(Some(0), Some(80), true), true),
            // another processor for the answering thread than the inherited one
            (&[0], realtime, flags(Some(1), None, true), false),
            // pauses let the others in
            (&[0], realtime, flags(None, None, false), false),
            (&[0], shared, flags(Some(0), Some(80), false), false),
            // shares let them in
            (&[0], shared, flags(None, None, true), false),
            (&[0], shared, flags(Some(0), None, true), false),
            // two processors
            (&[0, 1], realtime, flags(None, None, true), false),
            (&[0, 1], shared, flags(None, Some(80), true), false),
            (&[0, 1], shared, flags(Some(1), Some(80), true), false),
            (&[0, 1], realtime, flags(Some(1), Some(1), true), false),
        ];
        for (allowed, policy, flags, is_refused) in table {
            let choice = choose(allowed, policy, flags);
            let refused = matches!(choice, Err(PlacementError::Starved { .. }));
            assert_eq!(refused, is_refused, "{allowed:?} {policy:?} {flags:?}: {choice:?}");
        }
    }

    #[test]
    fn the_others_leave_the_answering_threads_processor_and_an_inherited_real_time_policy() {
        let choice = choose(&[0, 2, 3], Policy::Realtime, flags(Some(2), Some(7), true)).unwrap();
        let expected = Choice {
            cpu: Some(2),
            priority: Some(7),
            others: Some(vec![0, 3]),
            others_shared: true,
        };
        assert_eq!(choice, expected);
        // no flags: no change
        let choice = choose(&[0, 1], Policy::Shared, flags(None, None, true)).unwrap();
        let expected = Choice { cpu: None, priority: None, others: None, others_shared: false };
        assert_eq!(choice, expected);
        // an isolated processor is not among the inherited ones: the others are elsewhere already
        let choice = choose(&[0, 1], Policy::Shared, flags(Some(3), None, true)).unwrap();
        assert_eq!((choice.cpu, choice.others), (Some(3), None));
        // the only one is shared
        let choice = choose(&[1], Policy::Shared, flags(Some(1), None, true)).unwrap();
        assert_eq!((choice.cpu, choice.others), (Some(1), None));
    }

    #[test]
    fn priorities_and_policies_that_cannot_be_are_refused() {
        let outcome = |policy, priority| choose(&[0, 1], policy, flags(None, priority, false));
        for priority in [0, 100, 255] {
            let refused = outcome(Policy::Shared, Some(priority));
            assert_eq!(refused, Err(PlacementError::PriorityRange(priority)));
        }
        assert_eq!(outcome(Policy::Deadline, None), Err(PlacementError::Deadline));
    }

    #[test]
    fn the_policy_is_the_41st_word_whatever_the_process_is_called() {
        let words = |policy: &str| {
            let numbers = vec!["0"; 36].join(" ");
            format!("7 (a ) b 1) S {numbers} 50 {policy} 0 0\n")
        };
        assert_eq!(Policy::of_stat(&words("0")), Some(Policy::Shared));
        assert_eq!(Policy::of_stat(&words("1")), Some(Policy::Realtime));
        assert_eq!(Policy::of_stat(&words("6")), Some(Policy::Deadline));
        assert_eq!(Policy::of_stat("7 (short) S 1"), None);
        // this thread's own
        let own = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
        assert!(Policy::of_stat(&own).is_some(), "{own}");
    }
}
