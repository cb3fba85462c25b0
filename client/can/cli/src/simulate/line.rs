//! One bus of the simulation, with loss and delay of frames.

use std::collections::VecDeque;

use sarrus_can_core::frame::{Frame, FrameQueue};

use serde_json::{Value, json};

use super::motors::Motors;
use sarrus_can_run::bus::{Bus, BusError, Heard, Sent};

/// A bus with its motors' end of the wire.
pub(super) struct Line {
    pub(super) name: String,
    place: usize,
    pub(super) bus: Box<dyn Bus>,
    replies: FrameQueue,
    /// Frames on their way, with the time at which they are sent `[ns]`.
    waiting: VecDeque<(u64, Frame)>,
    /// Part of the frames that are lost, in both directions.
    pub(super) loss: f64,
    /// Replies come later by this `[ns]`.
    pub(super) delay_ns: u64,
    random: u64,
    /// Frames heard; replies sent; frames that loss, or a host that does not listen, took.
    counts: [u64; 3],
}

impl Line {
    pub(super) fn new(name: String, place: usize, bus: Box<dyn Bus>, seed: u64) -> Line {
        let random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        Line {
            name,
            place,
            bus,
            replies: FrameQueue::new(256),
            waiting: VecDeque::new(),
            loss: 0.0,
            delay_ns: 0,
            random,
            counts: [0; 3],
        }
    }

    /// Gives all frames that are there to the motors.
    pub(super) fn hear(&mut self, now_ns: u64, motors: &mut Motors) -> Result<(), BusError> {
        while let Some(heard) = self.bus.next()? {
            let Heard::Frame(frame) = heard else { continue };
            if self.is_lost() {
                self.count(2);
                continue;
            }
            self.count(0);
            motors.receive(now_ns, self.place, &frame, &mut self.replies);
        }
        motors.collect(self.place, &mut self.replies);
        let due_ns = now_ns + self.delay_ns;
        self.waiting.extend(self.replies.frames().iter().map(|frame| (due_ns, *frame)));
        self.replies.clear();
        Ok(())
    }

    /// Sends the frames that are due.
    pub(super) fn send(&mut self, now_ns: u64) -> Result<(), BusError> {
        while let Some(&(due_ns, frame)) = self.waiting.front() {
            if due_ns > now_ns {
                break;
            }
            self.waiting.pop_front();
            let sent = if self.is_lost() { Sent::Dropped } else { self.bus.send(&frame)? };
            self.count(if sent == Sent::Taken { 1 } else { 2 });
        }
        Ok(())
    }

    /// When the next reply is to be sent `[ns]`.
    pub(super) fn due_ns(&self) -> Option<u64> {
        self.waiting.front().map(|(due_ns, _)| *due_ns)
    }

    /// Counts of this bus.
    pub(super) fn report(&self) -> Value {
        let [heard, sent, lost] = self.counts;
        json!({"bus": self.name, "heard": heard, "sent": sent, "lost": lost,
           "backlog": self.bus.backlog()})
    }

    fn count(&mut self, what: usize) {
        self.counts.iter_mut().skip(what).take(1).for_each(|count| *count += 1);
    }

    /// A coin of xorshift64 that falls on loss.
    fn is_lost(&mut self) -> bool {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 11) as f64 / (1u64 << 53) as f64 <= self.loss && self.loss > 0.0
    }
}
