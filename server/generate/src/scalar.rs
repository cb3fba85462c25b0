//! A scalar that records each operation on it.
//!
//! A kernel's operations become a graph in which no operation stands twice, constants are
//! folded as the kernel would compute them, and products and sums with zero and one are gone.
//! Each identity that is used holds to the bit for all numbers but for two things, of which
//! account is kept:
//!
//! - **The sign of a zero.** 0 x and x + 0 may leave the other zero than the kernel has. A number
//!   of which this holds is *loose*. No other number ever depends on it but through a quotient, an
//!   angle and an output; there a check is recorded.
//! - **Infinities and NaN.** 0 x is NaN where x is not finite. Such an x is *dropped*; its
//!   finiteness follows from another condition, or is checked.

use core::cmp::Ordering;
use core::ops::{Add, Div, Mul, Neg, Sub};

use sarrus_dynamics::scalar::{BranchValue, Plain, Real, Six};

use crate::graph::{Check, Comparison, Operation, Term};
use crate::recorder::{self, Limited, Obstacle, Record, Traced};

impl Traced {
    pub(crate) const fn constant(value: f64) -> Traced {
        Traced { value, term: Term::constant(value), loose: false }
    }

    /// Number `k` of the input.
    pub(crate) fn input(k: usize, value: f64) -> Traced {
        Traced::new(value, Operation::Input(k as u32), false)
    }

    /// The result of an operation.
    fn new(value: f64, operation: Operation, loose: bool) -> Traced {
        let at = recorder::with(|record| record.node(operation));
        Traced { value, term: Term::node(at), loose }
    }

    /// As [`Traced::new`], and negated if `negated`; `value` is that of the result.
    fn signed(value: f64, operation: Operation, loose: bool, negated: bool) -> Traced {
        if negated {
            -Traced::new(-value, operation, loose)
        } else {
            Traced::new(value, operation, loose)
        }
    }

    /// Where it is a constant, which one.
    fn known(self) -> Option<f64> {
        self.term.value()
    }

    fn is_zero(self) -> bool {
        self.known() == Some(0.0)
    }

    fn loosely(self, loose: bool) -> Traced {
        Traced { loose: self.loose | loose, ..self }
    }

    /// A zero by a product with `x`, which has to be finite.
    fn nothing_of(self) -> Traced {
        recorder::with(|record| record.dropped.extend(self.term.at()));
        Traced::constant(0.0).loosely(true)
    }

    /// The number before a zero was added to it, for operations that do not depend on its sign.
    fn stripped(self) -> Traced {
        let Some(at) = self.term.at() else { return self };
        let inner = recorder::with(|record| match record.operations.get(at as usize) {
            Some(Operation::Add(x @ Term::Node { .. }, Term::Constant(0))) => Some(*x),
            _ => None,
        });
        let signed = |x: Term| if self.term.is_negated() { x.negated() } else { x };
        inner.map_or(self, |x| Traced { term: signed(x), loose: true, ..self })
    }

    /// The operands of a commutative operation in the order of the graph.
    fn sorted(a: Traced, b: Traced) -> (Traced, Traced) {
        let place = |x: Traced| x.term.at().unwrap_or(u32::MAX);
        if place(a) <= place(b) { (a, b) } else { (b, a) }
    }

    /// Records a comparison and returns its outcome.
    fn decided(comparison: Comparison, outcome: bool, may_choose: bool) -> bool {
        recorder::with(|record| record.decide(comparison, outcome, may_choose));
        outcome
    }

    fn less(self, other: Traced, may_choose: bool) -> bool {
        let a = self.stripped();
        let b = other.stripped();
        Traced::decided(Comparison::Less(a.term, b.term), self.value < other.value, may_choose)
    }
}

impl PartialEq for Traced {
    fn eq(&self, other: &Traced) -> bool {
        let a = self.stripped().term;
        let b = other.stripped().term;
        Traced::decided(Comparison::Equal(a, b), self.value == other.value, false)
    }
}

impl PartialOrd for Traced {
    /// Never asked: each comparison below is recorded as itself.
    fn partial_cmp(&self, other: &Traced) -> Option<Ordering> {
        recorder::stop(Obstacle::NotStraight);
        self.value.partial_cmp(&other.value)
    }
    fn lt(&self, other: &Traced) -> bool {
        self.less(*other, false)
    }
    fn gt(&self, other: &Traced) -> bool {
        other.less(*self, false)
    }
    fn le(&self, other: &Traced) -> bool {
        let less = self.less(*other, false);
        less || self == other
    }
    fn ge(&self, other: &Traced) -> bool {
        other.le(self)
    }
}

