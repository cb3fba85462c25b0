//! Other processes that a signal has stopped.

use rustix::process::{Pid, Signal, kill_process};

/// Continues a process where a signal such as SIGSTOP has stopped it, and returns true. One that a
/// debugger holds is left alone.
pub fn continue_stopped(process: i32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // the name before it may have any letters
    let is_stopped = stat.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with('T'));
    let process = Pid::from_raw(process).filter(|_| is_stopped);
    process.is_some_and(|process| kill_process(process, Signal::CONT).is_ok())
}
