//! A client's part of shared memory, as the server holds it beside the answering thread.

use std::panic::{AssertUnwindSafe, catch_unwind};

use iceoryx2::node::Node;
use sarrus_proto::control::Refusal;
use sarrus_proto::lane::Threadsafe;
use sarrus_proto::run::{Link, Run, free_shared_memory};

use crate::bus_guard::replaced_pages;
use crate::refusals::{failed, take_down};

/// What a place is taken by; it goes when the ports are gone.
pub(crate) struct Place {
    node: Node<Threadsafe>,
    pub(crate) link: Link,
    /// Ordered back from the answering thread.
    pub(crate) is_leaving: bool,
}

impl Place {
    /// Makes something in a link of its own, with the number of that; nothing is left where that
    /// fails.
    pub(crate) fn make<T>(
        run: &Run,
        needed: u64,
        make: impl FnOnce(&Node<Threadsafe>, &Link) -> Result<T, Refusal>,
    ) -> Result<(u64, Place, T), Refusal> {
        let free = free_shared_memory();
        if free < needed {
            return Err(Refusal::NoSpace { needed, free });
        }
        let (number, link) = run.new_link().map_err(|error| failed(&error))?;
        let pages = replaced_pages();
        let made = catch_unwind(AssertUnwindSafe(|| {
            let node = link.node().map_err(|error| failed(&error))?;
            let made = make(&node, &link)?;
            // a page was missing meanwhile: what was made there is of no use
            match replaced_pages() == pages {
                true => Ok((node, made)),
                false => Err(Refusal::NoSpace { needed, free: free_shared_memory() }),
            }
        }));
        let damaged = "its shared memory was damaged while it was made".to_owned();
        match made.unwrap_or(Err(Refusal::Failed { reason: damaged })) {
            Ok((node, made)) => Ok((number, Place { node, link, is_leaving: false }, made)),
            Err(refusal) => {
                link.remove();
                Err(refusal)
            }
        }
    }

    /// Leaves nothing of it.
    pub(crate) fn free(self) {
        take_down(self.node);
        self.link.remove();
    }
}
