//! Writes and reads rows of cells as CSV, quoted as in RFC 4180; lines end with a line feed.
//!
//! A cell with a comma, a quote or a line end is quoted, and read back unchanged. A number in its
//! shortest exact form (`{:?}`) keeps its bits.

use csv::{ReaderBuilder, Trim, WriterBuilder};

use crate::Outcome;

/// A row that was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Its first line, from 1.
    pub line: usize,
    /// Its cells, without blanks around them.
    pub cells: Vec<String>,
}

/// Rows of cells as text, each ended by a line feed; rows may differ in length.
///
/// # Errors
///
/// None known: writing text to memory cannot fail.
pub fn write<'a>(rows: impl IntoIterator<Item = &'a Vec<String>>) -> Outcome<String> {
    let mut writer = WriterBuilder::new().flexible(true).from_writer(Vec::new());
    for row in rows {
        writer.write_record(row)?;
    }
    Ok(String::from_utf8(writer.into_inner()?)?)
}

/// The rows of a text, without blank lines; rows may differ in length.
///
/// # Errors
///
/// None known: text that is not a table reads as a table of odd cells.
pub fn read(text: &str) -> Outcome<Vec<Row>> {
    let mut reader = ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        if record.iter().all(str::is_empty) && record.len() == 1 {
            continue;
        }
        // line ends before a record belong to it
        let start = record.position().map_or(0, |position| position.byte() as usize);
        let (before, rest) = text.split_at_checked(start).unwrap_or((text, ""));
        let blank = &rest[..rest.len() - rest.trim_start_matches(['\r', '\n']).len()];
        let ends = |text: &str| text.bytes().filter(|byte| *byte == b'\n').count();
        let line = 1 + ends(before) + ends(blank);
        rows.push(Row { line, cells: record.iter().map(str::to_owned).collect() });
    }
    Ok(rows)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use super::*;

    fn row(cells: &[&str]) -> Vec<String> {
        cells.iter().map(|cell| (*cell).to_owned()).collect()
    }

    #[test]
    fn what_is_written_is_read_again() {
        let rows = [
            row(&["time", "left, \"motor\"", "two\nlines", "plain"]),
            row(&["0", "", "-1", "x"]),
            row(&["1", "2"]),
        ];
        let text = write(&rows).unwrap();
        assert!(text.starts_with("time,\"left, \"\"motor\"\"\",\"two\nlines\",plain"), "{text}");
        assert!(text.ends_with("1,2\n"), "{text:?}");
        for text in [text.clone(), text.replace('\n', "\r\n").replace("two\r\n", "two\n")] {
            let back = read(&text).unwrap();
            assert_eq!(back.iter().map(|row| row.cells.clone()).collect::<Vec<_>>(), rows);
            assert_eq!(back.iter().map(|row| row.line).collect::<Vec<_>>(), [1, 3, 4]);
        }
    }

    #[test]
    fn numbers_are_read_back_bit_for_bit() {
        let numbers = [0.1 + 0.2, -0.0, 5e-324, f64::MAX, 1.0 / 3.0, 1e22, 123_456_789.123_456_78];
        let text = write(&[numbers.iter().map(|x| format!("{x:?}")).collect()]).unwrap();
        let back: Vec<f64> =
            read(&text).unwrap()[0].cells.iter().map(|cell| cell.parse().unwrap()).collect();
        assert_eq!(
            numbers.map(f64::to_bits).to_vec(),
            back.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
        );
    }

    #[test]
    fn rows_know_their_lines_whatever_blank_lines_stand_between() {
        for text in ["a,b\n\n  \n 1 , 2\n\n3\n", "a,b\r\n\r\n  \r\n 1 , 2\r\n\r\n3"] {
            let rows = read(text).unwrap();
            let cells: Vec<Vec<String>> = rows.iter().map(|row| row.cells.clone()).collect();
            assert_eq!(cells, [row(&["a", "b"]), row(&["1", "2"]), row(&["3"])], "{text:?}");
            assert_eq!(rows.iter().map(|row| row.line).collect::<Vec<_>>(), [1, 4, 6], "{text:?}");
        }
        assert!(read("").unwrap().is_empty() && read("\n \n").unwrap().is_empty());
    }
}
