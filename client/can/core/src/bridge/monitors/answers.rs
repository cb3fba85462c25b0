//! More answers than requests: two motors on one identifier.
//!
//! The rule counts requests and answers of a motor that sends one measurement per cycle. A late
//! answer arrives with the next one and finds its request still open. An answer without an open
//! request is surplus, unless the motor may have answered another frame of this or the previous
//! cycle. Two motors on one identifier soon cause three surplus answers, as every second answer is
//! one; single ones expire at one per 16 requests. So do open requests that no pause (`age`) can
//! clear, where lateness does not explain them. Requests that a pause clears may still be answered
//! during the next 16.

use crate::config::MonitorBounds;
use crate::state::state;

/// One surplus answer expires after this many requests.
const FORGOTTEN: u32 = 16;
/// More open requests than this are lost, or the motor is late.
const MOST: u32 = 1 << 16;

#[derive(Clone, Copy, Debug, Default)]
pub(in crate::bridge) struct Answers {
    /// Requests without an answer.
    pub(super) open: u32,
    /// Requests that counted as lost lately and before, whose answers may be held back.
    given_up: [u32; 2],
    /// Other frames in the last two cycles.
    others: [usize; 2],
    too_many: u32,
    n_requests: u32,
}

impl Answers {
    /// Counts sent frames, one of which a measurement answers.
    pub(in crate::bridge) fn ask(&mut self, n_frames: usize, is_forgotten: bool) {
        let [last, _] = self.others;
        self.others = [n_frames.saturating_sub(1), last];
        self.open = (self.open + 1).min(MOST);
        self.n_requests += 1;
        if self.n_requests == FORGOTTEN {
            self.n_requests = 0;
            self.too_many = self.too_many.saturating_sub(1);
            self.given_up = [0, self.given_up[0]];
            if is_forgotten && self.open > 0 {
                self.open -= 1;
            }
        }
    }

    /// A measurement came.
    pub(in crate::bridge) fn take(&mut self) {
        if self.open > 0 {
            self.open -= 1;
        } else if let Some(given_up) = self.given_up.iter_mut().find(|given_up| **given_up > 0) {
            *given_up -= 1;
        } else if let Some(others) = self.others.iter_mut().find(|others| **others > 0) {
            *others -= 1;
        } else {
            self.too_many = self.too_many.saturating_add(1);
        }
    }

    /// Requests that are open now count as lost.
    pub(in crate::bridge) fn forgive(&mut self) {
        let [lately, before] = self.given_up;
        (self.given_up, self.open) = ([lately.max(self.open), before], 0);
    }

    pub(super) fn is_second(&self, bounds: &MonitorBounds) -> bool {
        f64::from(self.too_many) >= bounds.second_answer
    }
}

state!(Answers { open, given_up, others, too_many, n_requests });
