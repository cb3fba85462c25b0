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

#[test]
fn a_report_of_one_robot_has_the_sections_on_robots() {
    let folder = Folder::new("report-own");
    let out = folder.0.join("report").display().to_string();
    let own = run(
        &[
            "report",
            "--quick",
            "--robot",
            "lambda",
            "--section",
            "accuracy",
            "--section",
            "integration",
            "--out",
            &out,
        ],
        b"",
    );
    assert_eq!(own.code, Some(0), "{own:?}");
    let data = fs::read_to_string(format!("{out}/report.json")).unwrap();
    let data: serde_json::Value = serde_json::from_str(&data).unwrap();
    let sections = data["sections"].as_array().unwrap();
    assert!(sections.len() == 1 && sections[0]["name"] == "accuracy", "{data}");
    let figures = sections[0]["figures"].as_array().unwrap();
    assert!(figures.len() == 6 && data.to_string().contains("accuracy-lambda-ik"), "{data}");
}

#[test]
fn an_engine_that_is_not_built_is_not_run_and_an_unknown_one_is_an_error() {
    let unknown = run(&["compare", "--robot", "lambda", "--with", "ode"], b"");
    assert!(unknown.code == Some(2) && unknown.err.contains("mujoco"), "{unknown:?}");
    for engine in ["pinocchio", "mujoco", "simbody", "drake", "rbdl"] {
        let found =
            run(&["compare", "--robot", "lambda", "--with", engine, "--format", "json"], b"");
        assert_eq!(found.code, Some(0), "{found:?}");
        let data: serde_json::Value = serde_json::from_str(&found.out).unwrap();
        let is_run = data["is_run"].as_bool().unwrap();
        assert_eq!(is_run, !data["rows"].as_array().unwrap().is_empty(), "{data}");
        assert!(is_run || data["peer"].as_str().unwrap().contains("not run"), "{data}");
    }
}
