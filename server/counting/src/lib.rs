#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

use core::cell::Cell;
use core::ops::{Add, Div, Mul, Neg, Sub};

use sarrus_dynamics::scalar::{Plain, Real, Six};
use sarrus_dynamics::{Model, Plan, PlanScalar, Workspace};

/// Operations on numbers in the answer of `plan` to this input; those of the comparison with
/// double-double that a doubtful answer causes are not among them. Allocates a model and a
/// workspace.
pub fn operations(plan: &Plan, model: &Model<f64>, input: &[f64]) -> u64 {
    let counted = model.convert(Counted);
    let mut workspace = Workspace::for_plans(&counted, [plan]);
    let input: Vec<Counted> = input.iter().map(|x| Counted(*x)).collect();
    let mut output = vec![Counted(0.0); plan.want().len()];
    Counted::take();
    let _ = plan.run(&counted, &mut workspace, &input, &mut output);
    Counted::take()
}

std::thread_local! {
    /// Operations of this thread since the last [`Counted::take`].
    static OPERATIONS: Cell<u64> = const { Cell::new(0) };
}

/// A double that counts its operations, on each thread by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
struct Counted(f64);

impl Counted {
    /// The operations of this thread since the last call, which starts from zero again.
    fn take() -> u64 {
        OPERATIONS.replace(0)
    }

    fn after(x: f64) -> Counted {
        OPERATIONS.set(OPERATIONS.get().wrapping_add(1));
        Counted(x)
    }
}

impl Add for Counted {
    type Output = Counted;
    fn add(self, other: Counted) -> Counted {
        Counted::after(self.0 + other.0)
    }
}

impl Sub for Counted {
    type Output = Counted;
    fn sub(self, other: Counted) -> Counted {
        Counted::after(self.0 - other.0)
    }
}

impl Mul for Counted {
    type Output = Counted;
    fn mul(self, other: Counted) -> Counted {
        Counted::after(self.0 * other.0)
    }
}

impl Div for Counted {
    type Output = Counted;
    fn div(self, other: Counted) -> Counted {
        Counted::after(self.0 / other.0)
    }
}

impl Neg for Counted {
    type Output = Counted;
    fn neg(self) -> Counted {
        Counted(-self.0)
    }
}

sarrus_dynamics::assigned!(Counted);

impl PlanScalar for Counted {}

impl Real for Counted {
    type Triple = Plain<Counted>;
    type Symmetric = Six<Counted>;

    const ZERO: Counted = Counted(0.0);
    const ONE: Counted = Counted(1.0);
    const EPSILON: f64 = <f64 as Real>::EPSILON;
    const UNROLLED: bool = true;

    fn from_f64(x: f64) -> Counted {
        Counted(x)
    }
    fn mul_add(self, a: Counted, b: Counted) -> Counted {
        Counted::after(f64::mul_add(self.0, a.0, b.0))
    }
    fn sqrt(self) -> Counted {
        Counted::after(f64::sqrt(self.0))
    }
    fn abs(self) -> Counted {
        Counted(f64::abs(self.0))
    }
    fn sin_cos(self) -> (Counted, Counted) {
        let (s, c) = Real::sin_cos(self.0);
        (Counted::after(s), Counted(c))
    }
    fn atan2(self, x: Counted) -> Counted {
        Counted::after(Real::atan2(self.0, x.0))
    }
    fn lt(self, other: Counted) -> bool {
        self.0 < other.0
    }
    fn is_finite(self) -> bool {
        f64::is_finite(self.0)
    }
    fn select(condition: bool, a: Counted, b: Counted) -> Counted {
        if condition { a } else { b }
    }
    fn to_f64(self) -> f64 {
        self.0
    }

    /// Not counted: it belongs to writing an answer.
    fn plus_zero(self) -> Self {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_is_counted_and_nothing_else() {
        let a = Counted(0.3);
        let b = Counted(-2.0);
        Counted::take();
        let _ = a + b * a - a / b;
        let _ = a.mul_add(b, a).sqrt().atan2(b);
        let _ = a.sin_cos();
        assert_eq!(Counted::take(), 8);
        let _ = (-a, b.abs(), a.lt(b), Counted::select(true, a, b));
        assert_eq!(Counted::take(), 0);
    }
}
