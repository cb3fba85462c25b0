//! A server process and its supervisor: lines on the process' output, orders on its input.

use std::fmt;

use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};

/// A line from a server process to its supervisor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Message {
    /// The model of this fingerprint is compiled: waiting for the order.
    Loaded(u64),
    /// Clients can attach: the line for whoever started the supervisor.
    Ready(String),
    /// The name belongs to another server, which runs.
    Taken(String),
    /// It cannot serve, for this reason.
    Failed(String),
}

impl Message {
    pub(super) fn read(line: &str) -> Option<Message> {
        let (word, rest) = line.split_once(' ')?;
        match word {
            "loaded" => u64::from_str_radix(rest, 16).ok().map(Message::Loaded),
            "ready" => Some(Message::Ready(line.to_owned())),
            "taken" => Some(Message::Taken(rest.to_owned())),
            "failed" => Some(Message::Failed(rest.to_owned())),
            _ => None,
        }
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one_line = |text: &str| text.replace(['\n', '\r'], " ");
        match self {
            Message::Loaded(fingerprint) => write!(f, "loaded {fingerprint:016x}"),
            Message::Ready(line) => f.write_str(line),
            Message::Taken(reason) => write!(f, "taken {}", one_line(reason)),
            Message::Failed(reason) => write!(f, "failed {}", one_line(reason)),
        }
    }
}

/// What a supervisor orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// Serve, and say the model's warnings.
    Serve,
    /// Serve in the place of one that died; its warnings have been said.
    ServeAgain,
    /// Not needed any more: the supervisor has closed its end.
    Leave,
}

impl Order {
    /// As it is written; nothing is written for leaving.
    pub(super) fn line(self) -> &'static str {
        match self {
            Order::Serve => "serve\n",
            Order::ServeAgain => "again\n",
            Order::Leave => "",
        }
    }
}

/// Waits for the order.
pub(super) fn order() -> Order {
    let mut line = String::new();
    let read = std::io::stdin().read_line(&mut line);
    let orders = [Order::Serve, Order::ServeAgain];
    orders.into_iter().find(|order| read.is_ok() && order.line() == line).unwrap_or(Order::Leave)
}

/// The kernel kills this process when its parent dies; false when the parent is dead already.
pub(super) fn die_with(parent: i32) -> bool {
    let set = set_parent_process_death_signal(Some(Signal::KILL));
    // the program was started by a link that every process has: the name shows what it is
    let _ = rustix::thread::set_name(c"sarrus");
    set.is_ok() && getppid().map(Pid::as_raw_nonzero).is_some_and(|pid| pid.get() == parent)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_read_as_they_are_written() {
        for message in [
            Message::Loaded(0x00ab_cdef),
            Message::Ready("ready arm 0000000000abcdef".to_owned()),
            Message::Taken("by another".to_owned()),
            Message::Failed("arm.urdf:3:1: no mass".to_owned()),
        ] {
            assert_eq!(Message::read(&message.to_string()), Some(message));
        }
        let failed = Message::Failed("two\nlines".to_owned());
        assert_eq!(failed.to_string(), "failed two lines");
        for line in ["", "loaded", "loaded zz", "hello world"] {
            assert_eq!(Message::read(line), None, "{line}");
        }
    }
}
