//! Real-time rights of this process, and the warnings where they are missing.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};
use thread_priority::{ThreadPriority, ThreadPriorityValue};

use crate::stderr::say;

/// Locks present and future memory; the result is the reason of a failure.
///
/// Under a limit, locking future memory would make later allocations fail, so the limit is checked
/// first.
pub fn lock_memory() -> Option<String> {
    let limit = getrlimit(Resource::Memlock).current;
    let is_root = rustix::process::geteuid().is_root();
    if let (Some(limit), false) = (limit, is_root) {
        return Some(format!(
            "memory is not locked: RLIMIT_MEMLOCK is {} KiB, expected unlimited; `ulimit -l \
                unlimited` or LimitMEMLOCK=infinity",
            limit / 1024
        ));
    }
    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE)
        .err()
        .map(|error| format!("memory is not locked: {error}"))
}

/// Whether a thread of this process gets a real-time priority.
pub fn permits_priority() -> bool {
    std::thread::spawn(|| set_priority(1)).join().unwrap_or(false)
}

fn set_priority(priority: u8) -> bool {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let value = ThreadPriorityValue::try_from(priority).map(ThreadPriority::Crossplatform);
    let set = value.map(|value| set_thread_priority_and_policy(thread_native_id(), value, policy));
    matches!(set, Ok(Ok(())))
}

/// Puts this thread under SCHED_FIFO if a priority is given, with a warning if that is not
/// permitted.
pub fn be_first(priority: Option<u8>) {
    let Some(priority) = priority else { return };
    if !set_priority(priority) {
        say(format_args!(
            "no SCHED_FIFO: not permitted, expected CAP_SYS_NICE or LimitRTPRIO; deadlines depend \
                on other programs"
        ));
    }
}
