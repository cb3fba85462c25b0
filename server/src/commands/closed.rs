//! Whether stdout was closed when the program started. The standard library opens /dev/null in its
//! place before `main`, where every answer would be lost without a word.
// lint: nothing of safe Rust runs earlier; everything that needs it is in this file
#![allow(unsafe_code)]

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use rustix::io::{Errno, fcntl_getfd};
use rustix::stdio::stdout;

static CLOSED: AtomicBool = AtomicBool::new(false);

extern "C" fn look() {
    CLOSED.store(fcntl_getfd(stdout()) == Err(Errno::BADF), Relaxed);
}

// SAFETY: what calls the functions of this section takes them for such as this one, which needs
// nothing that is not there before `main`: it makes one system call and allocates nothing.
#[cfg(target_os = "linux")]
#[used]
#[unsafe(link_section = ".init_array")]
static LOOK: extern "C" fn() = look;

/// True where results would go nowhere.
pub(crate) fn stdout_was_closed() -> bool {
    CLOSED.load(Relaxed)
}
