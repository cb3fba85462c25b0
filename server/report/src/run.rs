//! Runs sections and writes their files.

use std::fs;
use std::path::PathBuf;
use std::time::UNIX_EPOCH;

use crate::measure::Effort;
use crate::measure::machine::machine;
use crate::measure::progress::Progress;
use crate::page::files::{files, with_names, write};
use crate::page::{Report, Section, command};
use crate::robots::{Own, Subject};
use crate::{Outcome, accuracy, integration, parts, stress};

/// The function that fills a section.
enum Fill {
    /// On the robots of the report, or on this one.
    Robots(fn(&Effort, Option<Subject>, &Progress) -> Outcome<Section>),
    /// On problems of its own.
    Problems(fn(&Effort, &Progress) -> Outcome<Section>),
}

/// Every section: its name, the function that fills it, and its share of a full report's time.
/// Flag, JSON and files use the name: `extremes` are the stress cases.
const SECTIONS: &[(&str, Fill, f64)] = &[
    ("accuracy", Fill::Robots(accuracy::run), 0.4),
    ("parts", Fill::Robots(parts::run), 0.05),
    #[cfg(feature = "generate")]
    ("generated", Fill::Robots(crate::generated::run), 0.1),
    ("integration", Fill::Problems(integration::run), 0.15),
    ("extremes", Fill::Problems(stress::run), 0.3),
];

/// Other words for sections.
const SYNONYMS: [(&str, &str); 1] = [("stress", "extremes")];

/// The names of all sections, in their order on the page.
pub fn names() -> impl Iterator<Item = &'static str> {
    SECTIONS.iter().map(|(name, ..)| *name)
}

/// Other words for the section of this name, which [`Options::sections`] may hold too.
pub fn synonyms(name: &str) -> impl Iterator<Item = &'static str> {
    SYNONYMS.iter().filter(move |(_, of)| *of == name).map(|(word, _)| *word)
}

/// A file that proves the folder writable.
const PROBE: &str = ".writable";

/// The sections to report and their folder.
#[derive(Clone, Debug)]
pub struct Options {
    /// The effort of the measurements.
    pub effort: Effort,
    /// Names of sections; empty for all.
    pub sections: Vec<String>,
    /// One robot in place of the report's own: the sections on robots alone.
    pub own: Option<Own>,
    /// The folder.
    pub out: PathBuf,
}

/// Runs the chosen sections in their order and writes the page and its data. A section that fails
/// is reported on the page.
///
/// # Errors
///
/// A folder that cannot be written.
pub fn run(options: &Options) -> Outcome<Report> {
    // finds an unwritable folder before the measurements, not after an hour; an earlier report
    // stays until then
    write(&options.out, PROBE, "")?;
    fs::remove_file(options.out.join(PROBE))
        .map_err(|error| format!("{}: {error}", options.out.display()))?;

    let progress = Progress::with_lines();
    let query = |name: &str| {
        let is = |word: &String| word == name || synonyms(name).any(|other| other == word);
        options.sections.is_empty() || options.sections.iter().any(is)
    };
    let applies = |fill: &Fill| options.own.is_none() || matches!(fill, Fill::Robots(_));
    let chosen: Vec<_> =
        SECTIONS.iter().filter(|(name, fill, _)| query(name) && applies(fill)).collect();
    let whole: f64 = chosen.iter().map(|(_, _, share)| share).sum();
    let mut sections = Vec::new();
    let mut done = 0.0;
    for (name, fill, share) in chosen {
        progress.part(done / whole, (done + share) / whole);
        let failed = |error: Box<dyn std::error::Error>| Section {
            failure: Some(error.to_string()),
            ..Section::new(name, name)
        };
        let filled = match fill {
            Fill::Robots(fill) => fill(&options.effort, options.own.map(Subject::Own), &progress),
            Fill::Problems(fill) => fill(&options.effort, &progress),
        };
        sections.push(filled.unwrap_or_else(failed));
        done += share;
    }
    progress.clear();

    let report = Report {
        command: command(options.effort.quick, options.sections.iter().map(String::as_str)),
        machine: machine()?,
        date: date(UNIX_EPOCH.elapsed().map_or(0, |since| since.as_secs() / 86_400)),
        quick: options.effort.quick,
        sections: with_names(sections),
    };
    files(&report, &options.out)?;
    Ok(report)
}

/// Year, month and day of a count of days since 1970, by years that begin in March.
fn date(days: u64) -> String {
    // days since 1 March of the year 0, of which 400 years have 146,097
    let days = days + 719_468;
    let of_era = days % 146_097;
    let year = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year + year / 4 - year / 100);
    let month = (5 * of_year + 2) / 153;
    let day = of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = 400 * (days / 146_097) + year + u64::from(month <= 2);
    format!("{year}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_synonym_belongs_to_a_section_and_is_none_itself() {
        for (word, of) in SYNONYMS {
            assert!(names().any(|name| name == of) && names().all(|name| name != word), "{word}");
        }
        assert_eq!(synonyms("extremes").collect::<Vec<_>>(), ["stress"]);
        assert_eq!(synonyms("accuracy").count(), 0);
    }

    #[test]
    fn days_have_dates() {
        assert_eq!(
            [0, 59, 11_016, 20_513].map(date),
            ["1970-01-01", "1970-03-01", "2000-02-29", "2026-03-01"]
        );
    }
}
