//! Whether a run of the server is alive: a page that its answering thread writes and its clients
//! map read-only. It has no name and no port: it goes through the control socket, nothing of it can
//! stay behind, and nobody but the server can write it.
// lint: a mapping cannot be made in safe Rust; everything that needs it is in this file
#![allow(unsafe_code)]

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rustix::fs::memfd_create;
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, fcntl_get_seals, fstat, ftruncate};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::time::{ClockId, clock_gettime};

/// A sign of life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heartbeat {
    /// Grows while the server answers.
    pub beats: u64,
    /// 1 when this run has ended in order and answers no more.
    pub stopped: u64,
    /// When it was written, by the monotonic clock of this machine `[ns]`.
    pub at_ns: u64,
}

/// What is mapped: one word for each field, each written and read whole.
#[repr(C)]
struct Words {
    beats: AtomicU64,
    stopped: AtomicU64,
    at_ns: AtomicU64,
}

const SIZE: usize = 4096;

struct Mapping(NonNull<Words>);

// SAFETY: the mapping stays until the value is dropped and holds atomic integers only.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

impl Mapping {
    fn new(memory: &OwnedFd, protection: ProtFlags) -> io::Result<Mapping> {
        // SAFETY: a fresh mapping at an address that the kernel chooses; the file has this size and
        // is sealed against shrinking, so that every byte stays there.
        let start =
            unsafe { mmap(std::ptr::null_mut(), SIZE, protection, MapFlags::SHARED, memory, 0) }?;
        NonNull::new(start.cast()).map(Mapping).ok_or_else(|| io::ErrorKind::OutOfMemory.into())
    }

    fn words(&self) -> &Words {
        // SAFETY: mapped, aligned to a page, any bits are atomic integers.
        unsafe { self.0.as_ref() }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was made by `new` and nothing refers to it any more.
        let _ = unsafe { munmap(self.0.as_ptr().cast(), SIZE) };
    }
}

/// The writing side.
pub struct HeartbeatWriter {
    mapping: Mapping,
    memory: OwnedFd,
    beats: u64,
}

impl HeartbeatWriter {
    /// A new page.
    pub fn new() -> io::Result<HeartbeatWriter> {
        let memory =
            memfd_create("sarrus-heartbeat", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        ftruncate(&memory, SIZE as u64)?;
        fcntl_add_seals(&memory, SealFlags::SHRINK | SealFlags::GROW)?;
        let mapping = Mapping::new(&memory, ProtFlags::READ | ProtFlags::WRITE)?;
        // whoever gets the descriptor from now on can only read
        fcntl_add_seals(&memory, SealFlags::FUTURE_WRITE | SealFlags::SEAL)?;
        let mut writer = HeartbeatWriter { mapping, memory, beats: 0 };
        writer.beat(false);
        Ok(writer)
    }

    /// A descriptor for those who read.
    pub fn reader_descriptor(&self) -> io::Result<OwnedFd> {
        self.memory.as_fd().try_clone_to_owned()
    }

    /// Says that the server answers, or that it has ended in order. No system call.
    pub fn beat(&mut self, stopped: bool) {
        self.beats += 1;
        let words = self.mapping.words();
        words.at_ns.store(monotonic_ns(), Relaxed);
        words.stopped.store(stopped.into(), Relaxed);
        words.beats.store(self.beats, Relaxed);
    }
}

/// The reading side.
pub struct HeartbeatReader {
    mapping: Mapping,
}

impl HeartbeatReader {
    /// Maps the page of a server.
    ///
    /// # Errors
    /// `InvalidData` for a file that is no such page or may shrink.
    pub fn new(memory: &OwnedFd) -> io::Result<HeartbeatReader> {
        let sealed = fcntl_get_seals(memory).is_ok_and(|seals| seals.contains(SealFlags::SHRINK));
        if !sealed || fstat(memory)?.st_size < SIZE as i64 {
            return Err(io::ErrorKind::InvalidData.into());
        }
        Ok(HeartbeatReader { mapping: Mapping::new(memory, ProtFlags::READ)? })
    }

    /// The last sign of life.
    pub fn read(&self) -> Heartbeat {
        let words = self.mapping.words();
        Heartbeat {
            beats: words.beats.load(Relaxed),
            stopped: words.stopped.load(Relaxed),
            at_ns: words.at_ns.load(Relaxed),
        }
    }
}

/// Now, by the monotonic clock of this machine, which all its processes share `[ns]`.
pub fn monotonic_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readers_see_beats_and_cannot_write() {
        let mut writer = HeartbeatWriter::new().unwrap();
        let descriptor = writer.reader_descriptor().unwrap();
        let reader = HeartbeatReader::new(&descriptor).unwrap();
        let first = reader.read();
        writer.beat(false);
        let second = reader.read();
        assert!(second.beats == first.beats + 1 && second.at_ns >= first.at_ns);
        writer.beat(true);
        assert_eq!(reader.read().stopped, 1);
        assert!(Mapping::new(&descriptor, ProtFlags::READ | ProtFlags::WRITE).is_err());
    }

    #[test]
    fn a_file_that_is_no_page_is_refused() {
        let short = memfd_create("short", MemfdFlags::ALLOW_SEALING).unwrap();
        assert!(HeartbeatReader::new(&short).is_err());
        fcntl_add_seals(&short, SealFlags::SHRINK).unwrap();
        assert!(HeartbeatReader::new(&short).is_err());
    }
}
