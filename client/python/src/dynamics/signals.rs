//! Waits for a server, between which Python looks for signals.

use std::cell::{Cell, RefCell};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::intern;
use pyo3::prelude::*;
use sarrus_client::interruptible;
use sarrus_proto::process_number;

use super::errors::ConnectError;
use crate::locked;

/// Between two looks for signals.
const LOOK: Duration = Duration::from_millis(50);
/// Between two looks at a robot that another thread asks: at first none, then this.
const TURN: Duration = Duration::from_millis(1);

thread_local! {
    /// The exception that a signal's handler raised while this thread waited.
    static RAISED: RefCell<Option<PyErr>> = const { RefCell::new(None) };
    /// The locks that this thread holds, by address; handlers that come meanwhile wait for none.
    static HOLDS: RefCell<Vec<usize>> = const { RefCell::new(Vec::new()) };
    /// Whether handlers run in this thread, with the process for which that is known.
    static IS_MAIN: Cell<Option<(u64, bool)>> = const { Cell::new(None) };
}

/// True in the thread in which Python runs the handlers of signals. No other looks for them, or
/// takes Python's lock while it waits: it may be one that outlives the interpreter.
pub(super) fn is_main(py: Python<'_>) -> PyResult<bool> {
    if let Some((at, is_main)) = IS_MAIN.get()
        && at == process_number()
    {
        return Ok(is_main);
    }
    let threading = py.import(intern!(py, "threading"))?;
    let main = threading.call_method0(intern!(py, "main_thread"))?.getattr(intern!(py, "ident"))?;
    let is_main = main.eq(threading.call_method0(intern!(py, "get_ident"))?)?;
    IS_MAIN.set(Some((process_number(), is_main)));
    Ok(is_main)
}

/// Runs handlers of signals; true where one raised.
fn is_interrupted() -> bool {
    if RAISED.with_borrow(Option::is_some) {
        return true;
    }
    // handlers may ask other robots: nothing is borrowed meanwhile
    match Python::attach(|py| py.check_signals()) {
        Ok(()) => false,
        Err(error) => {
            RAISED.set(Some(error));
            true
        }
    }
}

/// Runs a function that waits for a server, without Python's lock; in the main thread an exception
/// of a signal's handler ends the wait.
pub(super) fn waiting<T>(is_main: bool, f: impl FnOnce() -> T) -> PyResult<T> {
    if !is_main {
        return Ok(f());
    }
    let outcome = interruptible(is_interrupted, f);
    RAISED.take().map_or(Ok(outcome), Err)
}

/// The guard of a lock that other threads may hold while they wait for a server.
pub(super) struct Held<'a, T> {
    pub(super) inner: MutexGuard<'a, T>,
}

impl<T> Drop for Held<'_, T> {
    fn drop(&mut self) {
        HOLDS.with_borrow_mut(Vec::pop);
    }
}

/// Waits for the lock, without Python's; as [`waiting`].
pub(super) fn hold<T>(is_main: bool, mutex: &Mutex<T>) -> PyResult<Held<'_, T>> {
    let address = std::ptr::from_ref(mutex).addr();
    let mut start = None;
    let mut looks = 0;
    let inner = loop {
        match mutex.try_lock() {
            Ok(inner) => break inner,
            Err(TryLockError::Poisoned(error)) => break error.into_inner(),
            Err(TryLockError::WouldBlock) if HOLDS.with_borrow(|held| held.contains(&address)) => {
                return Err(ConnectError::new_err(
                    "this robot is being asked; the handler of a signal that comes meanwhile \
                     cannot ask it too",
                ));
            }
            Err(TryLockError::WouldBlock) if !is_main => {
                break locked(mutex);
            }
            Err(TryLockError::WouldBlock) => {}
        }
        let waited = start.get_or_insert_with(Instant::now).elapsed();
        if waited >= LOOK * (looks + 1) {
            looks += 1;
            if is_interrupted()
                && let Some(error) = RAISED.take()
            {
                return Err(error);
            }
        }
        if waited < TURN {
            thread::yield_now();
        } else {
            thread::sleep(TURN);
        }
    };
    HOLDS.with_borrow_mut(|held| held.push(address));
    Ok(Held { inner })
}
