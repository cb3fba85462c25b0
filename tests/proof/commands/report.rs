//! `sarrus report`: the contract for scripts, without long measurements.

use std::fs;

use super::{Folder, run};

#[test]
fn an_unknown_section_is_told_with_the_known_ones() {
    let run = run(&["report", "--section", "speed"], b"");
    assert_eq!(run.code, Some(2), "{run:?}");
    for name in ["speed", "accuracy", "integration", "extremes"] {
        assert!(run.err.contains(name), "{run:?}");
    }
}

#[test]
fn a_folder_that_cannot_be_written_is_told_with_its_name() {
    let folder = Folder::new("report-unwritable");
    let file = folder.file("file", "");
    let out = format!("{file}/report");
    let run = run(&["report", "--out", &out], b"");
    assert_eq!(run.code, Some(2), "{run:?}");
    assert!(run.err.contains(&out) && run.err.contains("cannot be written"), "{run:?}");
    assert_eq!(fs::read_to_string(&file).unwrap(), "");
}

#[test]
fn stress_cases_are_a_section_by_both_of_their_names() {
    let folder = Folder::new("report-names");
    let out = format!("{}/report", folder.file("file", ""));
    for name in ["stress", "extremes"] {
        // the name is accepted; the folder is refused before any measurement
        let run = run(&["report", "--section", name, "--out", &out], b"");
        assert!(run.code == Some(2) && run.err.contains("cannot be written"), "{name}: {run:?}");
    }
}
