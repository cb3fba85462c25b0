//! Lines of slcan over a file descriptor that never waits.

use std::collections::VecDeque;
use std::io;
use std::os::fd::OwnedFd;

use rustix::io::{Errno, read, write};
use sarrus_can_core::frame::Frame;
use sarrus_can_core::slcan::{self, Line, MAX_LINE};

use super::{BusError, Sent};

/// Bytes that are read at once.
const READ: usize = 4096;

/// Lines in and out.
pub(super) struct LinePort {
    pub(super) name: String,
    pub(super) fd: OwnedFd,
    lines: slcan::Lines,
    buffer: [u8; READ],
    /// Bytes of `buffer` that are read and not looked at: from, to.
    unread: (usize, usize),
    /// The rest of a line whose beginning is written.
    unwritten: VecDeque<u8>,
}

impl LinePort {
    pub(super) fn new(name: String, fd: OwnedFd) -> LinePort {
        LinePort {
            name,
            fd,
            lines: slcan::Lines::default(),
            buffer: [0; READ],
            unread: (0, 0),
            unwritten: VecDeque::with_capacity(MAX_LINE),
        }
    }

    /// The next line that is already there.
    pub(super) fn next(&mut self) -> Result<Option<Line>, BusError> {
        let gone = |error: io::Error| BusError::Gone(self.name.clone(), error);
        loop {
            while self.unread.0 < self.unread.1 {
                let byte = self.buffer.get(self.unread.0).copied().unwrap_or_default();
                self.unread.0 += 1;
                if let Some(line) = self.lines.take(byte) {
                    return Ok(Some(line));
                }
            }
            match read(&self.fd, &mut self.buffer) {
                Ok(0) => return Err(gone(io::ErrorKind::UnexpectedEof.into())),
                Ok(n) => self.unread = (0, n),
                Err(Errno::AGAIN) => return Ok(None),
                Err(Errno::INTR) => {}
                Err(error) => return Err(gone(error.into())),
            }
        }
    }

    /// Lines that are written in part only.
    pub(super) fn backlog(&self) -> u32 {
        u32::from(!self.unwritten.is_empty())
    }

    /// Writes a frame, or nothing of it where there is no room.
    pub(super) fn send(&mut self, frame: &Frame) -> Result<Sent, BusError> {
        let mut line = [0; MAX_LINE];
        let used = slcan::write(frame, &mut line);
        self.send_line(line.get(..used).unwrap_or_default())
    }

    /// Writes a line with its end, or nothing of it where there is no room.
    pub(super) fn send_line(&mut self, line: &[u8]) -> Result<Sent, BusError> {
        loop {
            let (rest, _) = self.unwritten.as_slices();
            match write(&self.fd, if rest.is_empty() { line } else { rest }) {
                Ok(n) if rest.is_empty() => {
                    self.unwritten.extend(line.iter().skip(n));
                    return Ok(Sent::Taken);
                }
                Ok(n) => drop(self.unwritten.drain(..n)),
                Err(Errno::AGAIN) => return Ok(Sent::Dropped),
                Err(Errno::INTR) => {}
                Err(error) => return Err(BusError::Gone(self.name.clone(), error.into())),
            }
        }
    }
}
