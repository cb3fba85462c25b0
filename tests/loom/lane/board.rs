//! One entry of a board: two cells, a counter, one writer, one reader.
//!
//! Of iceoryx2 0.10.0: `UnrestrictedAtomicMgmt` in `iceoryx2-bb-lock-free`
//! (`spmc/unrestricted_atomic.rs`), with `EntryHandle::get` and `is_up_to_date` in `iceoryx2`
//! (`port/reader.rs`) and `EntryValueUninit` (`port/writer.rs`).

use loom::cell::UnsafeCell;
use loom::sync::atomic::Ordering::{self, AcqRel, Acquire, Relaxed, Release, SeqCst};
use loom::sync::atomic::{AtomicU64, fence};

/// The orderings of the counter.
#[derive(Clone, Copy)]
pub(crate) struct Orderings {
    /// Of the writer's increment.
    pub(crate) publish: Ordering,
    /// Of the reader's first look.
    pub(crate) read: Ordering,
    /// Of the reader's second look, when the counter is the same and when it is not.
    pub(crate) confirm: [Ordering; 2],
    /// Whether there is a second look.
    pub(crate) confirms: bool,
    /// Whether the next value waits for the increment: on x86-64 by itself, on ARM by the fence of
    /// `proto/src/lane.rs`. Without it, the first store of the next value may come before.
    pub(crate) holds_back: bool,
}

impl Orderings {
    /// As they are.
    pub(crate) const ICEORYX2: Orderings = Orderings {
        publish: Release,
        read: Acquire,
        confirm: [AcqRel, SeqCst],
        confirms: true,
        holds_back: true,
    };
}

/// The memory of a value.
pub(crate) trait Cell {
    fn new() -> Self;
    fn write(&self, value: u64);
    /// The first part of a value, before the rest.
    fn begin(&self, value: u64);
    fn read(&self) -> [u64; 2];
}

/// A value in two halves, for a reader that may read while it is written: the bytes of a copy are
/// no more than relaxed accesses, and whether the halves belong together is asked afterwards.
pub(crate) struct Words([AtomicU64; 2]);

impl Cell for Words {
    fn new() -> Words {
        Words([AtomicU64::new(0), AtomicU64::new(0)])
    }

    fn write(&self, value: u64) {
        self.0.iter().for_each(|half| half.store(value, Relaxed));
    }

    fn begin(&self, value: u64) {
        self.0[0].store(value, Relaxed);
    }

    fn read(&self) -> [u64; 2] {
        [self.0[0].load(Relaxed), self.0[1].load(Relaxed)]
    }
}

/// A value that must not be written while it is read; loom reports such accesses. The number beside
/// the cell is the value.
pub(crate) struct Whole(UnsafeCell<()>, AtomicU64);

impl Cell for Whole {
    fn new() -> Whole {
        Whole(UnsafeCell::new(()), AtomicU64::new(0))
    }

    fn write(&self, value: u64) {
        self.0.with_mut(|_| self.1.store(value, Relaxed));
    }

    fn begin(&self, value: u64) {
        self.write(value);
    }

    fn read(&self) -> [u64; 2] {
        [self.0.with(|_| self.1.load(Relaxed)); 2]
    }
}

/// An entry.
pub(crate) struct Board<C> {
    write_cell: AtomicU64,
    cells: [C; 2],
    orderings: Orderings,
}

impl<C: Cell> Board<C> {
    /// An entry that holds 0.
    pub(crate) fn new(orderings: Orderings) -> Board<C> {
        Board { write_cell: AtomicU64::new(1), cells: [C::new(), C::new()], orderings }
    }

    fn load(&self) -> u64 {
        let mut current = self.write_cell.load(self.orderings.read);
        loop {
            let value = self.cells[(current - 1) as usize % 2].read();
            let [same, other] = self.orderings.confirm;
            let confirmed = self.write_cell.compare_exchange(current, current, same, other);
            match confirmed {
                Err(now) if self.orderings.confirms => current = now,
                _ => {
                    assert_eq!(value[0], value[1], "a value of two halves");
                    return value[0];
                }
            }
        }
    }
}

/// The writing end.
pub(crate) struct Writer {
    /// The counter. iceoryx2 reads it with `Relaxed`, which for the only thread that writes it is
    /// this; and loom, which remembers one last load of an atomic, would forget the reader's.
    write_cell: u64,
}

impl Default for Writer {
    fn default() -> Writer {
        Writer { write_cell: 1 }
    }
}

impl Writer {
    /// Writes in place, then publishes. The fence is that of `proto/src/lane.rs`: it keeps the next
    /// store behind the increment. loom never moves a store forward, so this is done by hand here.
    pub(crate) fn publish<C: Cell>(&mut self, board: &Board<C>, value: u64) {
        board.cells[self.write_cell as usize % 2].write(value);
        if !board.orderings.holds_back {
            board.cells[(self.write_cell + 1) as usize % 2].begin(value + 1);
        }
        board.write_cell.fetch_add(1, board.orderings.publish);
        fence(Acquire);
        self.write_cell += 1;
    }
}

/// The reading end.
pub(crate) struct Reader {
    generation: u64,
}

impl Default for Reader {
    /// Starts with the value already in the board marked as read.
    fn default() -> Reader {
        Reader { generation: 1 }
    }
}

impl Reader {
    /// The value if it was written since the last call. May return a value twice; never loses one.
    pub(crate) fn poll<C: Cell>(&mut self, board: &Board<C>) -> Option<u64> {
        if board.write_cell.load(Relaxed) == self.generation {
            return None;
        }
        self.generation = board.write_cell.load(Relaxed);
        Some(board.load())
    }
}
