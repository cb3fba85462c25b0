//! The server's sign of life: a page that its answering thread writes and its clients map
//! read-only. It has no name and no port: its descriptor goes through the control socket, it leaves
//! no file, and only the server can write to it.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::atomic::Ordering::Relaxed;

use rustix::fs::{SealFlags, fcntl_add_seals};
use rustix::time::{ClockId, clock_gettime};

use crate::mapping::Mapping;

/// A sign of life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heartbeat {
    /// Grows while the server answers.
    pub beats: u64,
    /// 1 when this run has ended cleanly and no longer answers.
    pub stopped: u64,
    /// Time of writing, by the monotonic clock of this machine `[ns]`.
    pub at_ns: u64,
}

/// Number of words of the page, and the offset of each field.
const WORDS: usize = 512;
const BEATS: usize = 0;
const STOPPED: usize = 1;
const AT_NS: usize = 2;

/// The writing side.
pub struct HeartbeatWriter {
    mapping: Mapping,
    memory: OwnedFd,
    beats: u64,
}

impl HeartbeatWriter {
    /// A new page.
    pub fn new() -> io::Result<HeartbeatWriter> {
        let (mapping, memory) = Mapping::create("sarrus-heartbeat", WORDS)?;
        // every descriptor sent from now on is read-only
        fcntl_add_seals(&memory, SealFlags::FUTURE_WRITE | SealFlags::SEAL)?;
        let mut writer = HeartbeatWriter { mapping, memory, beats: 0 };
        writer.beat(false);
        Ok(writer)
    }

    /// A descriptor for readers.
    pub fn reader_descriptor(&self) -> io::Result<OwnedFd> {
        self.memory.as_fd().try_clone_to_owned()
    }

    /// Publishes that the server answers, or that it has ended cleanly. No system call.
    pub fn beat(&mut self, stopped: bool) {
        self.beats += 1;
        let words = self.mapping.words();
        words[AT_NS].store(monotonic_ns(), Relaxed);
        words[STOPPED].store(stopped.into(), Relaxed);
        words[BEATS].store(self.beats, Relaxed);
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
    /// `InvalidData` for a file that is not such a page or may shrink.
    pub fn new(memory: &OwnedFd) -> io::Result<HeartbeatReader> {
        Ok(HeartbeatReader { mapping: Mapping::open(memory, WORDS, false)? })
    }

    /// The last sign of life.
    pub fn read(&self) -> Heartbeat {
        let words = self.mapping.words();
        Heartbeat {
            beats: words[BEATS].load(Relaxed),
            stopped: words[STOPPED].load(Relaxed),
            at_ns: words[AT_NS].load(Relaxed),
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
        assert!(Mapping::open(&descriptor, WORDS, true).is_err());
    }
}
