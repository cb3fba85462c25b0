//! Lines on stderr that never block.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use sarrus_proto::socket::timespec;

/// Bytes that a pipe with any room takes at once (PIPE_BUF).
pub const LONGEST: usize = 4096;

/// Whether stderr or stdout has room for a line of [`LONGEST`] bytes.
pub fn has_room(out: &impl AsFd) -> bool {
    let mut descriptors = [PollFd::new(out, PollFlags::OUT)];
    poll(&mut descriptors, Some(&timespec(Duration::ZERO)))
        .is_ok_and(|_| descriptors[0].revents().contains(PollFlags::OUT))
}

/// Writes a line, or omits it where stderr has no room or no reader.
///
/// A writer of another process that fills the last room between the look and the write makes this
/// thread wait for the reader.
pub fn line(text: Arguments<'_>) {
    let mut line = text.to_string().into_bytes();
    line.truncate(LONGEST - 1);
    line.push(b'\n');
    let mut stderr = io::stderr().lock();
    if has_room(&stderr) {
        let _ = stderr.write_all(&line);
    }
}
