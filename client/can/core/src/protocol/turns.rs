//! Unwraps the positions of motors beyond their protocol's range.

use super::fault;
use crate::drive::Mode;
use crate::state::state;

/// Unwraps a code that wraps around.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unwrapped {
    /// Number of codes, and the longest forward step from one to the next.
    n_codes: i64,
    longest: i64,
    /// The last code, wrapped and unwrapped.
    last: Option<(i64, i64)>,
}

impl Unwrapped {
    pub(super) const fn new(n_codes: i64, longest: i64) -> Unwrapped {
        Unwrapped { n_codes, longest, last: None }
    }

    /// The unwrapped code: the step from the last one is the shorter of the two. The first code is
    /// unchanged.
    #[inline]
    pub(super) fn follow(&mut self, code: i64) -> i64 {
        let whole = self.last.map_or(code, |(last, whole)| {
            let way = code - last;
            if way > self.longest - self.n_codes && way <= self.longest {
                return whole + way;
            }
            let way = way.rem_euclid(self.n_codes);
            whole + if way > self.longest { way - self.n_codes } else { way }
        });
        self.last = Some((code, whole));
        whole
    }

    /// The last unwrapped code.
    #[inline]
    pub(super) fn whole(&self) -> Option<i64> {
        self.last.map(|(_, whole)| whole)
    }

    /// The next code counts as it is.
    pub(super) fn forget(&mut self) {
        self.last = None;
    }
}

/// A 16 bit code that is followed across its ends, where it begins again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Turns {
    code: Unwrapped,
    /// It was outside its range when it was forgotten: its count of turns is lost.
    uncounted: bool,
}

impl Default for Turns {
    fn default() -> Turns {
        Turns { code: Unwrapped::new(1 << 16, i64::from(i16::MAX)), uncounted: false }
    }
}

impl Turns {
    /// The code without jumps.
    pub(super) fn follow(&mut self, code: u16) -> i64 {
        self.code.follow(i64::from(code))
    }

    /// The motor may start counting again. Where it was outside its range, no reset makes its
    /// position right: only a new zero does, which begins with new turns.
    pub(super) fn forget(&mut self) {
        self.uncounted |= self.is_outside();
        self.code.forget();
    }

    /// [`fault::OUT_OF_RANGE`] where set-points of a mode have no code, or the position is not
    /// known; else 0.
    pub(super) fn fault(&self, mode: Mode) -> u32 {
        let is_fault = self.uncounted || mode != Mode::Torque && self.is_outside();
        fault::when(is_fault, fault::OUT_OF_RANGE)
    }

    /// A motor that does not begin again stays at the end's code.
    fn is_outside(&self) -> bool {
        self.code.whole().is_some_and(|whole| whole <= 0 || whole >= i64::from(u16::MAX))
    }
}

state!(Unwrapped { last; n_codes, longest });
state!(Turns { code, uncounted });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_followed_over_both_ends() {
        let mut turns = Turns::default();
        let codes =
            [65_000_u16, 65_500, 300, 10_000, 40_000, 60_000, 20_000, 60_000, 20_000, 65_000];
        let whole: Vec<i64> = codes.iter().map(|code| turns.follow(*code)).collect();
        assert_eq!(
            whole,
            [65_000, 65_500, 65_836, 75_536, 105_536, 125_536, 151_072, 125_536, 151_072, 130_536]
        );
    }

    #[test]
    fn a_position_outside_is_a_fault_and_not_known_after_a_silence() {
        let mut turns = Turns::default();
        [60_000_u16, 65_000, 100].into_iter().for_each(|code| {
            turns.follow(code);
        });
        assert_eq!(
            (turns.fault(Mode::Torque), turns.fault(Mode::Impedance)),
            (0, fault::OUT_OF_RANGE)
        );
        turns.forget();
        turns.follow(100);
        assert_eq!(turns.fault(Mode::Torque), fault::OUT_OF_RANGE);
        turns.forget();
        turns.follow(30_000);
        assert_eq!(turns.fault(Mode::Torque), fault::OUT_OF_RANGE);
    }
}
