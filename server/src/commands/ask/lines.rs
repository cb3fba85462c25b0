//! Lines of any content and bounded length.

use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::os::fd::AsFd;

use rustix::event::PollFlags;

use crate::commands::output::wait_for;

/// The longest line that is read.
pub(super) const LONGEST: usize = 64 << 20;
/// Bytes of the buffer that are kept for the next line.
const USUAL: usize = 1 << 20;

/// Bytes of one read.
const AT_ONCE: usize = 64 << 10;

/// The mark that some editors put before the first line.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// A stream whose reads block, also where it was opened not to block.
pub(super) struct Patient<R>(pub(super) R);

impl<R: Read + AsFd> Read for Patient<R> {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.0.read(room) {
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    wait_for(&self.0, PollFlags::IN)?;
                }
                outcome => return outcome,
            }
        }
    }
}

/// Lines of a source, one at a time.
pub(super) struct Lines<R> {
    source: BufReader<R>,
    line: Vec<u8>,
    /// `line` is the beginning of the next one.
    is_begun: bool,
    /// No line was read yet.
    is_first: bool,
}

/// The next line, or its absence.
pub(super) enum Line<'a> {
    /// A line that is not blank.
    Text(&'a [u8]),
    /// A line that is longer than [`LONGEST`]; it was skipped.
    TooLong,
    /// The end of the source.
    End,
}

impl<R: Read> Lines<R> {
    pub(super) fn new(source: R) -> Lines<R> {
        let source = BufReader::with_capacity(AT_ONCE, source);
        Lines { source, line: Vec::new(), is_begun: false, is_first: true }
    }

    /// The next line that is not blank.
    pub(super) fn next(&mut self) -> io::Result<Line<'_>> {
        loop {
            self.begin();
            self.is_begun = false;
            let room = (LONGEST + 1).saturating_sub(self.line.len());
            (&mut self.source).take(room as u64).read_until(b'\n', &mut self.line)?;
            if self.line.is_empty() {
                return Ok(Line::End);
            }
            if std::mem::take(&mut self.is_first) && self.line.starts_with(BYTE_ORDER_MARK) {
                self.line.drain(..BYTE_ORDER_MARK.len());
            }
            if self.line.len() > LONGEST && self.line.last() != Some(&b'\n') {
                self.source.skip_until(b'\n')?;
                return Ok(Line::TooLong);
            }
            if !self.line.trim_ascii().is_empty() {
                break;
            }
        }
        Ok(Line::Text(self.line.trim_ascii_end()))
    }

    /// True if [`Lines::next`] would wait for the rest of a line; `has_more` reports whether the
    /// source has bytes or has ended.
    pub(super) fn would_wait(&mut self, has_more: impl Fn() -> bool) -> io::Result<bool> {
        self.begin();
        loop {
            let buffer = self.source.buffer();
            let end = buffer.iter().position(|byte| *byte == b'\n');
            if self.line.len() > LONGEST {
                // the rest of the line is skipped as soon as it arrives
                return Ok(end.is_none());
            }
            let n = end.map_or(buffer.len(), |end| end + 1);
            if end.is_some() {
                let is_blank = |part: &[u8]| part.trim_ascii().is_empty();
                if !(is_blank(&self.line) && is_blank(&buffer[..n]))
                    || self.line.len() + n > LONGEST
                {
                    return Ok(false);
                }
                self.line.clear();
                self.source.consume(n);
                continue;
            }
            self.line.extend_from_slice(buffer);
            self.source.consume(n);
            if !has_more() {
                return Ok(true);
            }
            if self.source.fill_buf()?.is_empty() {
                return Ok(false);
            }
        }
    }

    /// Empties the buffer, unless it holds the beginning of the next line.
    fn begin(&mut self) {
        if !self.is_begun {
            self.line.clear();
            self.line.shrink_to(USUAL);
        }
        self.is_begun = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blank_lines_are_skipped_and_the_last_one_needs_no_end() {
        let mut lines = Lines::new(&b"\n \r\n a \r\n\nb"[..]);
        let mut found = Vec::new();
        while let Line::Text(line) = lines.next().unwrap() {
            found.push(line.to_owned());
        }
        assert_eq!(found, [&b" a"[..], b"b"]);
    }

    #[test]
    fn a_byte_order_mark_is_skipped_once_and_only_at_the_start() {
        let all = |text: &[u8]| {
            let mut lines = Lines::new(text);
            let mut found = Vec::new();
            while let Line::Text(line) = lines.next().unwrap() {
                found.push(line.to_owned());
            }
            found
        };
        assert_eq!(all(b"\xef\xbb\xbfa\nb"), [&b"a"[..], b"b"]);
        assert_eq!(all(b"\xef\xbb\xbf\n\xef\xbb\xbfb"), [b"\xef\xbb\xbfb"]);
        assert_eq!(all(b"\xef\xbb\xbf\xef\xbb\xbfb"), [b"\xef\xbb\xbfb"]);
        assert!(all(b"\xef\xbb\xbf").is_empty());
    }

    #[test]
    fn a_stream_that_does_not_wait_is_waited_for() {
        let (mut there, here) = std::os::unix::net::UnixStream::pair().unwrap();
        here.set_nonblocking(true).unwrap();
        let writer = std::thread::spawn(move || {
            for part in [&b"on"[..], b"e\ntwo"] {
                std::thread::sleep(std::time::Duration::from_millis(20));
                io::Write::write_all(&mut there, part).unwrap();
            }
        });
        let mut lines = Lines::new(Patient(here));
        assert!(matches!(lines.next().unwrap(), Line::Text(b"one")));
        assert!(matches!(lines.next().unwrap(), Line::Text(b"two")));
        assert!(matches!(lines.next().unwrap(), Line::End));
        writer.join().unwrap();
    }

    #[test]
    fn a_line_beyond_the_limit_is_skipped_whole() {
        let long = vec![b'x'; LONGEST + 5];
        let mut lines = Lines::new((&long[..]).chain(&b"\nafter\n"[..]));
        assert!(matches!(lines.next().unwrap(), Line::TooLong));
        assert!(matches!(lines.next().unwrap(), Line::Text(b"after")));
        assert!(matches!(lines.next().unwrap(), Line::End));
    }

    #[test]
    fn a_pause_is_where_no_whole_line_has_come() {
        // pieces as a pipe has them: between two of them the source has no bytes
        let pieces: [&[u8]; 5] = [b"one\ntwo\nth", b"r", b"ee\n\n \n", b"four\n", b"five"];
        let left = std::cell::RefCell::new(pieces.to_vec());
        struct Pipe<'a, 'b>(&'a std::cell::RefCell<Vec<&'b [u8]>>);
        impl Read for Pipe<'_, '_> {
            fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
                let mut left = self.0.borrow_mut();
                let piece = if left.is_empty() { &b""[..] } else { left.remove(0) };
                room[..piece.len()].copy_from_slice(piece);
                Ok(piece.len())
            }
        }
        let mut lines = Lines::new(Pipe(&left));
        let mut found = Vec::new();
        while let Line::Text(line) = lines.next().unwrap() {
            found.push(String::from_utf8(line.to_owned()).unwrap());
            // no more input now
            found.push(lines.would_wait(|| false).unwrap().to_string());
            // and again when input arrives
            if found.last().unwrap() == "true" {
                found.push(lines.would_wait(|| true).unwrap().to_string());
            }
        }
        let expected = "one false two true false three true false four true false five true false";
        assert_eq!(found.join(" "), expected);
    }
}
