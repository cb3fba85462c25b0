//! The watchdogs: the upkeep thread watches the answering thread, a thread of its own the upkeep
//! thread and the supervisor.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use rustix::process::{Signal, getpid, kill_process};

use crate::error::ServeError;
use crate::system::processes::continue_stopped;
use crate::system::stderr::line;

/// Without a heartbeat for this long, a thread counts as hanging.
pub(crate) const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between two looks at the upkeep thread and the supervisor.
const LOOK: Duration = Duration::from_millis(500);
/// A look that is later than this is reported.
const LATE: Duration = Duration::from_secs(2);
/// Time in which the reason of an end is written.
const WORDS: Duration = Duration::from_millis(100);

/// Measures the time without a heartbeat while this thread runs: a stop of the whole process, such
/// as SIGSTOP, does not count.
pub(crate) struct Watchdog {
    /// Longest time between two polls while this thread runs.
    step: Duration,
    beats: u64,
    /// Running time of this thread since the last heartbeat.
    lost: Duration,
    polled: Instant,
}

impl Watchdog {
    pub(crate) fn new(step: Duration) -> Watchdog {
        Watchdog { step, beats: 0, lost: Duration::ZERO, polled: Instant::now() }
    }

    /// Updates the watchdog by the number of heartbeats; call it often.
    pub(crate) fn poll(&mut self, beats: u64) {
        let now = Instant::now();
        // a step that took longer was interrupted
        self.lost += (now - self.polled).min(self.step);
        self.polled = now;
        if beats != self.beats {
            (self.beats, self.lost) = (beats, Duration::ZERO);
        }
    }

    pub(crate) fn is_lost(&self) -> bool {
        self.lost > HEARTBEAT_TIMEOUT
    }
}

/// Starts the thread that watches the upkeep thread, for as long as the returned count of its steps
/// is held. Where the upkeep thread hangs, it ends a process with a supervisor, which starts
/// another one, and reports it otherwise: attached clients are answered still. It continues a
/// stopped supervisor.
pub(crate) fn watch_upkeep(
    supervisor: Option<i32>,
    place: impl FnOnce() + Send + 'static,
) -> Result<Arc<AtomicU64>, ServeError> {
    let steps = Arc::new(AtomicU64::new(0));
    let watched = Arc::downgrade(&steps);
    let body = move || {
        place();
        let mut watchdog = Watchdog::new(2 * LOOK);
        let mut was_lost = false;
        loop {
            let start = Instant::now();
            std::thread::sleep(LOOK);
            let Some(steps) = watched.upgrade() else { return };
            let late = start.elapsed().saturating_sub(LOOK);
            if late > LATE {
                line(format_args!(
                    "sarrus serve: warning: this process did not run for {late:.1?}: a signal \
                     stopped it, or it had no processor"
                ));
            }
            if supervisor.is_some_and(continue_stopped) {
                line(format_args!(
                    "sarrus serve: warning: a signal had stopped the supervisor: continued"
                ));
            }
            watchdog.poll(steps.load(Relaxed));
            if watchdog.is_lost() && !was_lost {
                report_hung(supervisor.is_some());
            }
            was_lost = watchdog.is_lost();
        }
    };
    let builder = std::thread::Builder::new().name("sarrus-watch".to_owned());
    let thread = builder.stack_size(256 << 10).spawn(body);
    thread.map(|_| steps).map_err(ServeError::Thread)
}

/// Reports that the upkeep thread hangs, and ends this process if it is supervised.
fn report_hung(is_supervised: bool) {
    let outcome = match is_supervised {
        true => "this process ends",
        false => "attached clients are answered, new ones are not",
    };
    let seconds = HEARTBEAT_TIMEOUT.as_secs();
    // on another thread: the one that hangs may hold stderr
    let report = move || {
        line(format_args!(
            "sarrus serve: error: the upkeep thread hangs: no step for {seconds} s, while another \
             thread ran; {outcome}"
        ));
    };
    let _ = std::thread::Builder::new().spawn(report);
    if is_supervised {
        std::thread::sleep(WORDS);
        // an orderly end needs the thread that hangs
        let _ = kill_process(getpid(), Signal::KILL);
    }
}
