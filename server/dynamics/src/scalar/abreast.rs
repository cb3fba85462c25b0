//! A number of several states that take the same branches of a plan.
//!
//! Kernels run over [`Lanes`] as they run over `f64`. The outcome of a comparison is that of the
//! first lane, and the lanes in which it comes out otherwise are marked: their state has to be
//! answered alone. So in a lane without a mark every outcome that a kernel holds is the lane's own,
//! whether it branches on it, combines it with others or chooses by it, now or later, and no order
//! of comparisons and choices can give such a lane another number than it has alone.
//! [`Real::select_lt`] compares and chooses at once, lane by lane, and marks none.

use core::cell::Cell;
use core::cmp::Ordering;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::scalar::lanes::{LaneMask, Transposed};
use crate::scalar::{Figure, LANES, Lanes, Plain, Real, Scalar, Six};

/// One bit for each lane.
const ALL: u32 = (1 << LANES) - 1;

/// What one run of this thread knows of its lanes, one bit for each.
struct Run {
    /// Lanes of another decision than the first one's, and those with a number beyond its limits.
    left: Cell<u32>,
    beyond: Cell<u32>,
}

std::thread_local! {
    static RUN: Run = const { Run { left: Cell::new(0), beyond: Cell::new(0) } };
}

/// What became of the lanes of a run, one bit for each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Marks {
    /// Lanes of another decision than the first one's.
    pub(crate) left: u32,
    /// Lanes with a number beyond its limits.
    pub(crate) beyond: u32,
}

impl Marks {
    /// The marks since the last call on this thread, which start from none again.
    pub(crate) fn take() -> Marks {
        RUN.with(|run| Marks { left: run.left.replace(0), beyond: run.beyond.replace(0) })
    }

    /// Marks lanes that decide otherwise than the first one.
    #[inline(always)]
    fn leave(lanes: u32) {
        if lanes != 0 {
            RUN.with(|run| run.left.set(run.left.get() | lanes));
        }
    }
}

/// The lanes in which a comparison comes out otherwise than in the first one.
#[inline(always)]
fn others(mask: LaneMask<LANES>) -> u32 {
    let bits = mask.bits();
    bits ^ if bits & 1 == 0 { 0 } else { ALL }
}

/// The outcome by which a plan goes on.
#[inline(always)]
fn decided(mask: LaneMask<LANES>) -> bool {
    Marks::leave(others(mask));
    mask.bits() & 1 != 0
}

/// A number of [`LANES`] states.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Abreast(Lanes<LANES>);

impl Abreast {
    /// The same in all states.
    #[inline(always)]
    pub(crate) fn splat(x: f64) -> Abreast {
        Abreast(Lanes::splat(x))
    }

    /// Number by number, of each state.
    #[inline(always)]
    pub(crate) fn new(states: [f64; LANES]) -> Abreast {
        Abreast(states.into())
    }

    /// As many numbers as states, given as a row of each state.
    #[inline(always)]
    pub(crate) fn of_rows(rows: [[f64; LANES]; LANES]) -> [Abreast; LANES] {
        Lanes::transposed(rows.map(Lanes::from)).map(Abreast)
    }

    /// The reverse.
    #[inline(always)]
    pub(crate) fn rows(numbers: [Abreast; LANES]) -> [[f64; LANES]; LANES] {
        Lanes::transposed(numbers.map(|x| x.0)).map(Into::into)
    }

    /// The number of each state.
    #[inline(always)]
    pub(crate) fn states(self) -> [f64; LANES] {
        self.0.into()
    }

    #[inline(always)]
    fn first(self) -> f64 {
        self.states()[0]
    }
}

impl PartialEq for Abreast {
    #[inline(always)]
    fn eq(&self, other: &Abreast) -> bool {
        decided(self.0.equal(other.0))
    }
}

impl PartialOrd for Abreast {
    /// Never asked: each comparison below is decided by itself.
    fn partial_cmp(&self, other: &Abreast) -> Option<Ordering> {
        Marks::leave(ALL);
        self.first().partial_cmp(&other.first())
    }
    #[inline(always)]
    fn lt(&self, other: &Abreast) -> bool {
        decided(self.0.lt(other.0))
    }
    #[inline(always)]
    fn gt(&self, other: &Abreast) -> bool {
        decided(other.0.lt(self.0))
    }
    #[inline(always)]
    fn le(&self, other: &Abreast) -> bool {
        decided(self.0.lt(other.0) | self.0.equal(other.0))
    }
    #[inline(always)]
    fn ge(&self, other: &Abreast) -> bool {
        other.le(self)
    }
}

