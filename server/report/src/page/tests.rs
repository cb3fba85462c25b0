//! The page and its data from a small report.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails panics")]

use std::collections::HashSet;

use serde_json::Value;

use super::data::json;
use super::html::page;
use super::picture::looks;
use super::*;

const SCRIPT: &str = include_str!("page.js");

/// Two sections with all kinds of content, and names that would break the page unescaped.
fn report() -> Report {
    let point = |x: f64, y: f64| Point { x, y, label: "tolerance <1e-3> & \"more\"".into() };
    let series = |name: &str, line: bool, points: &[(f64, f64)]| Series {
        name: name.into(),
        line,
        competes: !line,
        points: points.iter().map(|&(x, y)| point(x, y)).collect(),
    };
    let log = |label: &str| Axis { label: label.into(), log: true, ..Axis::default() };
    let figure = |id: &str, series: Vec<Series>| Figure {
        id: id.into(),
        title: "lambda <script>alert(1)</script>".into(),
        caption: "a & b".into(),
        x: log("time, ns"),
        y: log("error"),
        series,
    };
    let case = |assessment: Assessment, value: f64| Case {
        family: "mass ratio",
        robot: "lambda".into(),
        parameter: "ratio",
        value,
        asked: "ID".into(),
        method: "analytic".into(),
        error: Some(1e-12),
        backward: None,
        nanoseconds: None,
        reference: "double-double",
        status: "ok".into(),
        warnings: vec![],
        reported: String::new(),
        assessment,
    };
    let accuracy = Section {
        summary: vec!["5 < 6".into()],
        worst_error: Some(1e-12),
        figures: vec![
            figure(
                "a",
                vec![
                    series("analytic", false, &[(100.0, 1e-15), (50.0, 0.0)]),
                    series("Pinocchio FD", false, &[(900.0, 1e-8)]),
                ],
            ),
            figure(
                "b",
                vec![series("drift", true, &[(1.0, 1e-3), (2.0, 1e-2), (3.0, f64::INFINITY)])],
            ),
            figure("c", vec![series("nothing", false, &[])]),
        ],
        tables: vec![Table {
            id: "t".into(),
            title: "t".into(),
            columns: vec!["a".into()],
            rows: vec![vec!["<1>".into()]],
            ..Table::default()
        }],
        ..Section::new("accuracy", "Error")
    };
    let extremes = Section {
        cases: vec![case(Assessment::Held, 1.0), case(Assessment::FailedSilently, 1e9)],
        ..Section::new("extremes", "Extremes")
    };
    Report {
        command: "sarrus report".into(),
        machine: "m".into(),
        date: "2026-01-01".into(),
        quick: false,
        sections: vec![accuracy, extremes],
    }
}

/// The page with the elements that HTML leaves open closed and without its script: the rest of it
/// is XML.
fn as_xml(page: &str) -> String {
    let page = page.strip_prefix("<!DOCTYPE html>").unwrap();
    let page = page.replacen(&format!("<script>{SCRIPT}</script>"), "", 1);
    assert_eq!(page.matches("<script").count(), 0);
    let mut parts = page.split("<meta ");
    let mut text = parts.next().unwrap().to_owned();
    for part in parts {
        text += &format!("<meta {}", part.replacen('>', "/>", 1));
    }
    text
}

#[test]
fn the_policy_lets_a_browser_run_the_script_of_the_page_alone() {
    let code = "import base64, hashlib, sys; print(base64.b64encode(hashlib.sha256(\
        sys.argv[1].encode()).digest()).decode())";
    let python = std::process::Command::new("python3").args(["-c", code, SCRIPT]).output().unwrap();
    let hash = String::from_utf8(python.stdout).unwrap();
    let text = page(&report()).unwrap();
    let policy = format!("script-src 'sha256-{}'", hash.trim());
    assert!(text.contains(&policy.replace('\'', "&#39;")) || text.contains(&policy), "{policy}");
    // marks in the order of the legend, with their numbers
    assert!(
        text.contains("data-marks=\"0 1.000e2 1.000e-15;0 5.000e1 0.000e0;1 9.000e2 1.000e-8\"")
    );
}

