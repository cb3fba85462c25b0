//! Lines of any length and content, bounded.

use std::io::{self, BufRead, Read};

/// The longest line that is read.
pub(super) const LONGEST: usize = 64 << 20;
/// What is kept for the next line.
const USUAL: usize = 1 << 20;

/// Lines of a source, one at a time.
pub(super) struct Lines<R> {
    source: R,
    line: Vec<u8>,
}

/// What came.
pub(super) enum Line<'a> {
    /// A line with something on it.
    Text(&'a [u8]),
    /// A line that is longer than [`LONGEST`]; it was skipped.
    TooLong,
    /// The end of the source.
    End,
}

impl<R: BufRead> Lines<R> {
    pub(super) fn new(source: R) -> Lines<R> {
        Lines { source, line: Vec::new() }
    }

    /// The next line that is not blank.
    pub(super) fn next(&mut self) -> io::Result<Line<'_>> {
        loop {
            self.line.clear();
            self.line.shrink_to(USUAL);
            let read =
                (&mut self.source).take(LONGEST as u64 + 1).read_until(b'\n', &mut self.line)?;
            if read == 0 {
                return Ok(Line::End);
            }
            if read > LONGEST && self.line.last() != Some(&b'\n') {
                self.source.skip_until(b'\n')?;
                return Ok(Line::TooLong);
            }
            if !self.line.trim_ascii().is_empty() {
                break;
            }
        }
        Ok(Line::Text(self.line.trim_ascii_end()))
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
    fn a_line_beyond_the_limit_is_skipped_whole() {
        let long = vec![b'x'; LONGEST + 5];
        let mut lines = Lines::new(io::BufReader::new((&long[..]).chain(&b"\nafter\n"[..])));
        assert!(matches!(lines.next().unwrap(), Line::TooLong));
        assert!(matches!(lines.next().unwrap(), Line::Text(b"after")));
        assert!(matches!(lines.next().unwrap(), Line::End));
    }
}
