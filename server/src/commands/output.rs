//! Results on stdout, reasons for their absence on stderr.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Args, ValueEnum};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use sarrus_client::LoadError;
use serde::Serialize;

use super::robot::diagnostics;

/// How results are printed.
#[derive(Args)]
pub(crate) struct FormatFlag {
    /// How results are printed.
    #[arg(long, value_enum, value_name = "FORMAT", default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For people.
    Text,
    /// For scripts.
    Json,
}

impl FormatFlag {
    /// A value as one line of JSON, or as text.
    pub(crate) fn render<T: Serialize>(
        &self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> String {
        match self.format {
            // text, numbers and lists always serialise
            Format::Json => serde_json::to_string(value).unwrap_or_default() + "\n",
            Format::Text => text(value),
        }
    }
}

/// The results of a command, or the reason why there are none.
pub(crate) type Outcome = Result<Results, Failure>;

/// The text for stdout and the exit code.
pub(crate) struct Results {
    pub(crate) text: String,
    pub(crate) code: u8,
}

/// The text for stderr and the exit code.
pub(crate) struct Failure {
    pub(crate) reason: String,
    /// The reason is `check`'s report: lines of their own without the command's name.
    pub(crate) is_report: bool,
    pub(crate) code: u8,
}

impl Failure {
    /// Wrong flags, or a command that cannot start.
    pub(crate) fn start(reason: impl ToString) -> Failure {
        Failure { reason: reason.to_string(), is_report: false, code: 2 }
    }

    /// A finding that leaves no results.
    pub(crate) fn finding(reason: impl ToString) -> Failure {
        Failure { code: 1, ..Failure::start(reason) }
    }

    /// The reason in lines.
    pub(crate) fn text(&self, command: &str) -> String {
        match self.is_report {
            true => self.reason.clone(),
            false => format!("sarrus {command}: {}\n", self.reason),
        }
    }
}

impl From<LoadError> for Failure {
    fn from(error: LoadError) -> Failure {
        match error {
            LoadError::Faults(report) => Failure {
                reason: diagnostics(&report.errors, &report.warnings),
                is_report: true,
                code: 1,
            },
            other => Failure::start(other),
        }
    }
}

/// A robot's name as that of a file, which leads to no other folder.
pub(crate) fn file_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    name.chars().map(plain).collect()
}

/// Prints the outcome of a command; the exit code.
pub(crate) fn conclude(command: &str, outcome: Outcome) -> ExitCode {
    match outcome.and_then(print_results) {
        Ok(code) => ExitCode::from(code),
        Err(failure) => {
            // a closed stderr changes no exit code
            let _ = io::stderr().lock().write_all(failure.text(command).as_bytes());
            ExitCode::from(failure.code)
        }
    }
}

fn print_results(results: Results) -> Result<u8, Failure> {
    if results.text.is_empty() {
        return Ok(results.code);
    }
    match print(results.text.as_bytes()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::start(format!("the results cannot be written: {error}")))
        }
        // a reader may close the pipe after the first lines
        _ => Ok(results.code),
    }
}

/// Writes all bytes to stdout, also where stdout is opened not to block. The standard library
/// reports success for a stdout that cannot be written.
pub(crate) fn print(mut bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    // text that is still buffered goes first
    out.flush()?;
    while !bytes.is_empty() {
        match rustix::io::write(&out, bytes) {
            Ok(0) => return Err(ErrorKind::WriteZero.into()),
            Ok(n) => bytes = bytes.get(n..).unwrap_or_default(),
            Err(Errno::INTR) => {}
            Err(Errno::AGAIN) => wait_for(&out, PollFlags::OUT)?,
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// A flag that these signals set from now on.
pub(crate) fn stop_at(signals: &[i32]) -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in signals {
        let caught = signal_hook::flag::register(*signal, stop.clone());
        let failed = |error| Failure::start(format!("signal {signal} cannot be caught: {error}"));
        caught.map_err(failed)?;
    }
    Ok(stop)
}

/// Waits until a stream can be read or written, or has ended.
pub(crate) fn wait_for(stream: &impl AsFd, event: PollFlags) -> io::Result<()> {
    match poll(&mut [PollFd::new(stream, event)], None) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Writes a file, but never over one that the command reads.
#[cfg(any(feature = "show", feature = "simulate", feature = "identify"))]
pub(crate) fn write(path: &Path, text: impl AsRef<[u8]>) -> Result<(), Failure> {
    let whole = path.canonicalize().ok();
    // its own flag names it, as FILE or as --out=FILE; any other word is an input
    let is_it = |word: &std::ffi::OsString| {
        let word = word.to_string_lossy();
        let name = word.strip_prefix("--").and_then(|flag| flag.split_once('='));
        whole.is_some() && Path::new(name.map_or(&*word, |of| of.1)).canonicalize().ok() == whole
    };
    if std::env::args_os().skip(1).filter(is_it).count() > 1 {
        let words = "is read by this command too: write another file";
        return Err(Failure::start(format!("{} {words}", path.display())));
    }
    let failed = |error| Failure::start(format!("{} cannot be written: {error}", path.display()));
    fs::write(path, text).map_err(failed)
}

/// Writes files into a folder, all or none, and never over an existing file; the results are their
/// names.
pub(crate) fn write_new(folder: &Path, files: &[(PathBuf, Vec<u8>)]) -> Outcome {
    let failed = |path: &Path, error| {
        Failure::start(format!("{} cannot be written: {error}", path.display()))
    };
    fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    let mut made = Vec::new();
    for (path, text) in files {
        let written = File::create_new(path).and_then(|mut file| {
            made.push(path);
            file.write_all(text)
        });
        if let Err(error) = written {
            for path in made {
                let _ = fs::remove_file(path);
            }
            return Err(failed(path, error));
        }
    }
    let lines = files.iter().map(|(path, _)| format!("{}\n", path.display()));
    Ok(Results { text: lines.collect(), code: 0 })
}

/// One line with a label in a column of its own.
pub(crate) fn labelled(label: &str, text: impl std::fmt::Display) -> String {
    format!("{label:<12} {text}\n")
}

/// Rows under heads, which bars separate, columns aligned: numbers to the right, words to the left.
pub(crate) fn table(heads: &str, rows: &[Vec<String>]) -> String {
    let is_number = |cell: &String| cell.starts_with(|first: char| first.is_ascii_digit());
    let mut lines = vec![String::new(); rows.len() + 1];
    for (k, head) in heads.split(" | ").enumerate() {
        let column = || rows.iter().filter_map(|row| row.get(k));
        let cells = || [head].into_iter().chain(column().map(String::as_str));
        let width = cells().map(|cell| cell.chars().count()).max().unwrap_or(0);
        let right = column().all(is_number);
        for (line, cell) in lines.iter_mut().zip(cells()) {
            let gap = if line.is_empty() { "" } else { "  " };
            *line += &match right {
                true => format!("{gap}{cell:>width$}"),
                false => format!("{gap}{cell:<width$}"),
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
        assert_eq!(table("name | n", &rows), "name    n\nä       7\nlong  123\n");
        let row = vec![String::new(), "x".to_owned()];
        assert_eq!(table("name | about", &[row]), "name  about\n      x\n");
    }
}