#[test]
fn the_page_is_well_formed_and_loads_nothing() {
    let text = page(&report()).unwrap();
    let text = as_xml(&text);
    let read = roxmltree::Document::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    for node in read.descendants().filter(roxmltree::Node::is_element) {
        assert!(
            !["img", "link", "iframe", "object"].contains(&node.tag_name().name()),
            "{}",
            node.tag_name().name()
        );
        for attribute in node.attributes() {
            let link = ["href", "src"].contains(&attribute.name());
            assert!(!link || !attribute.value().contains("//"), "{}", attribute.value());
            assert!(!attribute.name().starts_with("on"), "{}", attribute.name());
        }
    }
    assert!(!text.contains("url(") && !text.contains("@import"));
    let ids: Vec<&str> = read.descendants().filter_map(|node| node.attribute("id")).collect();
    assert_eq!(ids.len(), ids.iter().collect::<HashSet<_>>().len(), "{ids:?}");
    let inside = read.descendants().filter_map(|node| node.attribute("href")?.strip_prefix('#'));
    for target in inside {
        assert!(ids.contains(&target), "a link to nothing: {target}");
    }
}

#[test]
fn every_figure_shows_its_points_or_says_that_there_are_none() {
    let text = as_xml(&page(&report()).unwrap());
    let read = roxmltree::Document::parse(&text).unwrap();
    let figures: Vec<_> = read.descendants().filter(|node| node.has_tag_name("figure")).collect();
    let marks = |figure: &roxmltree::Node<'_, '_>, class: &str| {
        let part = figure.descendants().find(|node| node.attribute("class") == Some(class));
        part.map_or(0, |part| {
            part.descendants().filter(|node| node.tag_name().name() == "polygon").count()
        })
    };
    assert_eq!(figures.iter().map(|figure| marks(figure, "wide")).collect::<Vec<_>>(), [3, 2, 0]);
    assert_eq!(figures.iter().map(|figure| marks(figure, "narrow")).collect::<Vec<_>>(), [3, 2, 0]);
    assert!(figures[2].descendants().any(|node| node.attribute("class") == Some("empty")));
    for figure in &figures {
        let text: String = figure.descendants().filter_map(|node| node.text()).collect();
        assert!(
            text.contains("sarrus report --section accuracy") && text.contains(" on m"),
            "{text}"
        );
        assert!(text.contains("lambda <script>"), "{text}");
    }
}

#[test]
fn the_data_has_what_scripts_look_for() {
    let report = report();
    let value = json(&report);
    assert_eq!(
        (&value["cases"], &value["silent_failures"], &value["worst_error"]),
        (&Value::from(2), &Value::from(1), &Value::from(1e-12))
    );
    assert_eq!(value["results"][1]["verdict"], "failed silently");
    assert_eq!(value["sections"][0]["figures"][0]["series"][1]["points"][0]["y"], 1e-8);
    assert_eq!(value["sections"][0]["figures"][1]["series"][0]["points"][2]["y"], Value::Null);
    for key in ["machine", "command", "date", "quick"] {
        assert!(!value[key].is_null(), "{key}");
    }
    assert_eq!(report.summary()[0], "worst error 1.0e-12, 2 stress cases, 1 silent failures");
    let nothing = Report::default();
    assert_eq!(
        (json(&nothing)["worst_error"].clone(), json(&nothing)["cases"].clone()),
        (Value::Null, Value::from(0))
    );
}

#[test]
fn every_file_that_the_page_names_is_beside_it_and_nothing_is_left_over() {
    let folder = std::env::temp_dir().join(format!("sarrus-report-files-{}", std::process::id()));
    files::files(&report(), &folder).unwrap();
    let read = |name: &str| {
        std::fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    let text = as_xml(&read("report.html"));
    let page = roxmltree::Document::parse(&text).unwrap();
    let mut named: Vec<&str> = page
        .descendants()
        .filter_map(|node| node.attribute("href"))
        .filter(|href| !href.starts_with('#'))
        .collect();
    named.extend(["report.html", "report.json"]);
    let mut there: Vec<String> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    named.sort_unstable();
    there.sort_unstable();
    assert_eq!(named, there);
    assert_eq!(read("a.csv").lines().count(), 1 + 3, "a head and three points");
    assert_eq!(read("extremes-cases.csv").lines().count(), 1 + 2);
    let value: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!(value["sections"].as_array().unwrap().len(), 2);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_library_has_one_colour_on_every_figure_and_each_series_a_look_of_its_own() {
    let looks_of = |names: &[&str]| {
        let named = |name: &&str| Series { name: (*name).into(), ..Series::default() };
        looks(&Figure { series: names.iter().map(named).collect(), ..Figure::default() })
    };
    let one = looks_of(&["a", "b", "Pinocchio RNEA", "Pinocchio lcaba", "c", "d", "Drake"]);
    let other = looks_of(&["a", "Drake", "Pinocchio RNEA"]);
    assert_eq!(one, [0, 1, 3, 11, 2, 8, 6]);
    assert_eq!(other, [0, 6, 3]);
    // without libraries all colours are ours
    assert_eq!(looks_of(&["a"; 9]), [0, 1, 2, 3, 4, 5, 6, 7, 8]);
}
