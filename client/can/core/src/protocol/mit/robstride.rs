//! Faults of a RobStride in MIT mode: its feedback has no room for them, so the drive requests
//! them.
//!
//! Source: RobStride 00 manual, "MIT protocol", command 5. FF ×6, any byte but FF, FB is the
//! request; the answer has the identifier of feedback: the motor's id and 32 bits, of which one end
//! is always 0. While an answer is pending, a reply with four zero bytes, or with 0 at one end and
//! behind it, counts as the answer. Feedback with these bytes would come from a motor at 0.0 °C at
//! the lower end of its position, or of its velocity and torque, which does not happen by chance.

use crate::frame::{Frame, Id};
use crate::state::state;

/// Time between two requests `[ns]`.
pub(super) const PERIOD_NS: u64 = 20_000_000;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Question {
    id: u16,
    asked_ns: Option<u64>,
    /// Requests without an answer; some may be in flight for long.
    n_open: u32,
    /// The last answer; 0 without one.
    pub(super) fault: u32,
}

impl Question {
    pub(super) fn new(id: u16) -> Question {
        Question { id, asked_ns: None, n_open: 0, fault: 0 }
    }

    /// Discards the known faults and requests them at once; answers of before may still come.
    pub(super) fn forget(&mut self) {
        *self = Question { n_open: self.n_open, ..Question::new(self.id) };
    }

    pub(super) fn frame(&self) -> Option<Frame> {
        Frame::classic(Id::Standard(self.id), &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x00, 0xFB])
    }

    /// The request, when it is due.
    pub(super) fn ask(&mut self, now_ns: u64) -> Option<Frame> {
        if self.asked_ns.is_some_and(|asked| now_ns.saturating_sub(asked) < PERIOD_NS) {
            return None;
        }
        (self.asked_ns, self.n_open) = (Some(now_ns), self.n_open.saturating_add(1));
        self.frame()
    }

    /// Takes the answer; false for feedback.
    pub(super) fn answers(&mut self, bytes: [u8; 8]) -> bool {
        let [_, a, b, c, d, e, f, g] = bytes;
        let is_word = [e, f, g] == [0; 3] && (a == 0 || d == 0);
        let is_answer = self.n_open > 0 && ([a, b, c, d] == [0; 4] || is_word);
        if is_answer {
            self.n_open -= 1;
            self.fault = u32::from_le_bytes([a, b, c, d]);
        }
        is_answer
    }
}

state!(Question { asked_ns, n_open, fault; id });