macro_rules! operator {
    ($($trait:ident $function:ident $assign:ident $assigned:ident),*) => {$(
        impl $trait for Abreast {
            type Output = Abreast;
            #[inline(always)]
            fn $function(self, other: Abreast) -> Abreast {
                Abreast($trait::$function(self.0, other.0))
            }
        }

        impl $assign for Abreast {
            #[inline(always)]
            fn $assigned(&mut self, other: Abreast) {
                *self = $trait::$function(*self, other);
            }
        }
    )*};
}

operator!(
    Add add AddAssign add_assign,
    Sub sub SubAssign sub_assign,
    Mul mul MulAssign mul_assign
);

impl Div for Abreast {
    type Output = Abreast;
    #[inline(always)]
    fn div(self, other: Abreast) -> Abreast {
        Abreast(self.0 / other.0)
    }
}

impl Neg for Abreast {
    type Output = Abreast;
    #[inline(always)]
    fn neg(self) -> Abreast {
        Abreast(-self.0)
    }
}

impl Real for Abreast {
    type Mask = bool;
    type Const = Abreast;
    type Triple = Plain<Abreast>;
    type Symmetric = Six<Abreast>;

    const ZERO: Abreast = Abreast(Lanes::ZERO);
    const ONE: Abreast = Abreast(Lanes::ONE);
    const EPSILON: f64 = <f64 as Real>::EPSILON;

    #[inline(always)]
    fn lift(constant: Abreast) -> Abreast {
        constant
    }
    #[inline(always)]
    fn from_f64(x: f64) -> Abreast {
        Abreast::splat(x)
    }
    #[inline(always)]
    fn mul_add(self, a: Abreast, b: Abreast) -> Abreast {
        Abreast(self.0.mul_add(a.0, b.0))
    }
    #[inline(always)]
    fn sqrt(self) -> Abreast {
        Abreast(self.0.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Abreast {
        Abreast(self.0.abs())
    }
    #[inline(never)]
    fn sin_cos(self) -> (Abreast, Abreast) {
        let (s, c) = self.0.sin_cos();
        (Abreast(s), Abreast(c))
    }
    #[inline(never)]
    fn atan2(self, x: Abreast) -> Abreast {
        Abreast(self.0.atan2(x.0))
    }
    #[inline(always)]
    fn lt(self, other: Abreast) -> bool {
        decided(Real::lt(self.0, other.0))
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        decided(self.0.is_finite())
    }
    #[inline(always)]
    fn select(mask: bool, a: Abreast, b: Abreast) -> Abreast {
        if mask { a } else { b }
    }
    #[inline(always)]
    fn select_lt(x: Abreast, y: Abreast, a: Abreast, b: Abreast) -> Abreast {
        Abreast(Lanes::select_lt(x.0, y.0, a.0, b.0))
    }
}

impl Scalar for Abreast {
    const STRAIGHT: bool = true;

    /// What else leaves the kernels is that of the first state.
    #[inline(always)]
    fn to_f64(self) -> f64 {
        let first = self.first();
        Marks::leave(!self.0.equal(Lanes::splat(first)).bits() & ALL);
        first
    }

    /// The largest doubt of all states, so that where one is doubtful all are; a limit is each
    /// state's own.
    #[inline(always)]
    fn to_figure(self, figure: Figure) -> f64 {
        match figure {
            Figure::Gain | Figure::Growth => {
                // which of two is larger says nothing of what is no number
                Marks::leave(!self.0.equal(self.0).bits() & ALL);
                self.states().into_iter().fold(f64::NEG_INFINITY, f64::max)
            }
            Figure::Limited { lower, upper } => {
                let below = Real::lt(self.0, Lanes::splat(lower));
                let above = Real::lt(Lanes::splat(upper), self.0);
                let beyond = (below | above).bits();
                if beyond != 0 {
                    RUN.with(|run| run.beyond.set(run.beyond.get() | beyond));
                }
                // what is no number lies beyond none
                f64::NAN
            }
            Figure::OfDoubt => self.first(),
        }
    }
}
