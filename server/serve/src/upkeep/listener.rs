//! New clients: accepted up to a limit; the others wait in the kernel's queue.

use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags};
use sarrus_proto::socket::{ControlListener, ControlSocket};

/// Clients accepted at once; the others wait for the next call.
const MAX_ACCEPTED: usize = 32;
/// Pause after the process ran out of descriptors.
const PAUSE: Duration = Duration::from_millis(20);

/// The socket that clients connect to.
pub(crate) struct Listener {
    pub(crate) listener: ControlListener,
    /// End of the pause.
    paused_until: Option<Instant>,
}

impl Listener {
    pub(crate) fn new(listener: ControlListener) -> Listener {
        Listener { listener, paused_until: None }
    }

    /// Descriptor to poll for new clients; none are awaited without room.
    pub(crate) fn awaited(&self, room: usize) -> PollFd<'_> {
        let open = room > 0 && self.paused_until.is_none_or(|until| Instant::now() >= until);
        PollFd::new(&self.listener, if open { PollFlags::IN } else { PollFlags::empty() })
    }

    /// Accepts waiting clients, at most `room`.
    pub(crate) fn take(&mut self, room: usize) -> Vec<ControlSocket> {
        self.paused_until = None;
        let mut taken = Vec::new();
        for _ in 0..room.min(MAX_ACCEPTED) {
            match self.listener.accept() {
                Ok(Some(socket)) => {
                    // only clients of this user are answered
                    let us = rustix::process::geteuid().as_raw();
                    let is_ours = socket.peer().is_ok_and(|peer| peer.user == us);
                    // a closed connection takes no room
                    if is_ours && !socket.is_closed() {
                        taken.push(socket);
                    }
                }
                Ok(None) => break,
                Err(_) => {
                    self.paused_until = Some(Instant::now() + PAUSE);
                    break;
                }
            }
        }
        taken
    }
}
