//! Tables as text and as markdown.

use clap::ValueEnum;

/// How tables are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Columns under each other.
    Text,
    /// For a README.
    Markdown,
    /// The numbers for scripts.
    Json,
}

/// A table; the first columns are text, the others numbers.
#[derive(Clone, Debug)]
pub struct Table {
    /// Its title.
    pub title: String,
    /// Names of the columns.
    pub columns: Vec<&'static str>,
    /// How many of the columns are text.
    pub n_text: usize,
    /// The cells, as many in each row as there are columns.
    pub rows: Vec<Vec<String>>,
    /// Notes for the reader, one line each.
    pub notes: Vec<String>,
}

impl Table {
    /// Columns under each other, for terminals.
    pub fn text(&self) -> String {
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|k| {
                self.rows
                    .iter()
                    .map(|row| row[k].chars().count())
                    .fold(self.columns[k].chars().count(), usize::max)
            })
            .collect();
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            let mut line = String::new();
            for (k, cell) in cells.enumerate() {
                let gap = " ".repeat(widths[k] - cell.chars().count());
                line += &if k < self.n_text {
                    format!("{cell}{gap}  ")
                } else {
                    format!("{gap}{cell}  ")
                };
            }
            line.trim_end().to_owned() + "\n"
        };
        let mut text = format!("{}\n\n", self.title) + &line(&mut self.columns.iter().copied());
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        self.notes.iter().fold(text + "\n", |text, note| text + note + "\n") + "\n"
    }

    /// The table for a README.
    pub fn markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            cells.fold("|".to_owned(), |line, cell| line + " " + cell + " |") + "\n"
        };
        let mut text = format!("### {}\n\n", self.title) + &line(&mut self.columns.iter().copied());
        text += &line(
            &mut (0..self.columns.len()).map(|k| if k < self.n_text { "---" } else { "--:" }),
        );
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        self.notes.iter().fold(text + "\n", |text, note| text + note + "\n") + "\n"
    }
}

/// Whole nanoseconds: a table reads best with one unit.
pub fn ns(x: f64) -> String {
    format!("{x:.0}")
}

/// An error, two digits.
pub fn error(x: f64) -> String {
    if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") }
}
