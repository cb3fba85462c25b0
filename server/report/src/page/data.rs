//! The report's data as JSON and as CSV.

use serde_json::{Value, json};

use super::figure::{Figure, Point};
use super::section::{Assessment, Case, Report, Section, Table, columns};
use crate::Outcome;
use crate::csv_rows::write;

/// The whole report, for scripts. A number that is not finite is null.
pub(super) fn json(report: &Report) -> Value {
    let section = |section: &Section| {
        let mut value = json!(section);
        let figures = value.get_mut("figures").and_then(Value::as_array_mut);
        for figure in figures.into_iter().flatten().filter_map(Value::as_object_mut) {
            figure.insert("command".to_owned(), report.command_of(section).into());
        }
        value
    };
    let sections: Vec<Value> = report.sections.iter().map(section).collect();
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
    let mut cases: Vec<&Case> = section.cases.iter().collect();
    cases.sort_by_key(|case| Assessment::ALL.iter().rev().position(|of| *of == case.assessment));
    Table {
        id: format!("{}-cases", section.name),
        columns: columns(
            "family | robot | parameter | value | method | error | status | told | verdict",
        ),
        rows: cases.into_iter().map(row).collect(),
        ..Table::default()
    }
}

/// The shortest exact form if that is short, else four digits: JSON has all digits.
fn number(x: f64) -> String {
    let whole = format!("{x}");
    if whole.len() <= 8 { whole } else { format!("{x:.4e}") }
}

/// A table as CSV.
pub(super) fn csv(table: &Table) -> Outcome<String> {
    write(std::iter::once(&table.columns).chain(&table.rows))
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
        assert_eq!(csv(&table).unwrap(), "a,\"b,c\"\n\"say \"\"x\"\"\",1\n");
    }

    #[test]
    fn numbers_are_short_and_keep_what_matters() {
        assert_eq!(
            [0.5, 1e-15, 123.456789012, f64::NAN].map(number),
            ["0.5", "1.0000e-15", "1.2346e2", "NaN"]
        );
    }
}
