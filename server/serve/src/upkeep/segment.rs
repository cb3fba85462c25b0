//! The server's side of a client's part of shared memory, held off the answering thread.

use std::panic::{AssertUnwindSafe, catch_unwind};

use sarrus_proto::Node;
use sarrus_proto::control::Refusal;
use sarrus_proto::run::{Link, Run, free_shared_memory};

use crate::system::sigbus::replaced_pages;
use crate::upkeep::refusals::{failed, take_down};

/// The node and the link of one client; freed after its ports.
pub(crate) struct Segment {
    node: Node,
    pub(crate) link: Link,
    /// Being returned by the answering thread.
    pub(crate) is_leaving: bool,
}

impl Segment {
    /// Makes a new link and ports in it; returns the number of the link. A failure leaves nothing.
    ///
    /// The transport fails where a stop of the process interrupts a system call: a second try
    /// follows.
    pub(crate) fn make<T>(
        run: &Run,
        needed: u64,
        make: impl Fn(&Node, &mut Link) -> Result<T, Refusal>,
    ) -> Result<(u64, Segment, T), Refusal> {
        match Segment::attempt(run, needed, &make) {
            Err(Refusal::Failed { .. }) => Segment::attempt(run, needed, &make),
            outcome => outcome,
        }
    }

    fn attempt<T>(
        run: &Run,
        needed: u64,
        make: impl Fn(&Node, &mut Link) -> Result<T, Refusal>,
    ) -> Result<(u64, Segment, T), Refusal> {
        let free = free_shared_memory();
        if free < needed {
            return Err(Refusal::NoSpace { needed, free });
        }
        let (number, mut link) = run.new_link().map_err(|error| failed(&error))?;
        let pages = replaced_pages();
        let made = catch_unwind(AssertUnwindSafe(|| {
            let node = link.node().map_err(|error| failed(&error))?;
            let made = make(&node, &mut link)?;
            // a page was missing meanwhile: the ports are damaged
            match replaced_pages() == pages {
                true => Ok((node, made)),
                false => Err(Refusal::NoSpace { needed, free: free_shared_memory() }),
            }
        }));
        let damaged = "its shared memory was damaged while it was made".to_owned();
        match made.unwrap_or(Err(Refusal::Failed { reason: damaged })) {
            Ok((node, made)) => Ok((number, Segment { node, link, is_leaving: false }, made)),
            Err(refusal) => {
                link.remove();
                Err(refusal)
            }
        }
    }

    /// Removes node and link.
    pub(crate) fn free(self) {
        take_down(self.node);
        self.link.remove();
    }
}
