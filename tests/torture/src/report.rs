//! The results of an attack.

use std::fmt::Display;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use crate::Settings;

/// The end of an attack.
pub(crate) enum Verdict {
    Done(Report),
    /// The reason why this machine does not allow it.
    NotRun(String),
}

/// Counts and faults of an attack.
#[derive(Default)]
pub(crate) struct Report {
    counts: Vec<String>,
    faults: Vec<String>,
    strict: bool,
}

impl Report {
    pub(crate) fn new(settings: &Settings) -> Report {
        Report { strict: settings.strict, ..Report::default() }
    }

    /// Adds a line of counts.
    pub(crate) fn count(&mut self, line: impl Into<String>) {
        self.counts.push(line.into());
    }

    /// Adds a fault.
    pub(crate) fn fault(&mut self, line: impl Into<String>) {
        self.faults.push(line.into());
    }

    /// Adds a fault unless a condition holds.
    pub(crate) fn require(&mut self, holds: bool, line: impl FnOnce() -> String) {
        if !holds {
            self.fault(line());
        }
    }

    /// Times of something, which should take at most `aim` in 99 of 100 cases.
    pub(crate) fn times(&mut self, label: &str, times: &mut [Duration], aim: Option<Duration>) {
        let [p50, p99, worst] = percentiles(times, [50, 99, 100]);
        let ms = |span: Duration| format!("{:.3}", 1e3 * span.as_secs_f64());
        let n = times.len();
        self.count(format!(
            "{label}: {n} times, p50 {} ms, p99 {} ms, worst {} ms",
            ms(p50),
            ms(p99),
            ms(worst)
        ));
        if let Some(aim) = aim.filter(|aim| p99 > *aim) {
            let line = format!("{label}: p99 {} ms is over the aim of {} ms", ms(p99), ms(aim));
            match self.strict {
                true => self.fault(line),
                false => self.count(line),
            }
        }
    }

    /// Prints everything; the exit code.
    pub(crate) fn print(&self, name: &str) -> u8 {
        self.counts.iter().for_each(|line| println!("{name}: {line}"));
        self.faults.iter().skip(1).for_each(|line| println!("{name}: fault: {line}"));
        match self.faults.first() {
            None => println!("PASS {name}"),
            Some(first) => println!("FAIL {name}: {first}"),
        }
        u8::from(!self.faults.is_empty())
    }
}

/// These percentiles; zero of no times.
pub(crate) fn percentiles(times: &mut [Duration], of_hundred: [usize; 3]) -> [Duration; 3] {
    times.sort_unstable();
    let last = times.len().saturating_sub(1);
    of_hundred.map(|part| times.get(last * part / 100).copied().unwrap_or_default())
}

/// How long an attack goes on, with a line of how far it is on a terminal.
pub(crate) struct Clock {
    name: &'static str,
    start: Instant,
    length: Duration,
    shown: Instant,
    on_terminal: bool,
}

impl Clock {
    pub(crate) fn new(name: &'static str, seconds: f64) -> Clock {
        let now = Instant::now();
        let length = Duration::try_from_secs_f64(seconds).unwrap_or_default();
        Clock { name, start: now, length, shown: now, on_terminal: std::io::stderr().is_terminal() }
    }

    /// True while it goes on; `state` is shown now and then.
    pub(crate) fn runs<S: Display>(&mut self, state: impl FnOnce() -> S) -> bool {
        let now = Instant::now();
        let elapsed = now - self.start;
        let over = elapsed >= self.length;
        if self.on_terminal && (over || now - self.shown > Duration::from_millis(200)) {
            self.shown = now;
            let mut out = std::io::stderr().lock();
            let at = elapsed.as_secs_f64();
            let of = self.length.as_secs_f64();
            let end = if over { "\r\x1b[K" } else { "" };
            let name = self.name;
            let _ = write!(out, "\r\x1b[K{name}  {at:.0} of {of:.0} s  {}{end}", state())
                .and_then(|()| out.flush());
        }
        !over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_few_and_no_times_are_among_them() {
        let ms = Duration::from_millis;
        assert_eq!(percentiles(&mut [], [50, 99, 100]), [ms(0); 3]);
        assert_eq!(percentiles(&mut [ms(7)], [50, 99, 100]), [ms(7); 3]);
        let mut times: Vec<Duration> = (1..=100).rev().map(ms).collect();
        assert_eq!(percentiles(&mut times, [50, 99, 100]), [ms(50), ms(99), ms(100)]);
    }
}
