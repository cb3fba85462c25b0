//! Messages on stderr.
//!
//! While motors run, no thread of the bridge may wait for the reader of stderr, which may be a
//! stopped terminal. A separate thread then writes the lines.

use std::fmt::Arguments;
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// Lines that may wait; more are lost.
const ROOM: usize = 64;
/// Longest time that [`finish`] waits for the last lines, and the time between two checks.
const LAST: (Duration, Duration) = (Duration::from_millis(200), Duration::from_millis(5));

static PROGRAM: OnceLock<&str> = OnceLock::new();
static LINES: OnceLock<SyncSender<String>> = OnceLock::new();
static WAITING: AtomicUsize = AtomicUsize::new(0);

/// Starts the thread of stderr: no other thread waits for it any more, not even in a panic. Each
/// line begins with `program`.
pub fn never_wait(program: &'static str) {
    let _ = PROGRAM.set(program);
    let (lines, said) = sync_channel::<String>(ROOM);
    let teller = thread::Builder::new().name("say".to_owned()).spawn(move || {
        for line in said {
            // the reader may have gone
            let _ = writeln!(std::io::stderr(), "{line}");
            WAITING.fetch_sub(1, Ordering::Relaxed);
        }
    });
    if teller.is_ok() && LINES.set(lines).is_ok() {
        std::panic::set_hook(Box::new(|panic| say(format_args!("{panic}"))));
    }
}

/// Writes a line, or drops it if too many wait.
pub fn say(what: Arguments<'_>) {
    let line = format!("{}: {what}", PROGRAM.get().unwrap_or(&"sarrus-can"));
    let Some(lines) = LINES.get() else {
        let _ = writeln!(std::io::stderr(), "{line}");
        return;
    };
    WAITING.fetch_add(1, Ordering::Relaxed);
    if lines.try_send(line).is_err() {
        WAITING.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Waits a short time for the last lines.
pub fn finish() {
    let (longest, pause) = LAST;
    let mut waited = Duration::ZERO;
    while WAITING.load(Ordering::Relaxed) > 0 && waited < longest {
        thread::sleep(pause);
        waited += pause;
    }
}
