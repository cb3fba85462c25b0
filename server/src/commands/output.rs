//! Results on stdout.

use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use clap::{Args, ValueEnum};

/// How results are printed.
#[derive(Args)]
pub(crate) struct FormatFlag {
    /// How results are printed.
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    pub(crate) format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people.
    Text,
    /// For scripts.
    Json,
}

/// Prints the results of a command that ends with `code`.
pub(crate) fn finish(command: &str, results: &str, code: u8) -> ExitCode {
    let mut out = io::stdout().lock();
    match out.write_all(results.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            eprintln!("sarrus {command}: the results cannot be written: {error}");
            ExitCode::from(2)
        }
        // who reads only the first lines has what they wanted
        _ => ExitCode::from(code),
    }
}

/// A value that serialises, as one line.
pub(crate) fn json_line<T: serde::Serialize>(value: &T) -> String {
    // text, numbers and lists: there is nothing in it that cannot be written
    serde_json::to_string(value).unwrap_or_default() + "\n"
}

/// Rows under heads, columns aligned: numbers to the right, words to the left.
pub(crate) fn table(heads: &[&str], rows: &[Vec<String>]) -> String {
    let is_number = |cell: &String| cell.starts_with(|first: char| first.is_ascii_digit());
    let mut lines = vec![String::new(); rows.len() + 1];
    for (k, head) in heads.iter().enumerate() {
        let column = || rows.iter().filter_map(|row| row.get(k));
        let width = column()
            .map(|cell| cell.chars().count())
            .chain([head.chars().count()])
            .max()
            .unwrap_or(0);
        let right = column().all(is_number);
        for (line, cell) in
            lines.iter_mut().zip([*head].into_iter().chain(column().map(String::as_str)))
        {
            let gap = if line.is_empty() { "" } else { "  " };
            *line += &if right {
                format!("{gap}{cell:>width$}")
            } else {
                format!("{gap}{cell:<width$}")
            };
        }
    }
    lines.iter().map(|line| line.trim_end().to_owned() + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_align_words_left_and_numbers_right() {
        let rows =
            [vec!["ä".to_owned(), "7".to_owned()], vec!["long".to_owned(), "123".to_owned()]];
        assert_eq!(table(&["name", "n"], &rows), "name    n\nä       7\nlong  123\n");
        assert_eq!(
            table(&["name", "about"], &[vec![String::new(), "x".to_owned()]]),
            "name  about\n      x\n"
        );
    }
}
