//! The parts of a report: its sections, their tables and stress cases.

use serde::Serialize;

use super::figure::Figure;
use super::pareto::exponent;

/// The contents of the page.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The command that repeats the measurement.
    pub command: String,
    /// The machine.
    pub machine: String,
    /// The date, as year, month and day.
    pub date: String,
    /// True for a quick report.
    pub quick: bool,
    /// In their order.
    pub sections: Vec<Section>,
}

impl Report {
    /// Number of stress cases.
    pub fn cases(&self) -> usize {
        self.results().count()
    }

    /// Number of silent failures.
    pub fn silent_failures(&self) -> usize {
        self.results().filter(|case| case.assessment == Assessment::FailedSilently).count()
    }

    /// The largest error of an answer without a warning; none if no section has one.
    pub fn worst_error(&self) -> Option<f64> {
        self.sections.iter().filter_map(|section| section.worst_error).reduce(f64::max)
    }

    /// The findings, a line each.
    pub fn summary(&self) -> Vec<String> {
        let worst = self.worst_error().map_or("-".to_owned(), exponent);
        let mut lines = vec![format!(
            "worst error {worst}, {} stress cases, {} silent failures",
            self.cases(),
            self.silent_failures()
        )];
        for section in &self.sections {
            lines.extend(section.summary.iter().cloned());
            let failed = |failure: &String| format!("{}: not finished. {failure}", section.title);
            lines.extend(section.failure.iter().map(failed));
        }
        lines
    }

    fn results(&self) -> impl Iterator<Item = &Case> {
        self.sections.iter().flat_map(|section| &section.cases)
    }

    /// The command that repeats a section.
    pub(super) fn command_of(&self, section: &Section) -> String {
        command(self.quick, std::iter::once(section.name))
    }
}

/// A part of the page.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Section {
    /// The name that `--section` takes.
    pub name: &'static str,
    /// The heading.
    pub title: String,
    /// The findings, a sentence each, for the top of the page.
    pub summary: Vec<String>,
    /// The largest error of an answer without a warning, by the defaults.
    pub worst_error: Option<f64>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Tables without a picture.
    pub tables: Vec<Table>,
    /// Stress cases with their assessments.
    #[serde(skip)]
    pub cases: Vec<Case>,
    /// The reason why the section is incomplete.
    pub failure: Option<String>,
}

impl Section {
    /// An empty section.
    pub fn new(name: &'static str, title: &str) -> Section {
        Section { name, title: title.to_owned(), ..Section::default() }
    }
}

/// A table and its caption.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Table {
    /// Unique on the page, like a figure's.
    pub id: String,
    /// Its title.
    pub title: String,
    /// Notes for the reader.
    pub caption: String,
    /// Heads.
    pub columns: Vec<String>,
    /// Cells, as many in each row as there are heads.
    pub rows: Vec<Vec<String>>,
}

/// The names of columns, which bars separate.
pub(crate) fn columns(names: &str) -> Vec<String> {
    names.split(" | ").map(str::to_owned).collect()
}

sarrus_dynamics::named_enum! {
    /// The outcome of a stress case, from good to bad.
    #[derive(Default)]
    pub enum Assessment {
        /// A good answer.
        Held = "held",
        /// A worse answer that carries a warning.
        Degraded = "degraded and said so",
        /// No answer, and a reason.
        Failed = "failed and said so",
        /// A bad answer without a warning; also a case that is not assessed.
        #[default]
        FailedSilently = "failed silently",
    }
}

/// A stress case: a robot, a parameter at a value, a question, and the result.
#[derive(Clone, Debug, Default)]
pub struct Case {
    /// The family, such as `mass ratio`.
    pub family: &'static str,
    /// The robot.
    pub robot: String,
    /// The swept parameter, with its unit.
    pub parameter: &'static str,
    /// Its value.
    pub value: f64,
    /// The question.
    pub asked: String,
    /// The method of the answer: closures, and the method of forward dynamics.
    pub method: String,
    /// By size; none without an answer.
    pub error: Option<f64>,
    /// Forward dynamics: the backward error.
    pub backward: Option<f64>,
    /// Time of a call in nanoseconds, if measured.
    pub nanoseconds: Option<f64>,
    /// The reference of the comparison.
    pub reference: &'static str,
    /// The status, as `sarrus ask` prints it, or why it did not load.
    pub status: String,
    /// Warnings of the answer.
    pub warnings: Vec<String>,
    /// Reports other than status and warnings: fields, messages.
    pub reported: String,
    /// The assessment, by one rule for all cases.
    pub assessment: Assessment,
}

impl Case {
    /// The question and the method.
    pub(super) fn way(&self) -> String {
        format!("{}, {}", self.asked, self.method)
    }

    /// Warnings and further reports.
    pub(crate) fn told(&self) -> String {
        let mut told = self.warnings.clone();
        told.extend((!self.reported.is_empty()).then(|| self.reported.clone()));
        told.join("; ")
    }
}

/// The command that repeats these sections.
pub(crate) fn command<'a>(quick: bool, sections: impl Iterator<Item = &'a str>) -> String {
    let quick = if quick { " --quick" } else { "" };
    sections.fold(format!("sarrus report{quick}"), |command, name| command + " --section " + name)
}
