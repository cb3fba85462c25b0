//! Tables of numbers that commands read.

use std::fs;
use std::path::Path;

use sarrus_report::csv_rows::{self, Row};

use super::output::Failure;

/// Line numbers, numbers and heads of a table.
pub(super) fn table(path: &Path) -> Result<(Vec<usize>, Vec<Vec<f64>>, Vec<String>), Failure> {
    let file = path.display();
    let text = fs::read_to_string(path)
        .map_err(|error| Failure::start(format!("cannot read {file}: {error}")))?;
    let rows = csv_rows::read(&text);
    let rows = rows.map_err(|error| Failure::start(format!("{file}: {error}")))?;
    let mut rows = rows.into_iter();
    let heads = rows.next().map(|row| row.cells).unwrap_or_default();
    let mut lines = Vec::new();
    let mut numbers = Vec::new();
    for Row { line, cells } in rows {
        if cells.len() != heads.len() {
            let found = cells.len();
            let words = format!("{file}:{line}: found {found} cells, expected {}", heads.len());
            return Err(Failure::start(words));
        }
        let number = |(column, cell): (usize, &String)| {
            cell.trim().parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| {
                let at = format!("{file}:{line}:{}", column + 1);
                Failure::start(format!("{at}: found `{cell}`, expected a finite number"))
            })
        };
        numbers.push(cells.iter().enumerate().map(number).collect::<Result<Vec<f64>, Failure>>()?);
        lines.push(line);
    }
    Ok((lines, numbers, heads))
}
