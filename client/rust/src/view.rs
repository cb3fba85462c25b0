//! Reads a server's counters without being its client.

use std::time::Duration;

use sarrus_proto::message::Statistics;
use sarrus_proto::{Domain, ServerName};

use crate::ConnectError;
use crate::control::{Control, deadline_after};
use crate::life::Life;

/// A connection to a server for its counters, without lane or plan.
pub struct ServerView {
    control: Control,
    timeout: Duration,
}

impl ServerView {
    /// Connects to a server on this machine; each call waits for `timeout` at most.
    ///
    /// # Errors
    /// [`ConnectError`].
    pub fn connect(name: &str, timeout: Duration) -> Result<ServerView, ConnectError> {
        let name = ServerName::new(name)?;
        let control = Control::open(&Domain::of_user()?, &name, None, deadline_after(timeout))?;
        Ok(ServerView { control, timeout })
    }

    /// The server's counters and its connected clients.
    ///
    /// # Errors
    /// [`ConnectError`]: the server is gone or does not answer.
    pub fn statistics(&self) -> Result<Statistics, ConnectError> {
        self.control.statistics(deadline_after(self.timeout))
    }

    /// The state of the server's process and heartbeat.
    pub fn life(&self) -> Life {
        self.control.life()
    }
}
