//! One bus: the frames of a cycle, and the bus's state.

use super::counters::BusCounters;
use crate::event::BusState;
use crate::frame::{Frame, FrameQueue};
use crate::state::state;

/// Room for frames of one motor in one cycle.
pub(super) const FRAMES_PER_MOTOR: usize = 8;

#[derive(Debug)]
pub(super) struct Bus {
    pub(super) queue: FrameQueue,
    /// Frames of the cycle before.
    pub(super) sent: FrameQueue,
    /// Indices of its motors, and the motor whose frame probably comes next: motors answer in the
    /// order of the requests.
    pub(super) members: Vec<usize>,
    pub(super) next: usize,
    /// One of its motors has power.
    pub(super) has_power: bool,
    /// No motor that waits for its frame pauses.
    pub(super) is_synchronous: bool,
    pub(super) sync: Option<Frame>,
    pub(super) state: BusState,
    pub(super) backlog: u32,
    pub(super) counters: BusCounters,
}

impl Bus {
    /// A bus on which nothing was sent yet, with the indices of its motors and the frame that they
    /// wait for.
    pub(super) fn new(members: Vec<usize>, sync: Option<Frame>) -> Bus {
        let room = (members.len() + 1) * FRAMES_PER_MOTOR;
        Bus {
            members,
            queue: FrameQueue::new(room),
            sent: FrameQueue::new(room),
            next: 0,
            has_power: false,
            is_synchronous: true,
            sync,
            state: BusState::Active,
            backlog: 0,
            counters: BusCounters::default(),
        }
    }

    /// A cycle begins.
    pub(super) fn begin(&mut self) {
        std::mem::swap(&mut self.queue, &mut self.sent);
        self.queue.clear();
        (self.has_power, self.is_synchronous) = (false, true);
    }

    /// Whether a frame is one of the last two cycles, which some adapters give back.
    pub(super) fn is_echo(&self, frame: &Frame) -> bool {
        self.queue.frames().contains(frame) || self.sent.frames().contains(frame)
    }
}

state!(Bus {
    queue, sent, next, state, backlog; members, has_power, is_synchronous, sync, counters
});
