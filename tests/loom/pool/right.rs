//! The free list on loom's atomics as they are.

use loom::sync::atomic;

#[path = "../../../server/serve/src/pool/free_list.rs"]
mod free_list;

pub(crate) use free_list::FreeList;

pub(crate) fn list() -> FreeList {
    FreeList { top: atomic::AtomicU64::new(0), used: atomic::AtomicU32::new(0) }
}
