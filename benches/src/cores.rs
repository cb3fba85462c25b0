//! The processors of client and server.

use core::fmt;
use std::fs;

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use sarrus_report::Outcome;

/// One processor for the client, one for the server, and one for the server's other threads.
#[derive(Clone, Copy, Debug)]
pub struct Cores {
    client: usize,
    server: usize,
    upkeep: usize,
    /// True when client and server are two threads of one core.
    siblings: bool,
}

impl Cores {
    /// The first processor for the server, the next of another core for the client, a third for the
    /// server's upkeep if there is one.
    ///
    /// # Errors
    ///
    /// A system that does not report the allowed processors.
    pub fn choose() -> Outcome<Cores> {
        let allowed = sched_getaffinity(None)?;
        let allowed: Vec<usize> = (0..CpuSet::MAX_CPU).filter(|cpu| allowed.is_set(*cpu)).collect();
        let server = *allowed.first().ok_or("no processor is allowed")?;
        let apart = |cpu: &usize| core_of(*cpu).is_none() || core_of(*cpu) != core_of(server);
        let mut others =
            allowed[1..].iter().copied().filter(apart).chain(allowed[1..].iter().copied());
        let client = others.next().unwrap_or(server);
        let upkeep = others.find(|cpu| *cpu != client).unwrap_or(server);
        Ok(Cores { client, server, upkeep, siblings: client != server && !apart(&client) })
    }

    /// True when there is only one.
    pub fn is_one(&self) -> bool {
        self.client == self.server
    }

    /// Ties this thread to the client's.
    pub fn pin_client(&self) {
        pin(self.client);
    }

    /// The server's and that of its upkeep.
    pub fn of_server(&self) -> [usize; 2] {
        [self.server, self.upkeep]
    }
}

impl fmt::Display for Cores {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "server on processor {}, client on {}", self.server, self.client)?;
        if self.siblings { f.write_str(" of the same core") } else { Ok(()) }
    }
}

/// Moves this thread, and the threads it starts, to one processor; does nothing if the system
/// forbids it.
pub fn pin(cpu: usize) {
    let mut set = CpuSet::new();
    set.set(cpu);
    let _ = sched_setaffinity(None, &set);
}

/// Package and core of a processor, where the system reports them.
fn core_of(cpu: usize) -> Option<(String, String)> {
    let read = |what: &str| {
        fs::read_to_string(format!("/sys/devices/system/cpu/cpu{cpu}/topology/{what}")).ok()
    };
    Some((read("physical_package_id")?, read("core_id")?))
}
