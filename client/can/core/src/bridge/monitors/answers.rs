//! More answers than requests: two motors on one identifier.
//!
//! Of a motor that answers each cycle with one measurement, requests and answers are counted. An
//! answer that is late comes together with the next one and finds its request still open; one that
//! finds none is too many, unless there were other frames in that cycle or the one before that the
//! motor may have answered alike. As each second of two is, three are soon there; single ones are
//! forgotten at one in 16 requests. So are open requests where no pause (`age`) can forgive them.

use crate::config::MonitorBounds;

/// One answer too many is forgotten after so many requests.
const FORGOTTEN: u32 = 16;
/// More open requests than this are lost ones, or those of a motor that is late.
const MOST: u32 = 1 << 16;

#[derive(Clone, Copy, Debug, Default)]
pub(in crate::bridge) struct Answers {
    /// Requests without an answer.
    pub(super) open: u32,
    /// Frames besides them in the last two cycles.
    others: [usize; 2],
    too_many: u32,
    n_requests: u32,
}

impl Answers {
    /// So many frames go out, one of which a measurement answers.
    pub(in crate::bridge) fn ask(&mut self, n_frames: usize, is_forgotten: bool) {
        let [last, _] = self.others;
        self.others = [n_frames.saturating_sub(1), last];
        self.open = (self.open + 1).min(MOST);
        self.n_requests += 1;
        if self.n_requests == FORGOTTEN {
            self.n_requests = 0;
            self.too_many = self.too_many.saturating_sub(1);
            if is_forgotten && self.open > 1 {
                self.open -= 1;
            }
        }
    }

    /// A measurement came.
    pub(in crate::bridge) fn take(&mut self) {
        if self.open > 0 {
            self.open -= 1;
        } else if let Some(others) = self.others.iter_mut().find(|others| **others > 0) {
            *others -= 1;
        } else {
            self.too_many = self.too_many.saturating_add(1);
        }
    }

    /// Requests that are open now are never answered.
    pub(in crate::bridge) fn forgive(&mut self) {
        self.open = 0;
    }

    pub(super) fn is_second(&self, bounds: &MonitorBounds) -> bool {
        f64::from(self.too_many) >= bounds.second_answer
    }
}
