//! The free lists of the server's allocator, `server/serve/src/pool/free_list.rs` itself, on loom's
//! atomics: every interleaving of a few calls (to five preemptions), every value that a weak memory
//! may show.
//!
//! A block's memory is a cell that only records its accesses: the test ends when two owners access
//! it at a time, or when an owner does so without the release of the one before. The same file with
//! weaker atomics shows that the check can fail.

#![allow(clippy::duplicate_mod, reason = "the same file is checked with other atomics")]

mod relaxed;
mod right;
mod untagged;

use loom::cell::UnsafeCell;
use loom::model::Builder;
use loom::sync::Arc;
use loom::sync::atomic::AtomicU32;
use loom::thread;

/// State that the threads share: a list, its numbers, and the memory of its blocks.
struct Blocks<L> {
    list: L,
    next: [AtomicU32; 2],
    memory: [UnsafeCell<()>; 2],
}

impl<L> Blocks<L> {
    fn new(list: L) -> Blocks<L> {
        Blocks {
            list,
            next: std::array::from_fn(|_| AtomicU32::new(0)),
            memory: std::array::from_fn(|_| UnsafeCell::new(())),
        }
    }

    /// An owner writes to its block.
    fn write(&self, block: usize) {
        self.memory[block].with_mut(|_| ());
    }
}

/// Every interleaving with up to five preemptions.
fn every_interleaving(check: impl Fn() + Sync + Send + 'static) {
    let mut builder = Builder::new();
    builder.preemption_bound = Some(5);
    builder.check(check);
}

/// Two threads take a block each, use it and give it back; in the end both are free.
macro_rules! blocks_go_from_hand_to_hand {
    ($atomics:ident) => {
        every_interleaving(|| {
            let blocks = Arc::new(Blocks::new($atomics::list()));
            let use_one = |blocks: &Blocks<$atomics::FreeList>| {
                if let Some(block) = blocks.list.pop(&blocks.next) {
                    blocks.write(block);
                    blocks.list.push(&blocks.next, block);
                }
            };
            let other = {
                let blocks = Arc::clone(&blocks);
                thread::spawn(move || use_one(&blocks))
            };
            use_one(&blocks);
            use_one(&blocks);
            other.join().unwrap();
            let mut free: Vec<_> = (0..3).map(|_| blocks.list.pop(&blocks.next)).collect();
            free.sort_unstable();
            assert_eq!(free, [None, Some(0), Some(1)]);
        });
    };
}

/// One thread takes twice while the other takes twice and gives the first back, so that the same
/// block is on top again with another one below it.
macro_rules! a_block_comes_back_on_top {
    ($atomics:ident) => {
        every_interleaving(|| {
            let blocks = Arc::new(Blocks::new($atomics::list()));
            for block in [blocks.list.pop(&blocks.next), blocks.list.pop(&blocks.next)] {
                blocks.list.push(&blocks.next, block.unwrap());
            }
            let other = {
                let blocks = Arc::clone(&blocks);
                thread::spawn(move || {
                    let first = blocks.list.pop(&blocks.next);
                    let second = blocks.list.pop(&blocks.next);
                    first.into_iter().for_each(|block| blocks.list.push(&blocks.next, block));
                    second
                })
            };
            let mut held = vec![blocks.list.pop(&blocks.next), blocks.list.pop(&blocks.next)];
            held.push(other.join().unwrap());
            held.push(blocks.list.pop(&blocks.next));
            let mut held: Vec<usize> = held.into_iter().flatten().collect();
            held.sort_unstable();
            assert_eq!(held, [0, 1], "each block has one owner");
        });
    };
}

#[test]
fn a_block_has_one_owner_who_sees_what_the_one_before_did() {
    blocks_go_from_hand_to_hand!(right);
}

#[test]
fn a_block_that_comes_back_on_top_is_not_mistaken() {
    a_block_comes_back_on_top!(right);
}

#[test]
#[should_panic(expected = "Causality violation")]
fn relaxed_ordering_is_caught() {
    blocks_go_from_hand_to_hand!(relaxed);
}

#[test]
#[should_panic(expected = "each block has one owner")]
fn a_list_without_a_count_of_changes_is_caught() {
    a_block_comes_back_on_top!(untagged);
}
