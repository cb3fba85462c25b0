//! A packet: one number for each of several states on the same branches of a plan, one state per
//! register lane.
//!
//! The outcome of a comparison is that of lane 0; the lanes in which it differs are marked, and
//! their states are answered one by one. So in an unmarked lane every outcome is the lane's own,
//! whether a kernel branches, combines or selects by it, and the lane has the bits of its state
//! alone. [`Real::select_lt`] compares and chooses lane by lane and marks none.

use core::cell::Cell;
use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

#[cfg(not(target_feature = "avx512f"))]
use wide::f64x4 as Register;
#[cfg(target_feature = "avx512f")]
use wide::f64x8 as Register;

use crate::scalar::elementary;
use crate::scalar::{BranchValue, Plain, Real, Six};

/// States of a packet: 8 if AVX-512 is compiled for, else 4, in one register or in two.
pub const LANES: usize = if cfg!(target_feature = "avx512f") { 8 } else { 4 };

/// One bit for each lane.
const ALL: u32 = (1 << LANES) - 1;

/// The marks of this thread's run, one bit for each lane, as in [`Divergence`].
struct Run {
    left: Cell<u32>,
    beyond: Cell<u32>,
}

std::thread_local! {
    static RUN: Run = const { Run { left: Cell::new(0), beyond: Cell::new(0) } };
}

/// The lanes of a run that diverged, one bit for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Divergence {
    /// Lanes in which a comparison differs from lane 0.
    pub(crate) left: u32,
    /// Lanes with a number outside its limits.
    pub(crate) beyond: u32,
}

impl Divergence {
    /// The marks since the last call on this thread; clears them.
    pub(crate) fn take() -> Divergence {
        RUN.with(|run| Divergence { left: run.left.replace(0), beyond: run.beyond.replace(0) })
    }

    /// Marks lanes in which a comparison differs from lane 0.
    #[inline(always)]
    fn leave(lanes: u32) {
        if lanes != 0 {
            RUN.with(|run| run.left.set(run.left.get() | lanes));
        }
    }
}

/// The outcome of a comparison in lane 0; marks the lanes in which it differs.
#[inline(always)]
fn decided(mask: Register) -> bool {
    let bits = mask.to_bitmask();
    let outcome = bits & 1 != 0;
    Divergence::leave(bits ^ if outcome { ALL } else { 0 });
    outcome
}

/// A number of [`LANES`] states.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet(Register);

impl Packet {
    /// One number for all states.
    #[inline(always)]
    pub(crate) fn splat(x: f64) -> Packet {
        Packet(Register::splat(x))
    }

    /// Number by number, of each state.
    #[inline(always)]
    pub(crate) fn new(states: [f64; LANES]) -> Packet {
        Packet(Register::new(states))
    }

    /// As many numbers as states, given as a row of each state.
    #[inline(always)]
    pub(crate) fn of_rows(rows: [[f64; LANES]; LANES]) -> [Packet; LANES] {
        Register::transpose(rows.map(Register::new)).map(Packet)
    }

    /// The reverse.
    #[inline(always)]
    pub(crate) fn rows(numbers: [Packet; LANES]) -> [[f64; LANES]; LANES] {
        Register::transpose(numbers.map(|x| x.0)).map(Register::to_array)
    }

    /// The number of each state.
    #[inline(always)]
    pub(crate) fn states(self) -> [f64; LANES] {
        self.0.to_array()
    }

    #[inline(always)]
    fn first(self) -> f64 {
        self.states()[0]
    }
}

impl PartialEq for Packet {
    #[inline(always)]
    fn eq(&self, other: &Packet) -> bool {
        decided(self.0.simd_eq(other.0))
    }
}

