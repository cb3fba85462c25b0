//! Tables as text and as markdown.

/// A table; the first columns are text, the others numbers.
pub(crate) struct Table {
    pub(crate) title: String,
    /// Names of the columns and how many of them are text.
    pub(crate) columns: Vec<&'static str>,
    pub(crate) n_text: usize,
    pub(crate) rows: Vec<Vec<String>>,
    /// What a reader has to know, one line each.
    pub(crate) notes: Vec<String>,
}

impl Table {
    /// Columns under each other, for terminals.
    pub(crate) fn text(&self) -> String {
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|k| self.rows.iter().map(|row| row[k].chars().count()).fold(self.columns[k].chars().count(), usize::max))
            .collect();
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            let mut line = String::new();
            for (k, cell) in cells.enumerate() {
                let gap = " ".repeat(widths[k] - cell.chars().count());
                line += &if k < self.n_text { format!("{cell}{gap}  ") } else { format!("{gap}{cell}  ") };
            }
            line.trim_end().to_owned() + "\n"
        };
        let mut text = format!("{}\n\n", self.title) + &line(&mut self.columns.iter().copied());
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        self.notes.iter().fold(text + "\n", |text, note| text + note + "\n") + "\n"
    }

    /// The same for a README.
    pub(crate) fn markdown(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = &str>| cells.fold("|".to_owned(), |line, cell| line + " " + cell + " |") + "\n";
        let mut text = format!("### {}\n\n", self.title) + &line(&mut self.columns.iter().copied());
        text += &line(&mut (0..self.columns.len()).map(|k| if k < self.n_text { "---" } else { "--:" }));
        for row in &self.rows {
            text += &line(&mut row.iter().map(String::as_str));
        }
        self.notes.iter().fold(text + "\n", |text, note| text + note + "\n") + "\n"
    }
}

/// Whole nanoseconds: a table reads best with one unit.
pub(crate) fn ns(x: f64) -> String {
    format!("{x:.0}")
}

/// An error, two digits.
pub(crate) fn error(x: f64) -> String {
    if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") }
}
