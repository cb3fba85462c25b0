//! The results of a run, as tables and as JSON.

use std::path::Path;

use sarrus_report::Outcome;
use sarrus_report::measure::timing::Samples;
use serde_json::{Value, json};

use crate::table::{Format, Table};

/// Everything that is printed or kept.
#[derive(Clone, Debug)]
pub struct Printed {
    /// The package whose program ran.
    pub package: &'static str,
    /// Where it ran.
    pub machine: String,
    /// For people.
    pub tables: Vec<Table>,
    /// The tables' numbers: an object.
    pub values: Value,
    /// Every sample, in the order of the values.
    pub samples: Vec<Samples>,
}

impl Printed {
    /// Prints on standard output and writes the file with every sample.
    ///
    /// # Errors
    ///
    /// A file that cannot be written.
    pub fn finish(&self, format: Format, path: &Path) -> Outcome {
        self.save(path)?;
        let command = self.command();
        let machine = &self.machine;
        let tables = |text: fn(&Table) -> String| self.tables.iter().map(text).collect::<String>();
        match format {
            Format::Text => print!("{command}\n{machine}\n\n{}", tables(Table::text)),
            Format::Markdown => print!("`{command}` on {machine}\n\n{}", tables(Table::markdown)),
            Format::Json => println!("{:#}", self.summary()),
        }
        eprintln!("raw data: {}", path.display());
        Ok(())
    }

    /// The command line as one may type it again.
    fn command(&self) -> String {
        let flags: Vec<String> = std::env::args().skip(1).collect();
        let flags =
            if flags.is_empty() { String::new() } else { format!(" -- {}", flags.join(" ")) };
        format!("cargo run --release -p {}{flags}", self.package)
    }

    /// The tables' numbers.
    fn summary(&self) -> Value {
        let mut summary = json!({ "command": self.command(), "machine": self.machine });
        for (key, value) in self.values.as_object().into_iter().flatten() {
            summary[key] = value.clone();
        }
        summary
    }

    /// The JSON with every sample.
    fn save(&self, path: &Path) -> Outcome {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|error| format!("{}: {error}", folder.display()))?;
        }
        let mut whole = self.summary();
        whole["samples_tenths_of_ns_and_count"] =
            self.samples.iter().map(|samples| json!(samples.counted())).collect();
        std::fs::write(path, whole.to_string())
            .map_err(|error| format!("{}: {error}", path.display()).into())
    }
}
