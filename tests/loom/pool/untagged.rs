//! The free list on atomics that keep the lower half only, so without the count of changes.

#[path = "../../../server/serve/src/pool/free_list.rs"]
mod free_list;

pub(crate) use free_list::FreeList;

mod atomic {
    pub(crate) use loom::sync::atomic::{AtomicU32, Ordering};

    pub(crate) struct AtomicU64(pub(super) AtomicU32);

    impl AtomicU64 {
        pub(crate) fn load(&self, order: Ordering) -> u64 {
            self.0.load(order).into()
        }

        pub(crate) fn compare_exchange_weak(
            &self,
            current: u64,
            new: u64,
            success: Ordering,
            failure: Ordering,
        ) -> Result<u64, u64> {
            self.0
                .compare_exchange_weak(current as u32, new as u32, success, failure)
                .map(u64::from)
                .map_err(u64::from)
        }
    }
}

pub(crate) fn list() -> FreeList {
    let top = atomic::AtomicU64(atomic::AtomicU32::new(0));
    FreeList { top, used: atomic::AtomicU32::new(0) }
}
