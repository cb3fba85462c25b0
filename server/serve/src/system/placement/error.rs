//! Errors of placement.

/// An error that prevents the placement of threads or the locking of memory.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// The answering thread would starve all other threads.
    #[error(
        "processor {cpu} is the only one, and an answering thread that polls on it under {policy} \
         leaves nothing to the thread that clients attach through; use --wait sleep, or give \
         the server a second processor (taskset, cpuset), or leave the priority out{chrt}",
        policy = if *.inherited { "an inherited real-time policy" } else { "SCHED_FIFO" },
        chrt = if *.inherited { " (chrt)" } else { "" },
    )]
    Starved {
        /// The processor.
        cpu: usize,
        /// Whether the policy was inherited rather than requested.
        inherited: bool,
    },
    /// A process under SCHED_DEADLINE may start no thread.
    #[error(
        "started under SCHED_DEADLINE, where no thread can be started; use --priority, which is \
         for the answering thread alone"
    )]
    Deadline,
    /// No such priority.
    #[error("priority {0}, expected 1 to 99; choose another one with --priority")]
    PriorityRange(u8),
    /// The processor does not exist or is not allowed for this process.
    #[error(
        "processor {cpu} cannot be had: {reason}; this process was started on {allowed}: choose \
         one of them with --cpu, or widen its cpuset"
    )]
    Processor {
        /// The requested value.
        cpu: usize,
        /// The error of the system.
        reason: String,
        /// The processors that the process was started on.
        allowed: String,
    },
    /// The other threads cannot be moved away, for this reason.
    #[error("the threads beside the answering one cannot be moved to other processors: {0}")]
    Others(String),
    /// The right to a real-time priority is missing: the priority, RLIMIT_RTPRIO.
    #[error(
        "priority {0} under SCHED_FIFO is not permitted: RLIMIT_RTPRIO is {1} and \
         there is no CAP_SYS_NICE; `ulimit -r {0}`, or LimitRTPRIO={0} in the unit, \
         or leave out --priority"
    )]
    PriorityNotPermitted(u8, u64),
    /// The priority cannot be set for another reason: the priority, the reason.
    #[error("priority {0} under SCHED_FIFO is refused: {1}")]
    Priority(u8, String),
    /// The right to lock memory is missing; RLIMIT_MEMLOCK `[byte]`.
    #[error(
        "memory cannot be locked: RLIMIT_MEMLOCK is {0} bytes, expected unlimited, or \
         CAP_IPC_LOCK: under a limit lanes that come later could not be mapped; `ulimit -l \
         unlimited`, or LimitMEMLOCK=infinity in the unit, or leave out --lock-memory"
    )]
    MemoryNotPermitted(u64),
    /// Memory cannot be locked for another reason, this one.
    #[error("memory cannot be locked: {0}; leave out --lock-memory or free memory")]
    Memory(String),
}
