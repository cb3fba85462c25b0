//! Tables of numbers that commands read.

use std::fs;
use std::path::Path;

use sarrus_report::csv_rows::{self, Row};

use super::output::Failure;

/// Line numbers, numbers and heads of a table.
pub(crate) fn table(path: &Path) -> Result<(Vec<usize>, Vec<Vec<f64>>, Vec<String>), Failure> {
    let file = path.display();
    let text = fs::read_to_string(path)
        .map_err(|error| format!("cannot read {file}: {error}; give the path of a readable file"))
        .map_err(Failure::start)?;
    let rows = csv_rows::read(&text);
    let mut rows = rows.map_err(|error| Failure::start(format!("{file}: {error}")))?.into_iter();
    let heads = rows.next().map(|row| row.cells).unwrap_or_default();
    let mut lines = Vec::new();
    let mut numbers = Vec::new();
    for Row { line, cells } in rows {
        if cells.len() != heads.len() {
            let found = cells.len();
            let words = format!("found {found} cell(s), expected {}", heads.len());
            return Err(Failure::start(format!("{file}:{line}:1: {words}")));
        }
        let number = |(column, cell): (usize, &String)| {
            cell.trim().parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| {
                let words = format!("found `{cell}` in column `{}`", heads[column]);
                let at = format!("{file}:{line}:{}", column + 1);
                Failure::start(format!("{at}: {words}, expected a finite number"))
            })
        };
        numbers.push(cells.iter().enumerate().map(number).collect::<Result<Vec<f64>, Failure>>()?);
        lines.push(line);
    }
    Ok((lines, numbers, heads))
}
