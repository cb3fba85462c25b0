//! The thread of one bus: sends the frames of the rules, receives, and at its end sends the
//! shutdown frames.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};
use rustix::event::{EventfdFlags, PollFd, PollFlags, eventfd};
use sarrus_can_core::bridge::BusEvent;
use sarrus_can_core::frame::Frame;

use crate::bus::{Bus, BusError, Heard, POLL, Sent, wait_for};
use crate::realtime;
use crate::stderr::say;
use sarrus_client::now_ns;

/// Room for frames and events on their way between two threads.
const ROOM: usize = 4096;
/// Most inputs that are taken before frames are sent again.
const AT_ONCE: usize = 256;
/// Most events of a bus that wait for room.
const UNTOLD: usize = 16;
/// How often the shutdown frames are sent, and the time between.
const SHUTDOWN: (usize, Duration) = (5, Duration::from_millis(5));
/// Longest wait, after which a bus checks whether the rules still run.
const TIMEOUT: Duration = Duration::from_millis(50);

/// Input of a bus, and its time `[ns]`.
pub(crate) type Stamped = (u64, Heard);

/// The thread's end of the queues, and the bus.
pub(crate) struct BusThread {
    name: String,
    port: Box<dyn Bus>,
    queues: Queues,
    /// Frames that take the power from every motor of this bus.
    shutdown_frames: Vec<Frame>,
}

/// Queues between the rules and a bus.
struct Queues {
    /// Frames with the number of their cycle.
    to_send: Consumer<(u64, Frame)>,
    heard: Producer<Stamped>,
    bell: Arc<OwnedFd>,
    /// Frames received without room in `heard`, not reported yet.
    overrun: u32,
    /// Events without room in `heard`, oldest first.
    untold: Vec<BusEvent>,
    /// Time of the last input `[ns]`.
    last_ns: u64,
    /// The last reported backlog.
    backlog: u32,
    /// See [`Bus::is_mute`].
    is_mute: bool,
}

/// The rules' end of the queues.
pub(crate) struct BusEnd {
    to_send: Producer<(u64, Frame)>,
    heard: Consumer<Stamped>,
    bell: Arc<OwnedFd>,
    is_mute: bool,
}

impl BusEnd {
    /// Input until now; later input belongs to the next cycle.
    pub(crate) fn heard(&mut self) -> impl Iterator<Item = Stamped> {
        let waiting = self.heard.slots();
        std::iter::from_fn(|| self.heard.pop().ok()).take(waiting)
    }

    /// Whether frames of the last cycle still wait: the bus's thread does not get to run.
    pub(crate) fn is_late(&self) -> bool {
        self.to_send.slots() < ROOM
    }

    /// Hands the frames of a cycle over and wakes the bus; gives how many are dropped.
    pub(crate) fn send(&mut self, cycle: u64, frames: &[Frame]) -> u32 {
        let mut dropped = 0;
        for frame in frames {
            let is_refused = self.to_send.push((cycle, *frame)).is_err();
            dropped += u32::from(is_refused || self.is_mute);
        }
        // the counter of the bell cannot overflow in a lifetime
        let _ = rustix::io::write(&*self.bell, &1_u64.to_ne_bytes());
        dropped
    }
}

impl Drop for BusEnd {
    /// Wakes the bus for its shutdown frames. The queue that it looks at is gone a moment later: it
    /// looks again after the bell.
    fn drop(&mut self) {
        let (gone, _) = RingBuffer::new(1);
        drop(std::mem::replace(&mut self.to_send, gone));
        let _ = rustix::io::write(&*self.bell, &1_u64.to_ne_bytes());
    }
}

impl BusThread {
    /// The thread and the rules' end of an open bus.
    pub(crate) fn new(
        name: &str,
        port: Box<dyn Bus>,
        shutdown_frames: Vec<Frame>,
    ) -> Result<(BusThread, BusEnd), BusError> {
        let name = name.to_owned();
        let flags = EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC;
        let bell = Arc::new(
            eventfd(0, flags).map_err(|error| BusError::Open(name.clone(), error.into()))?,
        );
        let (send, to_send) = RingBuffer::new(ROOM);
        let (hear, heard) = RingBuffer::new(ROOM);
        let is_mute = port.is_mute();
        let end = BusEnd { to_send: send, heard, bell: bell.clone(), is_mute };
        let queues = Queues {
            to_send,
            heard: hear,
            bell,
            overrun: 0,
            untold: Vec::with_capacity(UNTOLD),
            last_ns: 0,
            backlog: 0,
            is_mute,
        };
        let shutdown_frames = if is_mute { Vec::new() } else { shutdown_frames };
        Ok((BusThread { name, port, queues, shutdown_frames }, end))
    }

