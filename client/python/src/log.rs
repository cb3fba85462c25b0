//! The log of a bridge's inputs, written by a separate thread while the bridge runs.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

use sarrus_can_core::config::Configuration;
use sarrus_can_core::log::Line;

/// Lines that may wait to be written.
const ROOM: usize = 1 << 15;

/// A log that is being written.
pub(crate) struct Log {
    lines: SyncSender<Line>,
    writer: JoinHandle<io::Result<u64>>,
    lost: u64,
}

impl Log {
    /// Begins a log in a new file.
    pub(crate) fn new(path: &Path, configuration: Configuration) -> io::Result<Log> {
        let file = File::create(path)?;
        let (lines, waiting) = sync_channel(ROOM);
        let writer = std::thread::Builder::new()
            .name("log".to_owned())
            .spawn(move || write(file, &configuration, &waiting))?;
        Ok(Log { lines, writer, lost: 0 })
    }

    /// Adds a line; one that finds no room is lost and counted. Never waits.
    pub(crate) fn put(&mut self, line: Line) {
        self.lost += u64::from(self.lines.try_send(line).is_err());
    }

    /// Waits until everything is written; gives how many lines are, and how many are lost.
    pub(crate) fn end(self) -> io::Result<(u64, u64)> {
        let Log { lines, writer, lost } = self;
        drop(lines);
        let written =
            writer.join().map_err(|_| io::Error::other("the thread that writes broke down"))??;
        Ok((written, lost))
    }
}

fn write(file: File, configuration: &Configuration, lines: &Receiver<Line>) -> io::Result<u64> {
    let mut file = BufWriter::new(file);
    let mut written = 0;
    for line in lines {
        writeln!(file, "{}", line.text(configuration))?;
        written += 1;
    }
    file.flush()?;
    Ok(written)
}
