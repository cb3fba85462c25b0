//! The damper of a motor that follows torques, at the bridge's rate.

use crate::state::state;

/// Watches a damper at the bridge's rate, and weakens it until it damps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chatter {
    /// Factor of spring and damper, from 1 down.
    gain: f64,
    /// Greatest effort of the damper since the last change of its sign, and between the two changes
    /// before that `[N m, N]`.
    peaks: [f64; 2],
    /// The effort of the last cycle `[N m, N]`.
    last: f64,
    /// Cycles since the last change of sign.
    n_cycles: u32,
}

impl Default for Chatter {
    fn default() -> Chatter {
        Chatter { gain: 1.0, peaks: [0.0, f64::INFINITY], last: 0.0, n_cycles: 0 }
    }
}

impl Chatter {
    /// Whether the damper was weakened.
    pub(super) fn is_weakened(&self) -> bool {
        self.gain < 1.0
    }

    /// Longer half waves, in cycles, do not come from a delay of one or two cycles.
    const CYCLES: u32 = 8;
    /// Half waves that shrink by this factor or more are damped.
    const DECAY: f64 = 0.5;
    /// Half waves below this part of the greatest effort are noise.
    const NOISE: f64 = 0.1;

    /// Takes the damper's effort and returns the part of it to apply.
    pub(super) fn gain(&mut self, effort: f64, most: f64) -> f64 {
        let effort = self.gain * effort;
        self.n_cycles += 1;
        if effort * self.last < 0.0 {
            let [peak, before] = self.peaks;
            let is_large = peak > Self::NOISE * most && peak > Self::DECAY * before.min(most);
            if is_large && self.n_cycles <= Self::CYCLES {
                self.gain *= 0.5;
            }
            (self.peaks, self.n_cycles) = ([0.0, peak], 0);
        }
        if effort != 0.0 {
            self.last = effort;
        }
        self.peaks[0] = self.peaks[0].max(effort.abs());
        self.gain
    }
}

state!(Chatter { gain, peaks, last, n_cycles });
