//! Separate processors for controller and server: on a shared one each would wait for the other.

use rustix::thread::{CpuSet, sched_getaffinity};

/// The processors of this process for the server, and the last one for the controller; `None` for a
/// single one.
pub(super) fn split() -> Option<[CpuSet; 2]> {
    let mut server = sched_getaffinity(None).ok()?;
    let last = (0..CpuSet::MAX_CPU).rev().find(|processor| server.is_set(*processor))?;
    let mut controller = CpuSet::new();
    controller.set(last);
    server.unset(last);
    (server.count() > 0).then_some([server, controller])
}
