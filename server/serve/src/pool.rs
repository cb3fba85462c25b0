//! The allocator of the binary: the answering thread takes its small blocks from its own fixed
//! pool.
//!
//! The transport makes two small blocks for each request through the service. [`Pool`] as the
//! global allocator serves them, on a thread that called [`adopt_thread`], from memory that is
//! reserved and mapped beforehand; every other thread uses the system's allocator. A block may be
//! freed on any thread. If the pool is empty, the system's allocator serves and [`counts`] reports
//! it.
// lint: a global allocator cannot be written in safe Rust; this file holds all unsafe code of the
// server
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::{Cell, UnsafeCell};
use std::sync::atomic::{self, AtomicU8, AtomicU32, AtomicU64, Ordering::*};

mod free_list;

use free_list::FreeList;

/// The allocator; give it to `#[global_allocator]`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pool;

/// Counts of adopted threads since their adoption.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Calls of the system's allocator, to allocate or to free.
    pub system: u64,
    /// Blocks from the pool.
    pub pool: u64,
}

/// A thread's use of the pool; ends when dropped, on the same thread.
#[derive(Debug)]
pub struct Adopted(std::marker::PhantomData<*const ()>);

thread_local! {
    // constant and without destructor: reading it never allocates
    static ADOPTED: Cell<bool> = const { Cell::new(false) };
}

static SYSTEM_CALLS: AtomicU64 = AtomicU64::new(0);
static POOL_BLOCKS: AtomicU64 = AtomicU64::new(0);

/// From now on this thread takes small blocks from the pool, which is mapped first.
pub fn adopt_thread() -> Adopted {
    for page in (0..ARENA_SIZE).step_by(4096) {
        // SAFETY: inside the arena; adding nothing atomically maps the page and changes no block
        // that may be in use.
        unsafe { &*ARENA.start().add(page).cast::<AtomicU8>() }.fetch_or(0, Relaxed);
    }
    ADOPTED.set(true);
    Adopted(std::marker::PhantomData)
}

impl Drop for Adopted {
    fn drop(&mut self) {
        ADOPTED.set(false);
    }
}

/// The counts of adopted threads so far.
pub fn counts() -> Counts {
    Counts { system: SYSTEM_CALLS.load(Relaxed), pool: POOL_BLOCKS.load(Relaxed) }
}

/// (size, count) of each class: the transport's blocks for a request, and larger ones for a new
/// client.
const CLASSES: [Class; 5] = classes([(64, 4096), (256, 512), (1024, 128), (4096, 64), (65536, 8)]);
const ARENA_SIZE: usize = CLASSES[4].end();
const N_BLOCKS: usize = CLASSES[4].first_block + CLASSES[4].n_blocks;
const ALIGNMENT: usize = 64;

/// Blocks of one size.
#[derive(Clone, Copy)]
struct Class {
    size: usize,
    n_blocks: usize,
    offset: usize,
    first_block: usize,
}

impl Class {
    const fn end(&self) -> usize {
        self.offset + self.size * self.n_blocks
    }

    /// The part of [`NEXT`] that belongs to these blocks.
    fn next(&self) -> &'static [AtomicU32] {
        &NEXT[self.first_block..self.first_block + self.n_blocks]
    }
}

const fn classes(blocks: [(usize, usize); 5]) -> [Class; 5] {
    let mut classes = [Class { size: 0, n_blocks: 0, offset: 0, first_block: 0 }; 5];
    let mut offset = 0;
    let mut first_block = 0;
    let mut k = 0;
    while k < 5 {
        let (size, n_blocks) = blocks[k];
        classes[k] = Class { size, n_blocks, offset, first_block };
        offset += size * n_blocks;
        first_block += n_blocks;
        k += 1;
    }
    classes
}

#[repr(C, align(4096))]
struct Arena(UnsafeCell<[u8; ARENA_SIZE]>);

// SAFETY: bytes are handed out as blocks, each to one owner at a time.
unsafe impl Sync for Arena {}

static ARENA: Arena = Arena(UnsafeCell::new([0; ARENA_SIZE]));
static FREE: [FreeList; 5] =
    [const { FreeList { top: AtomicU64::new(0), used: AtomicU32::new(0) } }; 5];
/// For each free block the number of the next one, plus one.
static NEXT: [AtomicU32; N_BLOCKS] = [const { AtomicU32::new(0) }; N_BLOCKS];

impl Arena {
    fn start(&self) -> *mut u8 {
        self.0.get().cast()
    }

    /// Class and number within it of the block that starts here.
    fn block_at(&self, pointer: *const u8) -> Option<(usize, usize)> {
        let offset = (pointer as usize).wrapping_sub(self.start() as usize);
        let class = CLASSES.iter().position(|class| offset < class.end())?;
        Some((class, (offset - CLASSES[class].offset) / CLASSES[class].size))
    }
}

fn adopted() -> bool {
    ADOPTED.try_with(Cell::get).unwrap_or(false)
}

