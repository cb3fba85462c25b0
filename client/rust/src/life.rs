//! State of a server that does not answer: its process and its heartbeat.

use std::fmt;
use std::time::Duration;

use sarrus_proto::heartbeat::{HeartbeatReader, monotonic_ns};

/// A heartbeat older than this is reported; a busy machine causes shorter pauses.
const SILENCE: Duration = Duration::from_millis(100);

sarrus_proto::named_enum! {
    /// The state of a process, as the kernel reports it.
    pub enum ProcessState {
        /// It runs, or could.
        Alive = "alive",
        /// It was stopped by a signal or a debugger.
        Stopped = "stopped",
        /// It is gone.
        Dead = "dead",
        /// The kernel does not report it.
        Unknown = "unknown",
    }
}

/// A snapshot of a server's life: its process and its heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Life {
    /// The server's process; 0 if unknown.
    pub process: u32,
    /// Its state, as the kernel reports it.
    pub state: ProcessState,
    /// Age of the last sign of life of its answering thread; `None` before the first.
    pub silent: Option<Duration>,
}

impl Life {
    pub(crate) fn of(process: u32, heartbeat: Option<&HeartbeatReader>) -> Life {
        let silent = heartbeat.map(|heartbeat| {
            Duration::from_nanos(monotonic_ns().saturating_sub(heartbeat.read().at_ns))
        });
        Life { process, state: state_of(process), silent }
    }
}

fn state_of(process: u32) -> ProcessState {
    if process == 0 {
        return ProcessState::Unknown;
    }
    let Ok(text) = std::fs::read_to_string(format!("/proc/{process}/stat")) else {
        return match std::path::Path::new("/proc/self").exists() {
            true => ProcessState::Dead,
            false => ProcessState::Unknown,
        };
    };
    // the name of the program, in brackets, may hold anything
    match text.rsplit(')').next().and_then(|rest| rest.trim_start().chars().next()) {
        Some('T' | 't') => ProcessState::Stopped,
        Some('Z' | 'X' | 'x') => ProcessState::Dead,
        Some(_) => ProcessState::Alive,
        None => ProcessState::Unknown,
    }
}

impl fmt::Display for Life {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Life { process, state, silent } = self;
        let since = |f: &mut fmt::Formatter<'_>| match silent {
            Some(silent) => write!(f, " since {:.1} s", silent.as_secs_f64()),
            None => Ok(()),
        };
        match state {
            ProcessState::Stopped => {
                write!(f, "its process {process} is stopped by a signal or a debugger")?;
                since(f)?;
                write!(f, "; continue it with `kill -CONT {process}`")
            }
            ProcessState::Dead => write!(f, "its process {process} is dead; start it again"),
            ProcessState::Alive if silent.is_some_and(|silent| silent > SILENCE) => {
                write!(f, "its process {process} lives but has been given no processor")?;
                since(f)?;
                f.write_str("; give it one of its own (see `sarrus doctor`)")
            }
            ProcessState::Alive => {
                write!(f, "its process {process} lives; allow more time in the timeout")
            }
            ProcessState::Unknown => f.write_str(
                "its process is not known; see whether it is stopped, or give it a processor of \
                 its own (see `sarrus doctor`)",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_of_a_process_is_the_systems() {
        assert_eq!(state_of(std::process::id()), ProcessState::Alive);
        assert_eq!(state_of(0), ProcessState::Unknown);
        let mut child = std::process::Command::new("sleep").arg("100").spawn().unwrap();
        let process = child.id();
        assert_eq!(state_of(process), ProcessState::Alive);
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(state_of(process), ProcessState::Dead);
    }

    #[test]
    fn a_silent_server_is_described_by_what_is_known() {
        let words = |state, ms: u64| {
            Life { process: 7, state, silent: Some(Duration::from_millis(ms)) }.to_string()
        };
        assert_eq!(
            words(ProcessState::Stopped, 1200),
            "its process 7 is stopped by a signal or a debugger since 1.2 s; continue it with \
             `kill -CONT 7`"
        );
        assert!(words(ProcessState::Alive, 800).contains("no processor since 0.8 s"));
        assert!(words(ProcessState::Alive, 3).ends_with("lives; allow more time in the timeout"));
        assert_eq!(words(ProcessState::Dead, 3), "its process 7 is dead; start it again");
    }
}
