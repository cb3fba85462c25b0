//! Memory that server and client share without a name: a file in memory that goes through the
//! control socket, mapped as words. Its size is sealed, so that the other side cannot shrink it,
//! and each word is read and written whole.
// lint: a mapping cannot be made in safe Rust; everything that needs it is in this file
#![allow(unsafe_code)]

use std::io;
use std::os::fd::OwnedFd;
use std::ptr::NonNull;
use std::sync::atomic::AtomicU64;

use rustix::fs::{
    FallocateFlags, MemfdFlags, SealFlags, fallocate, fcntl_add_seals, fcntl_get_seals, fstat,
    memfd_create,
};
use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap, munmap};

/// Words of shared memory, mapped until this is dropped.
pub(crate) struct Mapping {
    start: NonNull<AtomicU64>,
    n_words: usize,
}

// SAFETY: the mapping stays until the value is dropped and holds atomic integers only.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

impl Mapping {
    /// New memory of this many zeros, fully allocated, and its descriptor; its size never changes.
    pub(crate) fn create(name: &str, n_words: usize) -> io::Result<(Mapping, OwnedFd)> {
        let memory = memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        fallocate(&memory, FallocateFlags::empty(), 0, bytes(n_words) as u64)?;
        fcntl_add_seals(&memory, SealFlags::SHRINK | SealFlags::GROW)?;
        Ok((Mapping::new(&memory, n_words, ProtFlags::READ | ProtFlags::WRITE)?, memory))
    }

    /// Memory of the other side.
    ///
    /// # Errors
    /// `InvalidData` for a file that is smaller or may shrink.
    pub(crate) fn open(memory: &OwnedFd, n_words: usize, write: bool) -> io::Result<Mapping> {
        let sealed = fcntl_get_seals(memory).is_ok_and(|seals| seals.contains(SealFlags::SHRINK));
        if !sealed || fstat(memory)?.st_size < bytes(n_words) as i64 {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let protection = if write { ProtFlags::WRITE } else { ProtFlags::empty() };
        Mapping::new(memory, n_words, ProtFlags::READ | protection)
    }

    fn new(memory: &OwnedFd, n_words: usize, protection: ProtFlags) -> io::Result<Mapping> {
        // no page fault occurs while a client waits
        let flags = MapFlags::SHARED | MapFlags::POPULATE;
        // SAFETY: a fresh mapping at an address that the kernel chooses; the file has this size and
        // is sealed against shrinking, so that every byte stays there.
        let start =
            unsafe { mmap(std::ptr::null_mut(), bytes(n_words), protection, flags, memory, 0) }?;
        let start = NonNull::new(start.cast());
        let start = start.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
        Ok(Mapping { start, n_words })
    }

    /// The words.
    #[inline]
    pub(crate) fn words(&self) -> &[AtomicU64] {
        // SAFETY: this many words are mapped, aligned to a page, and any bits are atomic integers;
        // where the mapping is read-only its owner stores nothing.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.n_words) }
    }

    /// Frees the memory for every process that maps it or keeps its descriptor: reads then give
    /// zeros, and writes allocate again. If that is refused the memory stays unchanged.
    pub(crate) fn empty(&self) {
        // SAFETY: all of it is this mapping's; its words stay mapped and are atomic integers, for
        // which any bits are valid.
        let _ = unsafe {
            madvise(self.start.as_ptr().cast(), bytes(self.n_words), Advice::LinuxRemove)
        };
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was made by `new` and nothing refers to it any more.
        let _ = unsafe { munmap(self.start.as_ptr().cast(), bytes(self.n_words)) };
    }
}

const fn bytes(n_words: usize) -> usize {
    n_words * size_of::<AtomicU64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::Ordering::Relaxed;

    use rustix::fs::ftruncate;

    #[test]
    fn both_sides_see_the_same_words_and_nobody_can_change_their_number() {
        let (mine, memory) = Mapping::create("words", 1000).unwrap();
        let theirs = Mapping::open(&memory, 1000, true).unwrap();
        assert!(mine.words().iter().all(|word| word.load(Relaxed) == 0));
        theirs.words()[999].store(7, Relaxed);
        assert_eq!(mine.words()[999].load(Relaxed), 7);
        assert!(ftruncate(&memory, 8).is_err() && ftruncate(&memory, 1 << 20).is_err());
        assert!(Mapping::open(&memory, 1001, true).is_err());
    }

    #[test]
    fn what_is_emptied_takes_no_memory_whoever_keeps_its_descriptor() {
        let blocks = |memory: &OwnedFd| fstat(memory).unwrap().st_blocks;
        let (mine, memory) = Mapping::create("words", 1 << 17).unwrap();
        let theirs = Mapping::open(&memory, 1 << 17, true).unwrap();
        theirs.words().iter().for_each(|word| word.store(7, Relaxed));
        assert_eq!(blocks(&memory), 1 << 11);
        mine.empty();
        assert_eq!(blocks(&memory), 0);
        drop(mine);
        assert!([0, (1 << 17) - 1].iter().all(|k| theirs.words()[*k].load(Relaxed) == 0));
    }

    #[test]
    fn a_file_that_may_shrink_is_refused() {
        let memory = memfd_create("loose", MemfdFlags::ALLOW_SEALING).unwrap();
        ftruncate(&memory, 8000).unwrap();
        assert!(Mapping::open(&memory, 1000, false).is_err());
        fcntl_add_seals(&memory, SealFlags::SHRINK).unwrap();
        assert!(Mapping::open(&memory, 1000, false).is_ok());
    }
}
