//! Lines of slcan over a file descriptor that never waits.

use std::collections::VecDeque;
use std::io;
use std::os::fd::OwnedFd;

use rustix::io::{Errno, read, write};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::slcan::{self, Line, MAX_LINE};

/// Bytes that are read at once.
const READ: usize = 4096;

/// Lines in and out.
pub(super) struct LinePort {
    pub(super) fd: OwnedFd,
    lines: slcan::Lines,
    buffer: [u8; READ],
    /// Bytes of `buffer` that are read and not looked at: from, to.
    unread: (usize, usize),
    /// The rest of a line whose beginning is written.
    unwritten: VecDeque<u8>,
}

impl LinePort {
    pub(super) fn new(fd: OwnedFd) -> LinePort {
        LinePort {
            fd,
            lines: slcan::Lines::default(),
            buffer: [0; READ],
            unread: (0, 0),
            unwritten: VecDeque::with_capacity(MAX_LINE),
        }
    }

    /// The next line that is already there.
    pub(super) fn next(&mut self) -> io::Result<Option<Line>> {
        loop {
            while self.unread.0 < self.unread.1 {
                let byte = self.buffer.get(self.unread.0).copied().unwrap_or_default();
                self.unread.0 += 1;
                if let Some(line) = self.lines.take(byte) {
                    return Ok(Some(line));
                }
            }
            match read(&self.fd, &mut self.buffer) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(n) => self.unread = (0, n),
                Err(Errno::AGAIN) => return Ok(None),
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }

    /// Whether a line is written in part only.
    pub(super) fn is_stuck(&self) -> bool {
        !self.unwritten.is_empty()
    }

    /// Writes a frame; false, and nothing of it, where there is no room.
    pub(super) fn send(&mut self, frame: &Frame) -> io::Result<bool> {
        let mut line = [0; MAX_LINE];
        let used = slcan::write(frame, &mut line);
        self.send_line(line.get(..used).unwrap_or_default())
    }

    /// Writes a line with its end; false, and nothing of it, where there is no room.
    pub(super) fn send_line(&mut self, line: &[u8]) -> io::Result<bool> {
        while !self.unwritten.is_empty() {
            let (rest, _) = self.unwritten.as_slices();
            match write(&self.fd, rest) {
                Ok(n) => drop(self.unwritten.drain(..n)),
                Err(Errno::AGAIN) => return Ok(false),
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
        loop {
            match write(&self.fd, line) {
                Ok(n) => {
                    self.unwritten.extend(line.iter().skip(n));
                    return Ok(true);
                }
                Err(Errno::AGAIN) => return Ok(false),
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
    }
}
