//! Waits for a server that the caller can interrupt, as an interpreter does on a signal.

use std::cell::Cell;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use sarrus_proto::control::{
    ControlRequest, ControlResponse, NoResponse, receive_answer, send_call,
};
use sarrus_proto::socket::ControlSocket;

/// Time between two calls of `ask`.
const LOOK: Duration = Duration::from_millis(50);

/// The function to ask, and the time of the next call.
#[derive(Clone, Copy)]
struct Question {
    ask: fn() -> bool,
    /// `None` before the first wait.
    next: Option<Instant>,
}

thread_local! {
    static QUESTION: Cell<Option<Question>> = const { Cell::new(None) };
}

/// Restores the outer function.
struct Restore(Option<Question>);

impl Drop for Restore {
    fn drop(&mut self) {
        QUESTION.set(self.0);
    }
}

/// Runs a closure that uses or connects robots, with interruptible waits for servers on this
/// thread: during a long wait `ask` is called about twenty times a second, and if it returns true
/// the wait ends with [`ConnectError::Interrupted`](crate::ConnectError::Interrupted). Nothing is
/// sent twice; a robot whose wait ended so connects again with its next call.
pub fn interruptible<T>(ask: fn() -> bool, f: impl FnOnce() -> T) -> T {
    let _before = Restore(QUESTION.replace(Some(Question { ask, next: None })));
    f()
}

/// Whether to end the wait; asks at most once per [`LOOK`].
pub(crate) fn is_wanted() -> bool {
    let Some(Question { ask, next }) = QUESTION.get() else { return false };
    let now = Instant::now();
    let again = Some(Question { ask, next: Some(now + LOOK) });
    match next {
        None => {
            QUESTION.set(again);
            false
        }
        Some(next) if now < next => false,
        Some(_) => {
            // the function itself may wait for a server
            QUESTION.set(None);
            let _after = Restore(again);
            ask()
        }
    }
}

/// Makes a call and waits for its answer, in slices if the wait is interruptible; `None` if it was
/// interrupted.
pub(crate) fn exchange(
    socket: &ControlSocket,
    request: &ControlRequest,
    deadline: Instant,
) -> Result<Option<(ControlResponse, Option<OwnedFd>)>, NoResponse> {
    send_call(socket, request)?;
    loop {
        let slice = match QUESTION.get() {
            Some(_) => deadline.min(Instant::now() + LOOK),
            None => deadline,
        };
        match receive_answer(socket, request, slice) {
            Err(NoResponse::Late) if slice < deadline => {}
            outcome => return outcome.map(Some),
        }
        if is_wanted() {
            return Ok(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wait_is_given_up_where_somebody_wants_it_and_only_there() {
        let is_given_up = |limit: Duration| {
            let start = Instant::now();
            while start.elapsed() < limit {
                if is_wanted() {
                    return start.elapsed() >= LOOK;
                }
                std::thread::sleep(LOOK / 10);
            }
            false
        };
        assert!(!is_given_up(4 * LOOK));
        assert!(!interruptible(|| false, || is_given_up(4 * LOOK)));
        // an inner function replaces the outer one until it returns
        assert!(!interruptible(|| true, || interruptible(|| false, || is_given_up(4 * LOOK))));
        assert!(interruptible(|| true, || is_given_up(600 * LOOK)));
        assert!(QUESTION.get().is_none());
    }
}
