//! Messages on stderr.
//!
//! While motors run no thread of theirs may wait for the reader of stderr: a stopped terminal takes
//! no lines. A thread of its own then writes them.

use std::fmt::Arguments;
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// Lines that may wait; more are lost.
const ROOM: usize = 64;
/// Longest time that the end of the program waits for lines to be written, and the time between two
/// looks.
const LAST: (Duration, Duration) = (Duration::from_millis(200), Duration::from_millis(5));

static PROGRAM: OnceLock<&str> = OnceLock::new();
static LINES: OnceLock<SyncSender<String>> = OnceLock::new();
static WAITING: AtomicUsize = AtomicUsize::new(0);

/// From now on no thread waits for stderr, also none that panics. Each line begins with `program`.
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

/// Says something.
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

/// Gives the last lines a little time to be written.
pub fn finish() {
    let (longest, pause) = LAST;
    let mut waited = Duration::ZERO;
    while WAITING.load(Ordering::Relaxed) > 0 && waited < longest {
        thread::sleep(pause);
        waited += pause;
    }
}