impl Add for Traced {
    type Output = Traced;
    fn add(self, other: Traced) -> Traced {
        let value = self.value + other.value;
        match (self.known(), other.known()) {
            // of two zeros it is 0 where one of them is
            (Some(a), Some(b)) => {
                let is_sure = |x: Traced| x.value == 0.0 && x.value.is_sign_positive() && !x.loose;
                let is_zero = a == 0.0 && b == 0.0 && (is_sure(self) || is_sure(other));
                let value = if is_zero { 0.0 } else { value };
                Traced::constant(value).loosely(!is_zero && (self.loose | other.loose))
            }
            (Some(_), None) => other + self,
            // x − 0 is x; x + 0 is 0 where x is −0
            (None, Some(0.0)) if other.value.is_sign_negative() && !other.loose => self,
            (None, Some(0.0)) if !other.loose => {
                let x = self.stripped().term;
                Traced::new(value, Operation::Add(x, Term::constant(0.0)), false)
            }
            (None, Some(0.0)) => self.loosely(true),
            _ => {
                let (a, b) = Traced::sorted(self.stripped(), other.stripped());
                Traced::new(value, Operation::Add(a.term, b.term), a.loose | b.loose)
            }
        }
    }
}

impl Sub for Traced {
    type Output = Traced;
    fn sub(self, other: Traced) -> Traced {
        self + -other
    }
}

impl Mul for Traced {
    type Output = Traced;
    fn mul(self, other: Traced) -> Traced {
        let value = self.value * other.value;
        match (self.known(), other.known()) {
            (Some(_), Some(_)) => Traced::constant(value).loosely(self.loose | other.loose),
            (Some(_), None) => other * self,
            (None, Some(0.0)) => self.nothing_of(),
            (None, Some(1.0)) => self,
            (None, Some(-1.0)) => -self,
            _ => {
                let (a, b) = Traced::sorted(self.stripped(), other.stripped());
                // (−a) b = −(a b), and of a constant factor the sign belongs to the constant
                let product = Operation::Multiply(a.term.unsigned(), b.term.unsigned());
                let negated = a.term.is_negated() != b.term.is_negated();
                Traced::signed(value, product, a.loose | b.loose, negated)
            }
        }
    }
}

impl Div for Traced {
    type Output = Traced;
    fn div(self, other: Traced) -> Traced {
        let value = self.value / other.value;
        let a = self.stripped();
        let b = other.stripped();
        match (a.known(), b.known()) {
            (Some(_), Some(_)) => return Traced::constant(value).loosely(a.loose),
            (_, Some(1.0)) => return self,
            (_, Some(-1.0)) => return -self,
            // nothing, divided by something
            (Some(0.0), None) => {
                recorder::check(Check::NotZero(b.term));
                return b.nothing_of();
            }
            // the quotient by a power of two is the product with its inverse
            (None, Some(by)) if is_power_of_two(by) => {
                return self * Traced::constant(1.0 / by);
            }
            _ => {}
        }
        let negated = a.term.is_negated() != b.term.is_negated();
        let quotient = Operation::Divide(a.term.unsigned(), b.term.unsigned());
        let quotient = Traced::signed(value, quotient, a.loose, negated);
        // where the sign of a zero would matter, no quotient is finite
        if b.loose {
            recorder::check(Check::Finite(quotient.term.unsigned()));
        }
        quotient
    }
}

/// ±2^k whose inverse is one too, both normal.
fn is_power_of_two(x: f64) -> bool {
    x.is_normal() && x.to_bits() & ((1 << 52) - 1) == 0 && (1.0 / x).is_normal()
}

impl Neg for Traced {
    type Output = Traced;
    fn neg(self) -> Traced {
        Traced { value: -self.value, term: self.term.negated(), ..self }
    }
}

sarrus_dynamics::assigned!(Traced);

impl Real for Traced {
    type Triple = Plain<Traced>;
    type Symmetric = Six<Traced>;

    const ZERO: Traced = Traced::constant(0.0);
    const ONE: Traced = Traced::constant(1.0);
    const EPSILON: f64 = <f64 as Real>::EPSILON;
    const STRAIGHT: bool = true;
    const RECORDED: bool = true;

