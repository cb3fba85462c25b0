//! Faults of robot files and warnings about them, collected while the files are read and reported
//! all at once.

use core::fmt;
use std::collections::BTreeSet;

use serde::Serialize;

use crate::names::{nearest, nearest_first, visible};

pub use crate::names::quoted;

/// Faults of one severity that a report holds; a hostile file could have millions.
const MOST: usize = 1000;

/// One fault or warning with its position in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Diagnostic {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The finding, whole; a line of text is cut at 400 characters.
    pub found: String,
    /// The expected content.
    pub expected: String,
    /// The correction.
    pub help: String,
}

/// Most characters of a message as data: only a hostile file has more.
const LONGEST: usize = 1 << 14;
/// Most characters of a line, of the file name in it, and of the text between its parts.
const LONGEST_LINE: usize = 400;
const LONGEST_FILE: usize = 120;
const BETWEEN: usize = 42;

impl Diagnostic {
    /// The line of a warning: as [`fmt::Display`], with the word behind the position.
    pub fn as_warning(&self) -> String {
        format!("{}warning: {}", self.position(), self.message())
    }

    /// The line of a note, likewise.
    pub fn as_note(&self) -> String {
        format!("{}note: {}; {}", self.position(), self.found, self.help)
    }

    /// The position; a long file name is cut to its end.
    fn position(&self) -> String {
        let Diagnostic { file, line, column, .. } = self;
        let excess = file.chars().count().saturating_sub(LONGEST_FILE);
        if excess == 0 {
            return format!("{file}:{line}:{column}: ");
        }
        let end: String = file.chars().skip(excess + 1).collect();
        format!("…{end}:{line}:{column}: ")
    }

    /// The message, cut where the line would be too long.
    fn message(&self) -> String {
        let Diagnostic { file, found, expected, help, .. } = self;
        let most = LONGEST_LINE - BETWEEN - file.chars().count().min(LONGEST_FILE);
        let [found, expected, help] = bounded([found, expected, help].map(String::as_str), most);
        format!("{found}, expected {expected}, {help}")
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.position(), self.message())
    }
}

/// All findings in the files of one robot, in the order of file, line and column.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Name of the robot, if it was read.
    #[serde(skip)]
    pub robot: Option<String>,
    /// Warnings, which do not prevent a compilation.
    pub warnings: Vec<Diagnostic>,
    /// Faults to correct.
    pub errors: Vec<Diagnostic>,
    /// Choices of a conversion, and parts of its file without influence on the dynamics.
    #[serde(skip)]
    pub notes: Vec<Diagnostic>,
}

impl fmt::Display for Report {
    /// One diagnostic a line, errors first.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut all = self.errors.iter().chain(&self.warnings);
        all.try_for_each(|diagnostic| writeln!(f, "{diagnostic}"))
    }
}

/// A position in one of the files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Span {
    pub(crate) file: u32,
    pub(crate) line: u32,
    pub(crate) column: u32,
}

impl Span {
    /// The position of a missing item that belongs to no node.
    pub const fn start(file: u32) -> Span {
        Span { file, line: 1, column: 1 }
    }
}

/// A part of a message.
pub trait Word: Into<String> {}

impl<T: Into<String>> Word for T {}

/// Collects diagnostics while the files are read.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics {
    /// The names of the files, by their numbers.
    pub(crate) files: Vec<String>,
    errors: Pile,
    warnings: Pile,
    notes: Pile,
    /// Kinds and names of parts.
    names: BTreeSet<String>,
    /// Faults of the dynamics that still leave a model count as warnings.
    pub(crate) lenient: bool,
}

#[derive(Clone, Debug, Default)]
struct Pile {
    diagnostics: Vec<(Span, Diagnostic)>,
    dropped: usize,
}

impl Diagnostics {
    /// None so far; `lenient` makes faults of the dynamics warnings where they leave a model.
    pub fn new(lenient: bool) -> Diagnostics {
        Diagnostics { lenient, ..Diagnostics::default() }
    }

    /// Adds a file under the user's name for it; returns its number for [`Span`].
    pub fn add_file(&mut self, name: &str) -> u32 {
        self.files.push(name.to_owned());
        self.files.len() as u32 - 1
    }

