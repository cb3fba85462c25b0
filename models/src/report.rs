//! What is wrong with, or remarkable about, robot files: collected while they are read, told all at
//! once.

use core::fmt;

use serde::Serialize;

use crate::nearest::nearest;

/// Faults of one severity that a report holds; a hostile file could have millions.
const MOST: usize = 1000;

/// One fault or warning with its place in a file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Finding {
    /// The file as the user named it.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// What was found.
    pub found: String,
    /// What was expected.
    pub expected: String,
    /// What to do.
    pub help: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Finding { file, line, column, found, expected, help } = self;
        write!(f, "{file}:{line}:{column}: {found}, expected {expected}, {help}")
    }
}

/// Everything that was found in the files of one robot, in the order of file, line and column.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Name of the robot, as far as it was read.
    #[serde(skip)]
    pub robot: Option<String>,
    /// What may stay.
    pub warnings: Vec<Finding>,
    /// What must be mended.
    pub errors: Vec<Finding>,
}

impl fmt::Display for Report {
    /// One finding a line, errors first.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.errors.iter().chain(&self.warnings).try_for_each(|finding| writeln!(f, "{finding}"))
    }
}

/// A place in one of the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    pub(crate) file: u32,
    pub(crate) line: u32,
    pub(crate) column: u32,
}

impl Place {
    /// Where a fault of absence stands when no node lacks it.
    pub const fn start(file: u32) -> Place {
        Place { file, line: 1, column: 1 }
    }
}

/// Collects findings while the files are read.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    files: Vec<String>,
    errors: Pile,
    warnings: Pile,
    /// Faults of mass and inertia count as warnings.
    pub(crate) lenient: bool,
}

#[derive(Clone, Debug, Default)]
struct Pile {
    findings: Vec<(Place, Finding)>,
    dropped: usize,
}

impl Findings {
    /// None so far; `lenient` makes faults of mass and inertia warnings.
    pub fn new(lenient: bool) -> Findings {
        Findings { lenient, ..Findings::default() }
    }

    /// Adds a file, by the name that the user knows; the number stands for it in [`Place`].
    pub fn add_file(&mut self, name: &str) -> u32 {
        self.files.push(name.to_owned());
        self.files.len() as u32 - 1
    }

    /// Adds what must be mended.
    pub fn error(
        &mut self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) {
        let finding = self.finding(place, found.into(), expected.into(), help.into());
        self.errors.push(place, finding);
    }

    /// Adds what may stay.
    pub fn warning(
        &mut self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) {
        let finding = self.finding(place, found.into(), expected.into(), help.into());
        self.warnings.push(place, finding);
    }

    /// A fault of mass or inertia: a warning when the caller is lenient.
    pub fn inertia(
        &mut self,
        place: Place,
        found: impl Into<String>,
        expected: impl Into<String>,
        help: impl Into<String>,
    ) {
        if self.lenient {
            self.warning(place, found, expected, help);
        } else {
            self.error(place, found, expected, help);
        }
    }

    /// Whether something must be mended.
    pub fn has_errors(&self) -> bool {
        !self.errors.findings.is_empty()
    }

    /// "did you mean …?" with the nearest known name, else `otherwise`.
    pub fn did_you_mean<'a>(
        &self,
        name: &str,
        known: impl IntoIterator<Item = &'a str>,
        otherwise: impl Into<String>,
    ) -> String {
        // a file with thousands of unknown names has no use for thousands of suggestions
        let near = if self.errors.is_full() || self.warnings.is_full() {
            None
        } else {
            nearest(name, known)
        };
        near.map_or_else(|| otherwise.into(), |near| format!("did you mean `{near}`?"))
    }

    /// The report, sorted by place.
    pub fn into_report(self) -> Report {
        Report {
            robot: None,
            warnings: self.warnings.sorted("warnings"),
            errors: self.errors.sorted("errors"),
        }
    }

    fn finding(&self, place: Place, found: String, expected: String, help: String) -> Finding {
        let file = self.files.get(place.file as usize).cloned().unwrap_or_default();
        Finding {
            file,
            line: place.line as usize,
            column: place.column as usize,
            found,
            expected,
            help,
        }
    }
}

impl Pile {
    fn is_full(&self) -> bool {
        self.findings.len() >= MOST
    }

    fn push(&mut self, place: Place, finding: Finding) {
        if self.is_full() {
            self.dropped += 1;
        } else {
            self.findings.push((place, finding));
        }
    }

    fn sorted(mut self, what: &str) -> Vec<Finding> {
        self.findings.sort_by_key(|(place, _)| *place);
        let mut findings: Vec<Finding> =
            self.findings.into_iter().map(|(_, finding)| finding).collect();
        if self.dropped > 0
            && let Some(last) = findings.last().cloned()
        {
            findings.push(Finding {
                found: format!("{} further {what} are not listed", self.dropped),
                expected: format!("at most {MOST}"),
                help: "mend those above first".to_owned(),
                ..last
            });
        }
        findings
    }
}

/// A name for a message: in backticks, shortened when long, control characters made visible.
pub fn quoted(name: &str) -> String {
    const LONGEST: usize = 60;
    let mut shown = String::from("`");
    for character in name.chars().take(LONGEST) {
        if character.is_control() {
            shown.extend(character.escape_default());
        } else {
            shown.push(character);
        }
    }
    if name.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    shown.push('`');
    shown
}