    /// Serves the bus until the rules end; then the motors are disabled.
    pub(crate) fn run(mut self, priority: Option<u8>) {
        realtime::be_first(priority);
        while !self.queues.to_send.is_abandoned() {
            if let Err(error) = self.queues.serve(&mut *self.port) {
                say(format_args!("{}: {error}", self.name));
                return;
            }
        }
        // the logs hold the last cycle too
        let _ = self.queues.send(&mut *self.port);
    }
}

impl Queues {
    /// Waits, receives and sends once.
    fn serve(&mut self, port: &mut dyn Bus) -> Result<(), BusError> {
        {
            let bell = PollFd::from_borrowed_fd(self.bell.as_fd(), PollFlags::IN);
            match port.readable() {
                Some(readable) => {
                    let readable = PollFd::from_borrowed_fd(readable, PollFlags::IN);
                    wait_for(&mut [readable, bell], TIMEOUT)?;
                }
                None => drop(wait_for(&mut [bell], POLL)?),
            }
        }
        while let Some(event) = self.untold.first().copied() {
            if self.heard.push((now_ns(), Heard::Event(event))).is_err() {
                break;
            }
            self.untold.remove(0);
        }
        // a bus that never falls silent does not keep this thread from sending
        for _ in 0..AT_ONCE {
            let Some(heard) = port.next()? else { break };
            self.tell(heard, port.heard_ns());
        }
        if self.overrun > 0
            && self.heard.push((now_ns(), Heard::Event(BusEvent::Overrun(self.overrun)))).is_ok()
        {
            self.overrun = 0;
        }
        self.send(port)
    }

    /// Sends the frames of the newest cycle; older ones that still wait are dropped.
    fn send(&mut self, port: &mut dyn Bus) -> Result<(), BusError> {
        let mut count = [0; 8];
        // nothing to read means that the bus itself woke this thread
        let _ = rustix::io::read(&*self.bell, &mut count);
        let slots = self.to_send.slots();
        let newest = self.to_send.read_chunk(slots).ok().and_then(|chunk| {
            let (first, second) = chunk.as_slices();
            second.last().or(first.last()).map(|(cycle, _)| *cycle)
        });
        let Some(newest) = newest else { return Ok(()) };
        let mut dropped = 0;
        for _ in 0..slots {
            let Ok((cycle, frame)) = self.to_send.pop() else { break };
            let is_sent = cycle == newest && port.send(&frame)? == Sent::Taken;
            dropped += u32::from(!is_sent);
        }
        dropped += port.flush();
        // the rules count those of a mute bus themselves
        if dropped > 0 && !self.is_mute {
            self.tell(Heard::Event(BusEvent::Dropped(dropped)), None);
        }
        // frames of this cycle are on their way; those that still wait at the next are old
        let backlog = port.backlog().saturating_sub(slots as u32);
        if backlog != self.backlog && self.tell(Heard::Event(BusEvent::Backlog(backlog)), None) {
            self.backlog = backlog;
        }
        Ok(())
    }

    /// Queues an input for the rules, with its time of arrival where that is known; false if there
    /// is no room. A change of the bus's state then waits for room.
    fn tell(&mut self, heard: Heard, came_ns: Option<u64>) -> bool {
        let now_ns = now_ns();
        self.last_ns = came_ns.unwrap_or(now_ns).min(now_ns).max(self.last_ns);
        let is_told = self.untold.is_empty() && self.heard.push((self.last_ns, heard)).is_ok();
        match heard {
            _ if is_told => {}
            Heard::Event(event) if event.count().is_none() && self.untold.len() < UNTOLD => {
                self.untold.push(event)
            }
            _ => self.overrun += 1,
        }
        is_told
    }
}

impl Drop for BusThread {
    /// However this thread ends, its motors are commanded to turn their torque off.
    fn drop(&mut self) {
        let (times, pause) = SHUTDOWN;
        let mut are_taken = false;
        for _ in 0..times {
            let sent = self.shutdown_frames.iter().map(|frame| self.port.send(frame).ok());
            let refused = sent.filter(|sent| *sent != Some(Sent::Taken)).count();
            let dropped = self.port.flush();
            are_taken |= refused == 0 && dropped == 0;
            std::thread::sleep(pause);
        }
        if !are_taken {
            say(format_args!(
                "{}: its motors cannot be commanded off; only their own watchdogs remain",
                self.name
            ));
        }
    }
}
