//! Results on stdout.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;

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

/// Writes bytes to stdout, all of them. Where it does not wait, this does; the standard library
/// takes one that cannot be written for one that nobody reads.
pub(crate) fn print(mut bytes: &[u8]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    // what others left there goes first
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

/// Waits until a stream can be read or written, or has ended.
pub(crate) fn wait_for(stream: &impl AsFd, what: PollFlags) -> io::Result<()> {
    match poll(&mut [PollFd::new(stream, what)], None) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Writes files into a folder and prints their names: all of them or none, and no file that is
/// there is written over. 2 where that cannot be.
pub(crate) fn write_new(command: &str, folder: &Path, files: &[(PathBuf, Vec<u8>)]) -> ExitCode {
    match try_write_new(folder, files) {
        Ok(()) => {
            let lines = files.iter().map(|(path, _)| format!("{}\n", path.display()));
            finish(command, &lines.collect::<String>(), 0)
        }
        Err((path, error)) => {
            eprintln!("sarrus {command}: {} cannot be written: {error}", path.display());
            ExitCode::from(2)
        }
    }
}

fn try_write_new(folder: &Path, files: &[(PathBuf, Vec<u8>)]) -> Result<(), (PathBuf, io::Error)> {
    fs::create_dir_all(folder).map_err(|error| (folder.to_owned(), error))?;
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
            return Err((path.clone(), error));
        }
    }
    Ok(())
}

/// Prints the results of a command that ends with `code`.
pub(crate) fn finish(command: &str, results: &str, code: u8) -> ExitCode {
    match print(results.as_bytes()) {
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
