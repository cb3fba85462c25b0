//! Separate processors for the controller and its server: on a shared one each would wait for the
//! other.

use std::io;

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// The processors that this process may use, in two parts.
pub(super) struct Processors {
    server: CpuSet,
    controller: CpuSet,
}

impl Processors {
    /// The last processor for the controller, the others for the server; `None` of a single one.
    pub(super) fn split() -> Option<Processors> {
        let mut server = sched_getaffinity(None).ok()?;
        let last = (0..CpuSet::MAX_CPU).rev().find(|processor| server.is_set(*processor))?;
        let mut controller = CpuSet::new();
        controller.set(last);
        server.unset(last);
        (server.count() > 0).then_some(Processors { server, controller })
    }

    /// Moves this thread, and processes that it starts, to the server's part.
    pub(super) fn take_servers(&self) -> io::Result<()> {
        Ok(sched_setaffinity(None, &self.server)?)
    }

    /// Moves this thread to the controller's part.
    pub(super) fn take_controllers(&self) -> io::Result<()> {
        Ok(sched_setaffinity(None, &self.controller)?)
    }
}
