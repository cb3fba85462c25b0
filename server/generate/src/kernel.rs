//! The straight-line code of one query on one robot, before it becomes C.

use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Model, ModelInfo, Plan, Status, Workspace};

use crate::graph::{Check, Operation, Term};
use crate::lengths::Lengths;
use crate::recorder::Limited;
use crate::row::Row;

/// The state of an answer of generated code, by the number that a function returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// The generic kernel's numbers to the bit; its status is `ok`, it has no warnings.
    Ok,
    /// The numbers are the plan's, with the warning `limits_exceeded`.
    LimitsExceeded,
    /// Ask the generic kernel.
    NotAnswered,
}

/// The operations that one query takes on one robot, in their order.
///
/// Wherever [`Kernel::evaluate`] and the C code made from it answer, they give the bits of
/// [`Plan::run`] in `f64`; elsewhere (another branch of a kernel than the traced one, a doubtful
/// answer, a status that is not `ok`) they report that they do not answer.
#[derive(Clone, Debug)]
pub struct Kernel {
    pub(crate) info: ModelInfo,
    pub(crate) plan: Plan,
    pub(crate) operations: Vec<Operation>,
    pub(crate) outputs: Vec<Term>,
    pub(crate) checks: Vec<Check>,
    pub(crate) limited: Vec<Limited>,
    /// Inputs behind all others.
    pub(crate) lengths: Lengths,
    /// The states whose answers are tried in C.
    pub(crate) golden: Vec<Vec<f64>>,
}

impl Kernel {
    /// Arithmetic operations, as the crate `sarrus-counting` counts them; checks are none.
    pub fn operations(&self) -> usize {
        use Operation::*;
        let is_one = |operation: &&Operation| match operation {
            Input(_) | Absolute(_) | Select(..) => false,
            // a sine and its cosine are one
            Cosine(x) => !self.operations.contains(&Sine(*x)),
            _ => true,
        };
        self.operations.iter().filter(is_one).count()
    }

    /// How many numbers go in: the given ones, those that [`Plan::close`] puts behind them, and
    /// lengths.
    pub fn inputs(&self) -> usize {
        self.plan.given().len() + self.plan.closed_len() + self.lengths.values.len()
    }

    /// How many numbers come out.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// How many conditions decide whether the numbers are the kernel's.
    pub fn checks(&self) -> usize {
        self.checks.len()
    }

    /// Computes the operations one by one: slow, for comparisons. The input is the output of
    /// [`Plan::close`]. Outputs are NaN where there is no answer. Allocates.
    pub fn evaluate(&self, input: &[f64], output: &mut [f64]) -> Outcome {
        let mut values: Vec<f64> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let x = apply(operation, input, &values);
            values.push(x);
        }
        let of = |term: Term| number(term, &values);
        if input.len() != self.inputs() || !self.checks.iter().all(|check| Row::of(check).holds(of))
        {
            output.fill(f64::NAN);
            return Outcome::NotAnswered;
        }
        output.iter_mut().zip(&self.outputs).for_each(|(x, term)| *x = of(*term));
        let outside = |limited: &Limited| {
            let x = of(limited.x);
            x < limited.lower || x > limited.upper
        };
        if self.limited.iter().any(outside) { Outcome::LimitsExceeded } else { Outcome::Ok }
    }
}

impl Kernel {
    /// States with their answers for tests: the code that a function returns, its input, and the
    /// numbers of the generic kernel.
    pub(crate) fn answers(
        &self,
        model: &Model<f64>,
    ) -> impl Iterator<Item = (usize, &[f64], Vec<f64>)> {
        let mut workspace = Workspace::for_plans(model, [&self.plan]);
        self.golden.iter().map(move |input| {
            let mut output = vec![0.0; self.outputs()];
            let code = self.evaluate(input, &mut output) as usize;
            let given = &input[..self.plan.given().len()];
            let answer = self.plan.run(model, &mut workspace, given, &mut output);
            debug_assert!(answer.status == Status::Ok);
            (code, &input[..], output)
        })
    }
}

/// The number of a term.
fn number(term: Term, values: &[f64]) -> f64 {
    match term {
        Term::Constant(bits) => f64::from_bits(bits),
        Term::Node { at, negated } => {
            let x = values.get(at as usize).copied().unwrap_or(f64::NAN);
            if negated { -x } else { x }
        }
    }
}

/// The result of one operation.
fn apply(operation: &Operation, input: &[f64], values: &[f64]) -> f64 {
    use Operation::*;
    let of = |term: Term| number(term, values);
    match *operation {
        Input(k) => input.get(k as usize).copied().unwrap_or(f64::NAN),
        Add(a, b) => of(a) + of(b),
        Multiply(a, b) => of(a) * of(b),
        Divide(a, b) => of(a) / of(b),
        Fused(a, b, c) => f64::mul_add(of(a), of(b), of(c)),
        Root(x) => f64::sqrt(of(x)),
        Absolute(x) => f64::abs(of(x)),
        Sine(x) => Real::sin_cos(of(x)).0,
        Cosine(x) => Real::sin_cos(of(x)).1,
        Angle(y, x) => Real::atan2(of(y), of(x)),
        Select(x, y, a, b) => of(if of(x) < of(y) { a } else { b }),
    }
}
