//! The free blocks of one size: a lock-free stack.
//!
//! Numbers only, no memory; the atomics are those of the module above. So `tests/loom/` runs this
//! file with atomics that try every interleaving.

use super::atomic::{AtomicU32, AtomicU64, Ordering::*};

/// Freed blocks as a stack, and the blocks that were never used.
pub(crate) struct FreeList {
    /// Number of the top block plus one, and above it a count of changes, which reveals a change
    /// and its reversal.
    pub(crate) top: AtomicU64,
    /// Number of blocks ever used.
    pub(crate) used: AtomicU32,
}

impl FreeList {
    /// Takes a block; `next` has for each free block the number of the next one, plus one.
    pub(crate) fn pop(&self, next: &[AtomicU32]) -> Option<usize> {
        let mut top = self.top.load(Acquire);
        while let Some(block) = (top as u32).checked_sub(1) {
            let below = next.get(block as usize)?.load(Relaxed);
            let changed = (top >> 32).wrapping_add(1) << 32 | u64::from(below);
            // SYNC POINT: free block (the other end is in `push`)
            match self.top.compare_exchange_weak(top, changed, AcqRel, Acquire) {
                Ok(_) => return Some(block as usize),
                Err(now) => top = now,
            }
        }
        let fresh = |used: u32| ((used as usize) < next.len()).then_some(used + 1);
        self.used.fetch_update(Relaxed, Relaxed, fresh).ok().map(|block| block as usize)
    }

    /// Returns a block from [`FreeList::pop`].
    pub(crate) fn push(&self, next: &[AtomicU32], block: usize) {
        let Some(below) = next.get(block) else { return };
        let mut top = self.top.load(Relaxed);
        loop {
            below.store(top as u32, Relaxed);
            let changed = (top >> 32).wrapping_add(1) << 32 | (block as u64 + 1);
            // SYNC POINT: free block (the other end is in `pop`)
            match self.top.compare_exchange_weak(top, changed, AcqRel, Relaxed) {
                Ok(_) => return,
                Err(now) => top = now,
            }
        }
    }
}
