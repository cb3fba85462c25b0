//! The files of a report: plain, unique names, each file written atomically.

use std::fs;
use std::path::Path;

use super::data::{csv, figure_table, json, result_table};
use super::html::page;
use super::section::{Report, Section};
use crate::Outcome;

/// Gives every figure and table a unique name that is valid for a file.
pub(crate) fn with_names(mut sections: Vec<Section>) -> Vec<Section> {
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

/// Data first, so that the files that the page names exist when the page appears.
pub(crate) fn files(report: &Report, out: &Path) -> Outcome {
    for section in &report.sections {
        for figure in &section.figures {
            write(out, &format!("{}.csv", figure.id), &csv(&figure_table(figure))?)?;
        }
        for table in &section.tables {
            write(out, &format!("{}.csv", table.id), &csv(table)?)?;
        }
        if !section.cases.is_empty() {
            let table = result_table(section);
            write(out, &format!("{}.csv", table.id), &csv(&table)?)?;
        }
    }
    write(out, "report.json", &format!("{:#}\n", json(report)))?;
    write(out, "report.html", &page(report)?)
}

/// Writes a file under another name first, so that a reader never sees half of it.
pub(crate) fn write(folder: &Path, name: &str, text: &str) -> Outcome {
    let path = folder.join(name);
    let half = folder.join(format!(".{name}.{}", std::process::id()));
    let written = fs::create_dir_all(folder)
        .and_then(|()| fs::write(&half, text))
        .and_then(|()| fs::rename(&half, &path));
    written.map_err(|error| {
        // removes a partial file
        let _ = fs::remove_file(&half);
        format!("{}: cannot be written: {error}", path.display()).into()
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use super::super::{Figure, Table};
    use super::*;

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
        // a file in place of the folder
        let error = write(&folder.join("a.csv"), "b.csv", "x").unwrap_err().to_string();
        assert!(error.contains("a.csv") && error.contains("cannot be written"), "{error}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