    /// Adds a fault.
    pub fn error(&mut self, span: Span, found: impl Word, expected: impl Word, help: impl Word) {
        let diagnostic = self.diagnostic(span, found.into(), expected.into(), help.into());
        self.errors.push(span, diagnostic);
    }

    /// Adds a fault that leaves nothing of the item.
    pub fn refused<T>(
        &mut self,
        span: Span,
        found: impl Word,
        expected: impl Word,
        help: impl Word,
    ) -> Option<T> {
        self.error(span, found, expected, help);
        None
    }

    /// Adds a warning.
    pub fn warning(&mut self, span: Span, found: impl Word, expected: impl Word, help: impl Word) {
        let diagnostic = self.diagnostic(span, found.into(), expected.into(), help.into());
        self.warnings.push(span, diagnostic);
    }

    /// Adds a note, which expects nothing else.
    pub fn note(&mut self, span: Span, found: impl Word, help: impl Word) {
        let diagnostic = self.diagnostic(span, found.into(), String::new(), help.into());
        self.notes.push(span, diagnostic);
    }

    /// A fault of the dynamics that still leaves a model: a warning when the caller is lenient.
    pub fn dynamics(&mut self, span: Span, found: impl Word, expected: impl Word, help: impl Word) {
        if self.lenient {
            self.warning(span, found, expected, help);
        } else {
            let help = format!("{}, or take it as it is with --lenient", help.into());
            self.error(span, found, expected, help);
        }
    }

    /// An unknown name, with the nearest known one, else `otherwise`, as help.
    pub(crate) fn unknown<'a>(
        &mut self,
        span: Span,
        found: impl Word,
        expected: impl Word,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
        otherwise: &str,
    ) {
        let help = self.did_you_mean(name, known, otherwise);
        self.error(span, found, expected, help);
    }

    /// A second part of this name; `kind` names such parts in the message.
    pub(crate) fn second(&mut self, span: Span, kind: &str, name: &str) {
        let found = format!("a second {kind} is named {}", quoted(name));
        self.error(span, found, "a name of its own", "rename one of them");
    }

    /// Notes the name of a part, and reports a second one.
    pub(crate) fn named(&mut self, span: Span, kind: &str, name: &str) {
        if !name.is_empty() && !self.names.insert(format!("{kind} {name}")) {
            self.second(span, kind, name);
        }
    }

    /// True after a fault.
    pub fn has_errors(&self) -> bool {
        !self.errors.diagnostics.is_empty()
    }

    /// "did you mean …?" with the nearest known name, else `otherwise`.
    pub fn did_you_mean<'a>(
        &self,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
        otherwise: impl Into<String>,
    ) -> String {
        // thousands of unknown names need no thousands of suggestions
        let is_full = self.errors.is_full() || self.warnings.is_full();
        let near = if is_full { None } else { nearest(name, known) };
        near.map_or_else(|| otherwise.into(), |near| format!("did you mean `{near}`?"))
    }

    /// The known names of a kind for a message, the nearest first.
    pub(crate) fn one_of<'a>(
        &self,
        kind: &str,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
    ) -> String {
        // many unknown names need no repeated lists
        const MOST_LISTS: usize = 8;
        if self.errors.diagnostics.len() < MOST_LISTS {
            let known = known.into_iter().filter(|known| !known.is_empty());
            format!("{kind}: {}", nearest_first(name, known, 150))
        } else {
            kind.to_owned()
        }
    }

    /// The report, sorted by position.
    pub fn into_report(self) -> Report {
        Report {
            robot: None,
            warnings: self.warnings.sorted("warnings"),
            errors: self.errors.sorted("errors"),
            notes: self.notes.sorted("notes"),
        }
    }

    fn diagnostic(&self, span: Span, found: String, expected: String, help: String) -> Diagnostic {
        let file = self.files.get(span.file as usize).cloned().unwrap_or_default();
        let parts = [found, expected, help].map(|part| visible(&part));
        let [found, expected, help] = bounded(parts.each_ref().map(String::as_str), LONGEST);
        let [line, column] = [span.line, span.column].map(|count| count as usize);
        Diagnostic { file, line, column, found, expected, help }
    }
}

impl Pile {
    fn is_full(&self) -> bool {
        self.diagnostics.len() >= MOST
    }

