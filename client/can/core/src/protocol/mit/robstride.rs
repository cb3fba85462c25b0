//! Faults of a RobStride in MIT mode: its feedback has no room for them, so it is asked.
//!
//! Source: RobStride 00 manual, "MIT protocol", command 5. FF ×6, any byte but FF, FB asks; the
//! answer has the identifier of feedback: the motor's id and 32 bits. Feedback of the same bytes
//! would be that of a motor at 0.0 °C with a torque code that ends in 00, or at the lower end of
//! position, velocity and torque at once: while an answer is awaited both are taken for it.

use crate::frame::{Frame, Id};

/// Time between two questions `[ns]`.
pub(super) const PERIOD_NS: u64 = 20_000_000;

#[derive(Clone, Copy, Debug)]
pub(super) struct Question {
    id: u16,
    asked_ns: Option<u64>,
    is_open: bool,
    /// As last answered; 0 without one.
    pub(super) fault: u32,
}

impl Question {
    pub(super) fn new(id: u16) -> Question {
        Question { id, asked_ns: None, is_open: false, fault: 0 }
    }

    /// Nothing is known, and it is asked at once.
    pub(super) fn forget(&mut self) {
        *self = Question::new(self.id);
    }

    pub(super) fn frame(&self) -> Option<Frame> {
        Frame::classic(Id::Standard(self.id), &[0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x00, 0xFB])
    }

    /// The question, when it is time for it.
    pub(super) fn ask(&mut self, now_ns: u64) -> Option<Frame> {
        if self.asked_ns.is_some_and(|asked| now_ns.saturating_sub(asked) < PERIOD_NS) {
            return None;
        }
        (self.asked_ns, self.is_open) = (Some(now_ns), true);
        self.frame()
    }

    /// Takes the answer; false for feedback.
    pub(super) fn answers(&mut self, bytes: [u8; 8]) -> bool {
        let [_, a, b, c, d, e, f, g] = bytes;
        let is_answer = self.is_open && ([a, b, c, d] == [0; 4] || [e, f, g] == [0; 3]);
        if is_answer {
            self.is_open = false;
            self.fault = u32::from_le_bytes([a, b, c, d]);
        }
        is_answer
    }
}
