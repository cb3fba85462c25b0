//! Lines on stderr that never block.

use std::fmt::Arguments;
use std::io::{self, StderrLock, Write};
use std::os::fd::AsFd;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, poll};
use sarrus_proto::socket::timespec;

/// Bytes that a pipe with any room takes at once (PIPE_BUF).
const LONGEST: usize = 4096;

/// Whether stderr or stdout has room for a line of 4 KiB.
pub fn has_room(out: &impl AsFd) -> bool {
    let mut descriptors = [PollFd::new(out, PollFlags::OUT)];
    poll(&mut descriptors, Some(&timespec(Duration::ZERO)))
        .is_ok_and(|_| descriptors[0].revents().contains(PollFlags::OUT))
}

/// Writes a line with its end, or omits it where stderr has no room or no reader; false without
/// room. Bytes beyond 4 KiB are left out.
///
/// A writer of another process that fills the last room between the look and the write makes this
/// thread wait for the reader.
pub fn write(stderr: &mut StderrLock<'_>, line: &[u8]) -> bool {
    let has_room = has_room(stderr);
    if has_room {
        let _ = match line.get(..LONGEST - 1) {
            Some(start) if line.len() > LONGEST => stderr.write_all(&[start, b"\n"].concat()),
            _ => stderr.write_all(line),
        };
    }
    has_room
}

/// As [`write()`], for a text without its end.
pub fn line(text: Arguments<'_>) {
    write(&mut io::stderr().lock(), format!("{text}\n").as_bytes());
}
