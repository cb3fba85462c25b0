//! Clients that connect, taken in where there is room for them; the others wait in the kernel's
//! queue.

use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags};
use sarrus_proto::socket::{ControlListener, ControlSocket};

/// How many are taken in at one look; the others wait for the next.
const MAX_ARRIVALS: usize = 32;
/// How long nobody is taken in where there were no descriptors left.
const PAUSE: Duration = Duration::from_millis(20);

/// The socket that clients connect to.
pub(crate) struct Arrivals {
    listener: ControlListener,
    /// Nobody is taken in before this: there were no descriptors left.
    paused_until: Option<Instant>,
}

impl Arrivals {
    pub(crate) fn new(listener: ControlListener) -> Arrivals {
        Arrivals { listener, paused_until: None }
    }

    pub(crate) fn listener_mut(&mut self) -> &mut ControlListener {
        &mut self.listener
    }

    /// What to wait on for clients, as many as there is room for.
    pub(crate) fn awaited(&self, room: usize) -> PollFd<'_> {
        let open = room > 0 && self.paused_until.is_none_or(|until| Instant::now() >= until);
        PollFd::new(&self.listener, if open { PollFlags::IN } else { PollFlags::empty() })
    }

    /// Those that wait, as many as there is room for.
    pub(crate) fn take(&mut self, room: usize) -> Vec<ControlSocket> {
        self.paused_until = None;
        let mut taken = Vec::new();
        for _ in 0..room.min(MAX_ARRIVALS) {
            match self.listener.accept() {
                Ok(Some(socket)) => {
                    // the folder is this user's alone; whoever came in otherwise is not answered
                    let us = rustix::process::geteuid().as_raw();
                    let is_ours = socket.peer().is_ok_and(|peer| peer.user == us);
                    // who went meanwhile takes no room
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
