//! Runs sections and writes their files.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use super::data::{csv, figure_table, json, result_table};
use super::page::page;
use super::{Effort, Report, SECTIONS, Section};
use crate::Outcome;
use crate::cores::Cores;
use crate::printed::machine;
use crate::progress::Progress;

/// A file that shows that the folder can be written.
const PROBE: &str = ".writable";

/// What to report and where it goes.
#[derive(Clone, Debug)]
pub struct Options {
    /// How much is measured.
    pub effort: Effort,
    /// Names of sections; all of them where there is none.
    pub sections: Vec<String>,
    /// The folder.
    pub out: PathBuf,
}

/// Runs the wanted sections in their order and writes the page and its data. A section that fails
/// says so on the page.
///
/// # Errors
///
/// A folder that cannot be written.
pub fn run(options: &Options) -> Outcome<Report> {
    // nobody wants to hear of a folder that cannot be written after an hour; an earlier report
    // stays until then
    write(&options.out, PROBE, "")?;
    fs::remove_file(options.out.join(PROBE))
        .map_err(|error| format!("{}: {error}", options.out.display()))?;

    let progress = Progress::with_lines();
    let query = |name: &str| {
        options.sections.is_empty() || options.sections.iter().any(|section| section == name)
    };
    let chosen: Vec<_> = SECTIONS.iter().filter(|(name, ..)| query(name)).collect();
    let whole: f64 = chosen.iter().map(|(_, _, share)| share).sum();
    let (mut sections, mut done) = (Vec::new(), 0.0);
    for (name, fill, share) in chosen {
        progress.part(done / whole, (done + share) / whole);
        let failed = |error: Box<dyn std::error::Error>| Section {
            failure: Some(error.to_string()),
            ..Section::new(name, name)
        };
        sections.push(fill(&options.effort, &progress).unwrap_or_else(failed));
        done += share;
    }
    progress.clear();

    let report = Report {
        command: command(options.effort, options.sections.iter().map(String::as_str)),
        machine: machine(&Cores::choose()?),
        date: date(
            SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |since| since.as_secs() / 86_400),
        ),
        quick: options.effort.quick,
        sections: with_names(sections),
    };
    files(&report, &options.out)?;
    Ok(report)
}

/// The command that measures these sections again.
pub(super) fn command<'a>(effort: Effort, sections: impl Iterator<Item = &'a str>) -> String {
    let quick = if effort.quick { " --quick" } else { "" };
    sections.fold(format!("sarrus report{quick}"), |command, name| command + " --section " + name)
}

/// Gives every figure and table a name that is one of a file, and that no other has.
fn with_names(mut sections: Vec<Section>) -> Vec<Section> {
    let mut taken: Vec<String> = sections
        .iter()
        .map(|section| section.name.to_owned())
        .chain(["places".to_owned()])
        .collect();
    let mut free = |id: &mut String| {
        let plain = |letter: char| {
            if letter.is_ascii_alphanumeric() || "-_".contains(letter) {
                letter.to_ascii_lowercase()
            } else {
                '-'
            }
        };
        let name: String = id.chars().map(plain).collect();
        let numbered = (1..).map(|k| if k == 1 { name.clone() } else { format!("{name}-{k}") });
        *id = numbered
            .into_iter()
            .find(|name| !name.is_empty() && !taken.contains(name))
            .unwrap_or_default();
        taken.push(id.clone());
    };
    for section in &mut sections {
        section.figures.iter_mut().for_each(|figure| free(&mut figure.id));
        section.tables.iter_mut().for_each(|table| free(&mut table.id));
    }
    sections
}

/// The data first: who sees the page finds what it names.
pub(super) fn files(report: &Report, out: &Path) -> Outcome {
    for section in &report.sections {
        for figure in &section.figures {
            write(out, &format!("{}.csv", figure.id), &csv(&figure_table(figure)))?;
        }
        for table in &section.tables {
            write(out, &format!("{}.csv", table.id), &csv(table))?;
        }
        if !section.cases.is_empty() {
            let table = result_table(section);
            write(out, &format!("{}.csv", table.id), &csv(&table))?;
        }
    }
    write(out, "report.json", &format!("{:#}\n", json(report)))?;
    write(out, "report.html", &page(report)?)
}

/// Writes a file under another name first, so that nobody reads half of it.
fn write(folder: &Path, name: &str, text: &str) -> Outcome {
    let (path, half) = (folder.join(name), folder.join(format!(".{name}.{}", std::process::id())));
    let written = fs::create_dir_all(folder)
        .and_then(|()| fs::write(&half, text))
        .and_then(|()| fs::rename(&half, &path));
    written.map_err(|error| {
        // what is left of it, if it got that far
        let _ = fs::remove_file(&half);
        format!("{}: cannot be written: {error}", path.display()).into()
    })
}

/// Year, month and day of a count of days since 1970.
fn date(days: u64) -> String {
    let leap = |year: u64| {
        year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400))
    };
    let (mut year, mut left) = (1970, days);
    while left >= 365 + u64::from(leap(year)) {
        left -= 365 + u64::from(leap(year));
        year += 1;
    }
    let mut month = 0;
    let months = [31, 28 + u64::from(leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    while left >= months[month] {
        left -= months[month];
        month += 1;
    }
    format!("{year}-{:02}-{:02}", month + 1, left + 1)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use super::super::{Figure, Table};
    use super::*;

    #[test]
    fn days_have_dates() {
        assert_eq!(
            [0, 59, 11_016, 20_513].map(date),
            ["1970-01-01", "1970-03-01", "2000-02-29", "2026-03-01"]
        );
    }

    #[test]
    fn names_of_files_are_plain_and_each_is_taken_once() {
        let mut section = Section::new("accuracy", "");
        section.figures = ["A b/../c", "a-b----c", "accuracy"]
            .map(|id| Figure { id: id.into(), ..Figure::default() })
            .into();
        section.tables = vec![Table { id: "places".into(), ..Table::default() }];
        let named = with_names(vec![section]);
        let ids: Vec<&str> = named[0].figures.iter().map(|figure| figure.id.as_str()).collect();
        assert_eq!(ids, ["a-b----c", "a-b----c-2", "accuracy-2"]);
        assert_eq!(named[0].tables[0].id, "places-2");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_told_with_its_name() {
        let folder = std::env::temp_dir().join(format!("sarrus-report-{}", std::process::id()));
        write(&folder, "a.csv", "x").unwrap();
        assert_eq!(fs::read_to_string(folder.join("a.csv")).unwrap(), "x");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "nothing else is left");
        // a file where the folder should be
        let error = write(&folder.join("a.csv"), "b.csv", "x").unwrap_err().to_string();
        assert!(error.contains("a.csv") && error.contains("cannot be written"), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
