//! The text of a file, and the line and column of any byte of it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{LoadError, Outcome};
use crate::report::{Diagnostics, Span};

/// Largest file that is read `[byte]`.
pub(crate) const LARGEST: usize = 64 << 20;
/// Deepest nesting of elements, lists and mappings that is read.
pub(crate) const DEEPEST: usize = 64;

/// Bytes between two entries of [`Text::counts`].
const BLOCK: usize = 256;

/// The text of one file.
#[derive(Debug)]
pub(crate) struct Text {
    pub(crate) file: u32,
    pub(crate) content: String,
    /// First byte of each line.
    lines: Vec<usize>,
    /// Characters before each block of bytes, so that a column costs little even on a line of
    /// megabytes.
    counts: Vec<usize>,
}

impl Text {
    /// Checks size and encoding; a byte order mark is dropped. `None` after an error.
    pub(crate) fn new(name: &str, bytes: Vec<u8>, diagnostics: &mut Diagnostics) -> Option<Text> {
        let file = diagnostics.add_file(name);
        if bytes.len() > LARGEST {
            let help = "leave out what a robot does not need";
            let found = format!("the file is larger than {} MiB", LARGEST >> 20);
            return diagnostics.refused(Span::start(file), found, "a robot of ordinary size", help);
        }
        let mut bytes = bytes;
        let good = str::from_utf8(&bytes).map_or_else(|error| error.valid_up_to(), str::len);
        let fault = bytes.get(good).copied();
        bytes.truncate(good);
        let content = String::from_utf8(bytes).unwrap_or_default();
        let content = content.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(content);
        let lines = line_starts(&content);
        let counts = character_counts(&content);
        let text = Text { file, content, lines, counts };
        if let Some(bad) = fault {
            let span = text.span(text.content.len());
            let found = format!("the byte 0x{bad:02x} is not UTF-8");
            return diagnostics.refused(span, found, "UTF-8 text", "save the file as UTF-8");
        }
        Some(text)
    }

    /// Makes elements of an undeclared prefix readable: its colon becomes an underscore, and every
    /// position stays the same.
    pub(crate) fn join_stray_prefix(&mut self, prefix: &str, diagnostics: &mut Diagnostics) {
        if self.content.contains(&format!("xmlns:{prefix}")) {
            return;
        }
        let tags = [format!("<{prefix}:"), format!("</{prefix}:")];
        let Some(first) = tags.first().and_then(|tag| self.content.find(tag.as_str())) else {
            return;
        };
        let declaration = format!("xmlns:{prefix}=\"…\" on the outermost element");
        let found = format!("the prefix `{prefix}` is not declared");
        diagnostics.warning(self.span(first), found, declaration, "declare it");
        for tag in &tags {
            self.content = self.content.replace(tag.as_str(), &tag.replace(':', "_"));
        }
    }

    /// Line and column of a byte.
    pub(crate) fn span(&self, offset: usize) -> Span {
        let offset = offset.min(self.content.len());
        let line = self.lines.partition_point(|start| *start <= offset).max(1);
        let start = self.lines.get(line - 1).copied().unwrap_or(0);
        let column = self.characters_before(offset) - self.characters_before(start) + 1;
        Span { file: self.file, line: line as u32, column: column as u32 }
    }

    /// The byte of a line and a column.
    pub(crate) fn offset(&self, span: Span) -> Option<usize> {
        let start = *self.lines.get(span.line as usize - 1)?;
        let columns = span.column as usize - 1;
        self.content.get(start..)?.char_indices().nth(columns).map(|(at, _)| start + at)
    }

    /// A position that a parser reports, kept within the text: some count a line behind the last.
    pub(crate) fn span_at(&self, line: usize, column: usize) -> Span {
        let Some(start) = self.lines.get(line.max(1) - 1) else {
            return self.span(self.content.len());
        };
        let end = self.lines.get(line.max(1)).map_or(self.content.len(), |next| next - 1);
        let last = self.span(end.max(*start));
        Span { column: last.column.min(column.max(1) as u32), ..last }
    }

    fn characters_before(&self, offset: usize) -> usize {
        let block = offset / BLOCK;
        let before = self.counts.get(block).copied().unwrap_or(0);
        let rest = self.content.as_bytes().get(block * BLOCK..offset).unwrap_or_default();
        before + count_characters(rest)
    }
}

/// A file's name for messages and its bytes, at most one more than [`LARGEST`].
pub(crate) fn read(path: &Path) -> Outcome<(String, Vec<u8>)> {
    let name = path.display().to_string();
    let unreadable = |error: std::io::Error| LoadError::Open(name.clone(), error.to_string());
    let file = File::open(path).map_err(unreadable)?;
    let mut bytes = Vec::new();
    file.take(LARGEST as u64 + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    Ok((name, bytes))
}

/// As [`read`], of a file that another file names: it must be an ordinary one, because reading a
/// device or a pipe may block.
pub(crate) fn read_named(path: &Path) -> Outcome<(String, Vec<u8>)> {
    match path.metadata() {
        Ok(metadata) if !metadata.is_file() => {
            Err(LoadError::Open(path.display().to_string(), "it is no ordinary file".to_owned()))
        }
        _ => read(path),
    }
}

fn line_starts(content: &str) -> Vec<usize> {
    let after_breaks = content.match_indices('\n').map(|(offset, _)| offset + 1);
    core::iter::once(0).chain(after_breaks).collect()
}

fn character_counts(content: &str) -> Vec<usize> {
    let mut before = 0;
    let blocks = content.as_bytes().chunks(BLOCK).map(|block| {
        before += count_characters(block);
        before
    });
    core::iter::once(0).chain(blocks).collect()
}

/// Characters that begin in these bytes of UTF-8.
fn count_characters(bytes: &[u8]) -> usize {
    bytes.iter().filter(|byte| **byte & 0xc0 != 0x80).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_characters_from_one() {
        let mut diagnostics = Diagnostics::new(false);
        let content = format!("\u{feff}a\r\nb¨c{}x", "é".repeat(1000));
        let Some(text) = Text::new("f", content.into_bytes(), &mut diagnostics) else {
            return assert!(!diagnostics.has_errors());
        };
        let at = |offset| (text.span(offset).line, text.span(offset).column);
        assert_eq!(at(0), (1, 1));
        assert_eq!(at(3), (2, 1));
        assert_eq!(at(6), (2, 3));
        assert_eq!(at(text.content.len() - 1), (2, 1004));
        assert_eq!(at(usize::MAX), (2, 1005));
    }
}