fn count_system_call() {
    if adopted() {
        SYSTEM_CALLS.fetch_add(1, Relaxed);
    }
}

// SAFETY: blocks of the arena do not overlap, are as large as their class and aligned to ALIGNMENT
// (sizes and offsets of all classes are multiples of it, the arena is aligned to more); a block has
// one owner between `pop` and `push`. Everything else is the system's allocator unchanged: an
// address shows which of the two a block came from.
unsafe impl GlobalAlloc for Pool {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if adopted() {
            let fitting = CLASSES
                .iter()
                .position(|class| layout.size() <= class.size && layout.align() <= ALIGNMENT);
            if let Some((index, block)) =
                fitting.and_then(|index| Some((index, FREE[index].pop(CLASSES[index].next())?)))
            {
                POOL_BLOCKS.fetch_add(1, Relaxed);
                // SAFETY: the block lies inside the arena.
                return unsafe {
                    ARENA.start().add(CLASSES[index].offset + block * CLASSES[index].size)
                };
            }
        }
        count_system_call();
        // SAFETY: the caller's duties are handed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        match ARENA.block_at(pointer) {
            Some((index, block)) => FREE[index].push(CLASSES[index].next(), block),
            None => {
                count_system_call();
                // SAFETY: not from the arena, so from the system's allocator.
                unsafe { System.dealloc(pointer, layout) }
            }
        }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        if !adopted() && ARENA.block_at(pointer).is_none() {
            // SAFETY: from the system's allocator; the caller's duties are handed on.
            return unsafe { System.realloc(pointer, layout, new_size) };
        }
        // SAFETY: the caller warrants that the new size is not zero and, rounded up to the
        // alignment, fits `isize`; the two blocks do not overlap and both hold the bytes that are
        // copied.
        unsafe {
            let new = self.alloc(Layout::from_size_align_unchecked(new_size, layout.align()));
            if !new.is_null() {
                std::ptr::copy_nonoverlapping(pointer, new, layout.size().min(new_size));
                self.dealloc(pointer, layout);
            }
            new
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // the pool is one for the whole process: one test at a time
    static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

    fn take(size: usize) -> *mut u8 {
        // SAFETY: the size is not zero.
        unsafe { Pool.alloc(Layout::from_size_align(size, 8).unwrap()) }
    }

    fn give(pointer: *mut u8, size: usize) {
        // SAFETY: the pointer came from `take` with this size.
        unsafe { Pool.dealloc(pointer, Layout::from_size_align(size, 8).unwrap()) }
    }

    #[test]
    fn blocks_do_not_overlap_and_come_back_from_other_threads() {
        let _alone = ALONE.lock().unwrap();
        for round in 0..3 {
            let adopted = adopt_thread();
            let blocks: Vec<(usize, usize)> =
                (0..3000).map(|k| (take(1 + k % 200) as usize, 1 + k % 200)).collect();
            drop(adopted);
            let mut sorted = blocks.clone();
            sorted.sort_unstable();
            assert!(
                sorted.windows(2).all(|pair| pair[0].0 + pair[0].1 <= pair[1].0),
                "round {round}"
            );
            std::thread::scope(|scope| {
                for half in blocks.chunks(1500) {
                    scope.spawn(move || {
                        half.iter().for_each(|(pointer, size)| give(*pointer as *mut u8, *size))
                    });
                }
            });
        }
        // all blocks were returned: all small ones can be taken at once
        let adopted = adopt_thread();
        let blocks: Vec<usize> = (0..CLASSES[0].n_blocks).map(|_| take(64) as usize).collect();
        drop(adopted);
        assert!(blocks.iter().all(|pointer| {
            ARENA.block_at(*pointer as *const u8).is_some_and(|(class, _)| class == 0)
        }));
        blocks.into_iter().for_each(|pointer| give(pointer as *mut u8, 64));
    }

    #[test]
    fn an_exhausted_pool_falls_through_to_the_system_and_counts_it() {
        let _alone = ALONE.lock().unwrap();
        let mut blocks = Vec::with_capacity(9);
        let before = counts();
        let adopted = adopt_thread();
        (0..9).for_each(|_| blocks.push(take(65536)));
        drop(adopted);
        let after = counts();
        assert_eq!((after.pool - before.pool, after.system - before.system), (8, 1));
        blocks.into_iter().for_each(|pointer| give(pointer, 65536));
        assert_eq!(counts(), after, "other threads do not count");
    }

    #[test]
    fn a_block_that_grows_keeps_its_bytes() {
        let _alone = ALONE.lock().unwrap();
        let adopted = adopt_thread();
        let layout = Layout::from_size_align(40, 8).unwrap();
        let small = take(40);
        // SAFETY: the block holds 40 bytes, then 5000.
        let large = unsafe {
            small.write_bytes(7, 40);
            Pool.realloc(small, layout, 5000)
        };
        drop(adopted);
        // SAFETY: as above.
        assert!((0..40).all(|k| unsafe { large.add(k).read() } == 7));
        give(large, 5000);
    }
}
