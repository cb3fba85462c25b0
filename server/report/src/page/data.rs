//! The report's data as JSON and as CSV.

use serde_json::{Value, json};

use super::figure::{Axis, Figure, Point};
use super::section::{Case, Report, Section, Table, columns};
use crate::Outcome;
use crate::csv_rows::{LineEnd, write};

/// The whole report, for scripts. A number that is not finite is null.
pub(super) fn json(report: &Report) -> Value {
    let sections: Vec<Value> =
        report.sections.iter().map(|section| section_value(report, section)).collect();
    let results: Vec<Value> =
        report.sections.iter().flat_map(|section| &section.cases).map(case_value).collect();
    json!({
        "cases": report.cases(),
        "silent_failures": report.silent_failures(),
        "worst_error": report.worst_error(),
        "machine": report.machine,
        "command": report.command,
        "date": report.date,
        "quick": report.quick,
        "sections": sections,
        "results": results,
    })
}

fn section_value(report: &Report, section: &Section) -> Value {
    let figures: Vec<Value> =
        section.figures.iter().map(|figure| figure_value(report, section, figure)).collect();
    json!({
        "name": section.name,
        "title": section.title,
        "summary": section.summary,
        "worst_error": section.worst_error,
        "failure": section.failure,
        "figures": figures,
        "tables": section.tables.iter().map(|table| json!({
            "id": table.id,
            "title": table.title,
            "caption": table.caption,
            "columns": table.columns,
            "rows": table.rows,
        })).collect::<Vec<_>>(),
    })
}

fn figure_value(report: &Report, section: &Section, figure: &Figure) -> Value {
    let point = |point: &Point| json!({ "x": point.x, "y": point.y, "label": point.label });
    let axis = |axis: &Axis| json!({ "label": axis.label, "log": axis.log });
    json!({
        "id": figure.id,
        "title": figure.title,
        "caption": figure.caption,
        "command": report.command_of(section),
        "x": axis(&figure.x), "y": axis(&figure.y),
        "series": figure.series.iter().map(|series| json!({
            "name": series.name, "line": series.line, "front": series.competes,
            "points": series.points.iter().map(point).collect::<Vec<_>>(),
        })).collect::<Vec<_>>(),
    })
}

fn case_value(case: &Case) -> Value {
    json!({
        "family": case.family,
        "robot": case.robot,
        "parameter": case.parameter,
        "value": case.value,
        "method": case.way(),
        "error": case.error,
        "backward_error": case.backward,
        "truth": case.reference,
        "status": case.status,
        "told": case.told(),
        "verdict": case.assessment.name(),
    })
}

/// A figure's points.
pub(super) fn figure_table(figure: &Figure) -> Table {
    let row = |name: &str, point: &Point| {
        vec![name.to_owned(), point.label.clone(), number(point.x), number(point.y)]
    };
    Table {
        id: figure.id.clone(),
        columns: ["series", "point", &figure.x.label, &figure.y.label].map(str::to_owned).into(),
        rows: figure
            .series
            .iter()
            .flat_map(|series| series.points.iter().map(|point| row(&series.name, point)))
            .collect(),
        ..Table::default()
    }
}

/// A section's cases.
pub(super) fn result_table(section: &Section) -> Table {
    let row = |case: &Case| {
        let error = case.error.filter(|error| error.is_finite());
        vec![
            case.family.to_owned(),
            case.robot.clone(),
            case.parameter.to_owned(),
            number(case.value),
            case.way(),
            error.map_or(String::new(), number),
            case.status.clone(),
            case.told(),
            case.assessment.name().to_owned(),
        ]
    };
    Table {
        id: format!("{}-cases", section.name),
        columns: columns(
            "family | robot | parameter | value | method | error | status | told | verdict",
        ),
        rows: section.cases.iter().map(row).collect(),
        ..Table::default()
    }
}

/// The shortest exact form if that is short, else four digits: JSON has all digits.
fn number(x: f64) -> String {
    let whole = format!("{x}");
    if whole.len() <= 8 { whole } else { format!("{x:.4e}") }
}

/// A table as RFC 4180 has it.
pub(super) fn csv(table: &Table) -> Outcome<String> {
    write(std::iter::once(&table.columns).chain(&table.rows), LineEnd::CrLf)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use super::*;

    #[test]
    fn cells_of_csv_with_commas_and_quotes_are_quoted() {
        let words =
            |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
        let table = Table {
            columns: words(&["a", "b,c"]),
            rows: vec![words(&["say \"x\"", "1"])],
            ..Table::default()
        };
        assert_eq!(csv(&table).unwrap(), "a,\"b,c\"\r\n\"say \"\"x\"\"\",1\r\n");
    }

    #[test]
    fn numbers_are_short_and_keep_what_matters() {
        assert_eq!(
            [0.5, 1e-15, 123.456789012, f64::NAN].map(number),
            ["0.5", "1.0000e-15", "1.2346e2", "NaN"]
        );
    }
}