    fn from_f64(x: f64) -> Traced {
        Traced::constant(x)
    }
    fn mul_add(self, a: Traced, b: Traced) -> Traced {
        let [x, y, c] = [self, a, b];
        let value = f64::mul_add(x.value, y.value, c.value);
        match (x.known(), y.known()) {
            (Some(_), None) => return y.mul_add(x, c),
            (Some(p), Some(q)) => {
                let product = p * q;
                if c.known().is_some() {
                    return Traced::constant(value).loosely(x.loose | y.loose | c.loose);
                }
                // an exact product is rounded once in the sum
                if f64::mul_add(p, q, -product) == 0.0 && (product.is_normal() || product == 0.0) {
                    return Traced::constant(product).loosely(x.loose | y.loose) + c;
                }
            }
            (None, Some(0.0)) => return x.nothing_of() + c,
            (None, Some(1.0)) => return x + c,
            (None, Some(-1.0)) => return -x + c,
            _ => {}
        }
        // x y − 0 is x y; x y + 0 is 0 where x y is −0
        if c.is_zero() {
            let loose = c.loose || c.value.is_sign_positive();
            return (x * y).loosely(loose);
        }
        let (a, b) = Traced::sorted(x.stripped(), y.stripped());
        let c = c.stripped();
        let negated = a.term.is_negated() != b.term.is_negated();
        let p = a.term.unsigned();
        let q = b.term.unsigned();
        // a sign before the product belongs to its constant, if it has one
        let (p, q) = match q {
            _ if !negated => (p, q),
            Term::Constant(_) => (p, q.negated()),
            Term::Node { .. } => (p.negated(), q),
        };
        let loose = a.loose | b.loose | c.loose;
        Traced::new(value, Operation::Fused(p, q, c.term), loose)
    }
    fn sqrt(self) -> Traced {
        match self.known() {
            Some(x) => Traced::constant(x.sqrt()).loosely(self.loose),
            None => {
                let x = self.stripped();
                Traced::new(self.value.sqrt(), Operation::Root(x.term), x.loose)
            }
        }
    }
    fn abs(self) -> Traced {
        match self.known() {
            Some(x) => Traced::constant(x.abs()),
            None => {
                let x = self.stripped().term.unsigned();
                Traced::new(self.value.abs(), Operation::Absolute(x), false)
            }
        }
    }
    fn sin_cos(self) -> (Traced, Traced) {
        let (s, c) = Real::sin_cos(self.value);
        if self.known().is_some() {
            return (Traced::constant(s).loosely(self.loose), Traced::constant(c));
        }
        // sin(−x) = −sin x and cos(−x) = cos x to the bit
        let x = self.stripped();
        let of = x.term.unsigned();
        let sine = Traced::signed(s, Operation::Sine(of), x.loose, x.term.is_negated());
        (sine, Traced::new(c, Operation::Cosine(of), false))
    }
    fn atan2(self, x: Traced) -> Traced {
        let value = Real::atan2(self.value, x.value);
        let a = self.stripped();
        let b = x.stripped();
        if a.known().is_some() && b.known().is_some() && !a.loose && !b.loose {
            return Traced::constant(value);
        }
        if a.loose | b.loose {
            recorder::check(Check::CertainAngle(a.term, b.term));
        }
        Traced::new(value, Operation::Angle(a.term, b.term), a.loose)
    }
    fn lt(self, other: Traced) -> bool {
        self.less(other, true)
    }
    fn is_finite(self) -> bool {
        if self.known().is_none() {
            recorder::check(Check::Finite(self.stripped().term.unsigned()));
        }
        self.value.is_finite()
    }
    fn is_always_zero(self) -> bool {
        self.is_zero()
    }
    fn select(condition: bool, a: Traced, b: Traced) -> Traced {
        let comparison = recorder::with(|record| record.choice(condition));
        let value = if condition { a.value } else { b.value };
        match comparison {
            // of constants, or between two that are the same
            Some((Term::Constant(_), Term::Constant(_))) | None => {
                if condition {
                    a
                } else {
                    b
                }
            }
            Some(_) if a.term == b.term => a.loosely(b.loose),
            Some((x, y)) => {
                let operation = Operation::Select(x, y, a.term, b.term);
                Traced::new(value, operation, a.loose | b.loose)
            }
        }
    }
    /// Only constants: values that leave the kernels otherwise are no longer recorded.
    fn to_f64(self) -> f64 {
        if self.known().is_none() {
            recorder::stop(Obstacle::NotStraight);
        }
        self.value
    }

    fn to_branch_value(self, figure: BranchValue) -> f64 {
        let known = self.known();
        let x = self.stripped().term;
        recorder::with(|record: &mut Record| match figure {
            BranchValue::Gain => record.gains.push(self),
            BranchValue::Growth => record.growths.push(self),
            BranchValue::Limited { lower, upper } => {
                if known.is_none() {
                    record.limited.push(Limited { x, lower, upper });
                }
            }
            BranchValue::OfDoubt => {}
        });
        self.value
    }
}
