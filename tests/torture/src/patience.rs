//! How long tests and attacks wait: for a condition, within one limit that only a defect reaches.

use std::time::{Duration, Instant};

/// The longest wait for anything that must happen; far above the time that a busy machine needs.
pub const LIMIT: Duration = Duration::from_secs(120);
/// The pause between two looks at a condition.
const PAUSE: Duration = Duration::from_micros(500);

/// The end of a wait that begins now.
pub fn deadline() -> Instant {
    Instant::now() + LIMIT
}

/// Waits until `probe` returns a value; `None` after [`LIMIT`].
pub fn poll<T>(mut probe: impl FnMut() -> Option<T>) -> Option<T> {
    let deadline = deadline();
    loop {
        if let Some(found) = probe() {
            return Some(found);
        }
        if Instant::now() > deadline {
            return None;
        }
        std::thread::sleep(PAUSE);
    }
}

/// Waits until a condition holds; `false` after [`LIMIT`].
pub fn holds(mut condition: impl FnMut() -> bool) -> bool {
    poll(|| condition().then_some(())).is_some()
}
