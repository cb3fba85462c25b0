//! Shows the progress of a run on standard error.

use std::cell::Cell;
use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Time between two lines if no bar is shown.
const LINES: Duration = Duration::from_secs(15);
/// Steps of the bar.
const STEPS: f64 = 1000.0;
/// No estimate of the remaining time before this fraction is done.
const EARLY: f64 = 0.02;

/// A bar on a terminal; elsewhere nothing, or occasional plain lines.
#[derive(Debug)]
pub struct Progress {
    bar: Option<ProgressBar>,
    lines: bool,
    start: Instant,
    /// When the last line was written.
    written: Cell<Instant>,
    /// The share of the whole run that 0 to 1 covers.
    part: Cell<(f64, f64)>,
}

impl Progress {
    /// A bar if standard error is a terminal, else nothing.
    pub fn silent() -> Progress {
        Progress::new(false)
    }

    /// A bar if standard error is a terminal, else an occasional line.
    pub fn with_lines() -> Progress {
        Progress::new(true)
    }

    fn new(lines: bool) -> Progress {
        let terminal = stderr().is_terminal();
        let start = Instant::now();
        let bar = terminal.then(|| {
            let bar = ProgressBar::with_draw_target(
                Some(STEPS as u64),
                ProgressDrawTarget::stderr_with_hz(5),
            );
            let left = move |state: &ProgressState, f: &mut dyn core::fmt::Write| {
                let _ = f.write_str(&left(start.elapsed(), f64::from(state.fraction())));
            };
            let style = ProgressStyle::with_template("[{bar:30}] {percent:>3} % {left}  {msg}");
            bar.set_style(
                style
                    .unwrap_or_else(|_| ProgressStyle::default_bar())
                    .with_key("left", left)
                    .progress_chars("=> "),
            );
            bar
        });
        Progress {
            bar,
            lines: lines && !terminal,
            start,
            written: Cell::new(start),
            part: Cell::new((0.0, 1.0)),
        }
    }

    /// From now on 0 to 1 covers this share of the whole run.
    pub fn part(&self, from: f64, to: f64) {
        self.part.set((from, to));
    }

    /// Shows the current task and its progress, 0 to 1.
    pub fn show(&self, what: &str, done: f64) {
        let (from, to) = self.part.get();
        let done = from + (to - from) * done.clamp(0.0, 1.0);
        match &self.bar {
            Some(bar) => {
                bar.set_message(what.to_owned());
                bar.set_position((done * STEPS) as u64);
            }
            None if self.lines && self.written.get().elapsed() >= LINES => {
                self.written.set(Instant::now());
                eprintln!("{:3.0} %, {what}; {}", 100.0 * done, left(self.start.elapsed(), done));
            }
            None => {}
        }
    }

    /// Removes the bar.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// The remaining time, from the time of the fraction done.
fn left(elapsed: Duration, done: f64) -> String {
    if done < EARLY {
        return format!("{} s", elapsed.as_secs());
    }
    let seconds = (elapsed.as_secs_f64() * (1.0 / done - 1.0)).ceil() as u64;
    if seconds < 120 {
        format!("{seconds} s left")
    } else {
        format!("{} min left", seconds.div_ceil(60))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_is_what_the_rest_takes_at_the_same_speed() {
        assert_eq!(left(Duration::from_secs(3), 0.0), "3 s");
        assert_eq!(left(Duration::from_secs(30), 0.5), "30 s left");
        assert_eq!(left(Duration::from_secs(60), 0.1), "9 min left");
        assert_eq!(left(Duration::from_secs(9), 1.0), "0 s left");
    }
}
