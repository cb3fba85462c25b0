//! The free list on atomics that forget every ordering.

#[path = "../../../server/serve/src/pool/free_list.rs"]
mod free_list;

pub(crate) use free_list::FreeList;

mod atomic {
    pub(crate) use loom::sync::atomic::{AtomicU32, Ordering};

    pub(crate) struct AtomicU64(pub(super) loom::sync::atomic::AtomicU64);

    impl AtomicU64 {
        pub(crate) fn load(&self, _: Ordering) -> u64 {
            self.0.load(Ordering::Relaxed)
        }

        pub(crate) fn compare_exchange_weak(
            &self,
            current: u64,
            new: u64,
            _: Ordering,
            _: Ordering,
        ) -> Result<u64, u64> {
            self.0.compare_exchange_weak(current, new, Ordering::Relaxed, Ordering::Relaxed)
        }
    }
}

pub(crate) fn list() -> FreeList {
    let top = atomic::AtomicU64(loom::sync::atomic::AtomicU64::new(0));
    FreeList { top, used: atomic::AtomicU32::new(0) }
}
