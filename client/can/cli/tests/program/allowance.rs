//! Waiting for processes: an allowance that grows with the lateness of the machine, which is
//! measured. Tests of times run on simulated time and need none of this.

use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

/// How long something may take that takes no time of its own, where nothing else is at work.
const ALONE: Duration = Duration::from_secs(15);
/// Between two looks.
const PAUSE: Duration = Duration::from_millis(10);
/// Between two measurements of the machine.
const MEASURED: Duration = Duration::from_secs(2);
/// A sleep that wakes so late is as late as can be on a machine with nothing else at work.
const LATE: Duration = Duration::from_millis(5);
/// No machine is believed to be slower than this.
const SLOWEST: f64 = 40.0;

/// How many times longer things take here than with nothing else at work, at least 1: by how late
/// sleeps wake, and by how long a thread that works waits for a processor.
pub(crate) fn slowness() -> f64 {
    let mut late = Duration::ZERO;
    for _ in 0..4 {
        let begin = Instant::now();
        std::thread::sleep(LATE);
        late = late.max(begin.elapsed().saturating_sub(LATE));
    }
    let by_sleep = late.as_secs_f64() / LATE.as_secs_f64();
    // a thread of its own, whose account of the scheduler begins with it
    let by_work = std::thread::spawn(waiting_share).join().ok().flatten().unwrap_or(1.0);
    by_sleep.max(by_work).clamp(1.0, SLOWEST)
}

/// (run + wait) / run of a thread that works, from the scheduler's account.
fn waiting_share() -> Option<f64> {
    let account = || -> Option<[f64; 2]> {
        let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        let mut numbers = text.split_whitespace().map_while(|word| word.parse::<f64>().ok());
        Some([numbers.next()?, numbers.next()?])
    };
    let begin = Instant::now();
    let mut work = 0_u64;
    let [run, wait] = loop {
        (0..20_000_u64).for_each(|k| work = std::hint::black_box(work.wrapping_mul(31) ^ k));
        let [run, wait] = account()?;
        if run > 20e6 || begin.elapsed() > Duration::from_secs(1) {
            break [run, wait];
        }
    };
    (run > 0.0).then(|| (run + wait) / run)
}

/// Rest of a time limit.
#[derive(Debug)]
pub(crate) struct Allowance {
    left: f64,
    slowness: f64,
    measured: Instant,
    looked: Instant,
}

impl Allowance {
    pub(crate) fn new() -> Allowance {
        let now = Instant::now();
        // at first as if nothing else were at work: most waits are short
        Allowance { left: ALONE.as_secs_f64(), slowness: 1.0, measured: now, looked: now }
    }

    /// Whether there is any left. The time since the last call counts as much less as the machine
    /// is slower.
    pub(crate) fn is_left(&mut self) -> bool {
        if self.measured.elapsed() > MEASURED {
            self.slowness = slowness();
            self.measured = Instant::now();
        }
        self.left -= self.looked.elapsed().as_secs_f64() / self.slowness;
        self.looked = Instant::now();
        self.left > 0.0
    }

    /// Waits a little; false where nothing of it is left.
    pub(crate) fn pause(&mut self) -> bool {
        std::thread::sleep(PAUSE);
        self.is_left()
    }
}

/// Waits until there is something.
pub(crate) fn wait_for<T>(what: &str, mut there: impl FnMut() -> Option<T>) -> T {
    let mut allowance = Allowance::new();
    loop {
        if let Some(found) = there() {
            return found;
        }
        assert!(allowance.pause(), "{what} does not come");
    }
}

/// The next value from a process.
pub(crate) fn next<T>(from: &Receiver<T>, what: &str) -> T {
    let mut allowance = Allowance::new();
    loop {
        match from.recv_timeout(PAUSE) {
            Ok(thing) => return thing,
            Err(RecvTimeoutError::Timeout) => assert!(allowance.is_left(), "no {what}"),
            Err(RecvTimeoutError::Disconnected) => panic!("no {what}: its process has ended"),
        }
    }
}