impl PartialOrd for Packet {
    /// Never asked: each comparison below is decided by itself.
    fn partial_cmp(&self, other: &Packet) -> Option<Ordering> {
        Divergence::leave(ALL);
        self.first().partial_cmp(&other.first())
    }
    #[inline(always)]
    fn lt(&self, other: &Packet) -> bool {
        decided(self.0.simd_lt(other.0))
    }
    #[inline(always)]
    fn gt(&self, other: &Packet) -> bool {
        decided(other.0.simd_lt(self.0))
    }
    #[inline(always)]
    fn le(&self, other: &Packet) -> bool {
        decided(self.0.simd_lt(other.0) | self.0.simd_eq(other.0))
    }
    #[inline(always)]
    fn ge(&self, other: &Packet) -> bool {
        other.le(self)
    }
}

macro_rules! operator {
    ($($trait:ident $function:ident),*) => {$(
        impl $trait for Packet {
            type Output = Packet;
            #[inline(always)]
            fn $function(self, other: Packet) -> Packet {
                Packet($trait::$function(self.0, other.0))
            }
        }
    )*};
}

operator!(Add add, Sub sub, Mul mul, Div div);
assigned!(Packet);

impl Neg for Packet {
    type Output = Packet;
    #[inline(always)]
    fn neg(self) -> Packet {
        Packet(-self.0)
    }
}

impl Real for Packet {
    type Triple = Plain<Packet>;
    type Symmetric = Six<Packet>;

    const ZERO: Packet = Packet(Register::splat(0.0));
    const ONE: Packet = Packet(Register::splat(1.0));
    const EPSILON: f64 = <f64 as Real>::EPSILON;
    const STRAIGHT: bool = true;
    const UNROLLED: bool = true;

    #[inline(always)]
    fn from_f64(x: f64) -> Packet {
        Packet::splat(x)
    }
    #[inline(always)]
    fn mul_add(self, a: Packet, b: Packet) -> Packet {
        Packet(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Packet {
        Packet(self.0.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Packet {
        Packet(self.0.abs())
    }
    #[inline(never)]
    fn sin_cos(self) -> (Packet, Packet) {
        let (s, c) = elementary::sin_cos(self.0);
        (Packet(s), Packet(c))
    }
    #[inline(never)]
    fn atan2(self, x: Packet) -> Packet {
        Packet(elementary::atan2(self.0, x.0))
    }
    #[inline(always)]
    fn lt(self, other: Packet) -> bool {
        decided(self.0.simd_lt(other.0))
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        decided(self.0.abs().simd_lt(Register::splat(f64::INFINITY)))
    }
    #[inline(always)]
    fn select(condition: bool, a: Packet, b: Packet) -> Packet {
        if condition { a } else { b }
    }
    #[inline(always)]
    fn select_lt(x: Packet, y: Packet, a: Packet, b: Packet) -> Packet {
        Packet(x.0.simd_lt(y.0).select(a.0, b.0))
    }
    /// The number of lane 0; marks the lanes with another.
    #[inline(always)]
    fn to_f64(self) -> f64 {
        let first = self.first();
        Divergence::leave(!self.0.simd_eq(Register::splat(first)).to_bitmask() & ALL);
        first
    }

    /// The largest doubt of all states, so that one doubtful state makes all doubtful; limits are
    /// each state's own.
    #[inline(always)]
    fn to_branch_value(self, value: BranchValue) -> f64 {
        match value {
            BranchValue::Gain | BranchValue::Growth => {
                // a maximum skips NaN
                Divergence::leave(!self.0.simd_eq(self.0).to_bitmask() & ALL);
                self.states().into_iter().fold(f64::NEG_INFINITY, f64::max)
            }
            BranchValue::Limited { lower, upper } => {
                let below = self.0.simd_lt(Register::splat(lower));
                let above = Register::splat(upper).simd_lt(self.0);
                let beyond = (below | above).to_bitmask();
                if beyond != 0 {
                    RUN.with(|run| run.beyond.set(run.beyond.get() | beyond));
                }
                // NaN exceeds no limit
                f64::NAN
            }
            BranchValue::OfDoubt => self.first(),
        }
    }
}