    fn push(&mut self, span: Span, diagnostic: Diagnostic) {
        let new = (span, diagnostic);
        if self.is_full() {
            self.dropped += 1;
        } else if !self.diagnostics.contains(&new) {
            self.diagnostics.push(new);
        }
    }

    fn sorted(mut self, what: &str) -> Vec<Diagnostic> {
        self.diagnostics.sort_by_key(|(span, _)| *span);
        let mut diagnostics: Vec<Diagnostic> =
            self.diagnostics.into_iter().map(|(_, diagnostic)| diagnostic).collect();
        if self.dropped > 0
            && let Some(last) = diagnostics.last().cloned()
        {
            diagnostics.push(Diagnostic {
                found: format!("{} further {what} are not listed", self.dropped),
                expected: format!("at most {MOST}"),
                help: "correct those above first".to_owned(),
                ..last
            });
        }
        diagnostics
    }
}

/// The parts of a message in at most this many characters: the longest part is cut if they are too
/// long.
fn bounded(parts: [&str; 3], most: usize) -> [String; 3] {
    let mut parts = parts.map(str::to_owned);
    let length = |part: &String| part.chars().count();
    loop {
        let excess = parts.iter().map(length).sum::<usize>().saturating_sub(most);
        let Some(part) = parts.iter_mut().max_by_key(|part| length(part)) else { return parts };
        if excess == 0 {
            return parts;
        }
        // never shorter than its share, so that each part stays
        let kept = length(part).saturating_sub(excess + 1).max(most / 3 - 1);
        *part = part.chars().take(kept).chain(['…']).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::{Diagnostics, LONGEST_LINE, Span, bounded};

    #[test]
    fn a_line_with_its_position_is_at_most_400_characters_whatever_the_file_is_called() {
        let mut diagnostics = Diagnostics::new(false);
        let file = diagnostics.add_file(&"folder/".repeat(10));
        let span = Span { file, line: 123_456, column: 12_345 };
        diagnostics.warning(span, "a".repeat(300), "b".repeat(300), "c".repeat(300));
        for warning in diagnostics.into_report().warnings {
            assert!(format!("warning: {warning}").chars().count() <= 400, "{warning}");
        }
    }

    #[test]
    fn a_message_is_one_line_of_bounded_length_and_keeps_its_parts() {
        assert_eq!(bounded(["a", "c", "d"], 360), ["a", "c", "d"]);
        for lengths in [[500, 10, 10], [500, 500, 500], [119, 121, 121], [0, 0, 361]] {
            let long = lengths.map(|n| "é".repeat(n));
            let cut = bounded(long.each_ref().map(String::as_str), 360);
            let kept = cut.each_ref().map(|part| part.chars().count());
            assert!(kept.iter().sum::<usize>() <= 360, "{lengths:?}: {kept:?}");
            assert!(kept.iter().zip(lengths).all(|(kept, n)| *kept >= n.min(119)), "{kept:?}");
        }
    }

    #[test]
    fn a_message_as_data_is_whole_on_one_line() {
        let mut diagnostics = Diagnostics::new(false);
        let span = Span::start(diagnostics.add_file("f"));
        diagnostics.error(span, "é".repeat(5000), "a\nb", "c");
        let report = diagnostics.into_report();
        let [error] = &report.errors[..] else { return assert_eq!(report.errors.len(), 1) };
        assert_eq!((error.found.as_str(), error.expected.as_str()), (&*"é".repeat(5000), "a\\nb"));
        assert!(error.to_string().chars().count() <= LONGEST_LINE);
    }

    #[test]
    fn a_line_is_bounded_with_the_name_of_its_file() {
        for file in ["é".repeat(500), "f".repeat(119), String::new()] {
            let mut diagnostics = Diagnostics::new(false);
            let file = diagnostics.add_file(&file);
            let span = Span { file, line: 99_999_999, column: 99_999_999 };
            for n in [1, 130, 1000] {
                diagnostics.warning(span, "a".repeat(n), "b".repeat(n), "c".repeat(n));
            }
            for warning in diagnostics.into_report().warnings {
                let line = warning.as_warning();
                assert!(line.chars().count() <= LONGEST_LINE, "{line}");
                assert!(line.contains(":99999999:99999999: warning: a"), "{line}");
            }
        }
    }
}
