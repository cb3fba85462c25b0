//! How far a run is, on standard error when that is a terminal.

use std::cell::Cell;
use std::io::{IsTerminal, Write, stderr};
use std::time::{Duration, Instant};

/// Redrawn at most this often: drawing is work beside what is measured.
const PAUSE: Duration = Duration::from_millis(200);

pub(crate) struct Progress {
    terminal: bool,
    drawn: Cell<Option<Instant>>,
}

impl Progress {
    pub(crate) fn new() -> Progress {
        Progress { terminal: stderr().is_terminal(), drawn: Cell::new(None) }
    }

    /// Draws how much of `what` is done, 0 to 1.
    pub(crate) fn show(&self, what: &str, done: f64) {
        if !self.terminal || self.drawn.get().is_some_and(|drawn| drawn.elapsed() < PAUSE) {
            return;
        }
        self.drawn.set(Some(Instant::now()));
        let filled = (done.clamp(0.0, 1.0) * 30.0) as usize;
        // a progress bar that cannot be drawn is no fault of the run
        let _ = write!(stderr(), "\r\x1b[K[{:<30}] {what}", "#".repeat(filled)).and_then(|()| stderr().flush());
    }

    /// Removes the bar.
    pub(crate) fn clear(&self) {
        if self.terminal {
            let _ = write!(stderr(), "\r\x1b[K").and_then(|()| stderr().flush());
        }
    }
}
