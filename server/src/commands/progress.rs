//! A progress bar on stderr.

use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

/// Shorter waits show no bar.
const DELAY: Duration = Duration::from_secs(1);
/// Least time between two drawings.
const PAUSE: Duration = Duration::from_millis(50);
const WIDTH: usize = 30;

/// Drawn over itself, erased when dropped; only where stderr is a terminal.
pub(crate) struct Progress {
    terminal: bool,
    start: Instant,
    drawn: Option<Instant>,
}

impl Progress {
    pub(crate) fn new() -> Progress {
        Progress { terminal: io::stderr().is_terminal(), start: Instant::now(), drawn: None }
    }

    /// Shows the current step and the part of the whole that is done, 0 to 1.
    pub(crate) fn show(&mut self, step: &str, done: f64) {
        let due = self.drawn.map_or(self.start.elapsed() > DELAY, |drawn| drawn.elapsed() > PAUSE);
        if self.terminal && due {
            let full = ((done * WIDTH as f64) as usize).min(WIDTH);
            eprint!(
                "\r\x1b[K[{}{}] {:3.0} %  {step}",
                "#".repeat(full),
                " ".repeat(WIDTH - full),
                100.0 * done.min(1.0)
            );
            let _ = io::stderr().flush();
            self.drawn = Some(Instant::now());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn.is_some() {
            eprint!("\r\x1b[K");
        }
    }
}
