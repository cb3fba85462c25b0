//! Bounds of inputs and operands, from which numbers are known to be finite.
//!
//! A product with zero may be left out where the other factor is finite. Checking every such factor
//! would cost more than the omission saves and would keep unused numbers alive. So inputs are
//! bounded, and quotients and roots, which may have any size; sums and products of bounded numbers
//! are bounded too. Where bounds multiply beyond the largest double, a further check cuts them off.

use crate::Kernel;
use crate::graph::{Check, Operation, Term};

/// Bound of an input: a robot of other sizes is left to the generic kernel.
const INPUT: f64 = 1e9;
/// Bound of a quotient, a root, and a number that is cut off.
const CUT: f64 = 1e12;
/// Numbers of which this is a bound have no rounding that makes them infinite.
const MOST: f64 = 1e300;
/// Bound of an angle that has a sine.
const ANGLE: f64 = 3e13;

/// Replaces the checks that numbers are finite, and adds those that make the dropped ones so.
pub(crate) fn bound(kernel: &mut Kernel, dropped: &[u32]) {
    let mut needed = vec![false; kernel.operations.len()];
    dropped.iter().for_each(|at| needed[*at as usize] = true);
    kernel.checks.retain(|check| match check {
        Check::Finite(Term::Node { at, .. }) => {
            needed[*at as usize] = true;
            false
        }
        _ => true,
    });
    for at in (0..needed.len()).rev().filter(|at| needed[*at]).collect::<Vec<_>>() {
        mark(&kernel.operations, at, &mut needed);
    }
    let mut bounds = vec![f64::INFINITY; needed.len()];
    for at in 0..needed.len() {
        if !needed[at] {
            continue;
        }
        let operation = kernel.operations[at];
        // where bounds multiply beyond all doubles it is the largest operand that is cut off:
        // others are computed from it too
        while natural(&operation, &bounds).is_some_and(|bound| bound > MOST) {
            let of = |x: &Term| x.at().map_or(0.0, |at| bounds[at as usize]);
            let largest = operation.operands().max_by(|a, b| of(a).total_cmp(&of(b)));
            let Some(x) = largest.filter(|x| of(x) > CUT) else { break };
            x.at().into_iter().for_each(|at| bounds[at as usize] = CUT);
            kernel.checks.push(Check::Bounded(x.unsigned(), CUT.to_bits()));
        }
        bounds[at] = match natural(&operation, &bounds) {
            Some(bound) if bound <= MOST => bound,
            _ => {
                let bound = if matches!(operation, Operation::Input(_)) { INPUT } else { CUT };
                let x = Term::node(at as u32);
                kernel.checks.push(Check::Bounded(x, f64::to_bits(bound)));
                bound
            }
        };
        // an angle that is too large has no sine
        if let Operation::Sine(x) | Operation::Cosine(x) = operation
            && let Some(of) = x.at()
            && bounds[of as usize] > ANGLE
        {
            bounds[of as usize] = CUT;
            kernel.checks.push(Check::Bounded(x.unsigned(), CUT.to_bits()));
        }
    }
}

/// Marks all that a number is computed from.
fn mark(operations: &[Operation], at: usize, needed: &mut [bool]) {
    let mut open = vec![at];
    while let Some(at) = open.pop() {
        for operand in operations[at].operands().filter_map(Term::at) {
            if !std::mem::replace(&mut needed[operand as usize], true) {
                open.push(operand as usize);
            }
        }
    }
}

/// The bound that follows from those of the operands, if one does.
fn natural(operation: &Operation, bounds: &[f64]) -> Option<f64> {
    use Operation::*;
    let of = |term: Term| match term {
        Term::Constant(bits) => f64::from_bits(bits).abs(),
        Term::Node { at, .. } => bounds[at as usize],
    };
    match *operation {
        Input(_) | Root(_) => None,
        Add(a, b) => Some(of(a) + of(b)),
        Multiply(a, b) => Some(of(a) * of(b)),
        Fused(a, b, c) => Some(of(a) * of(b) + of(c)),
        Divide(a, Term::Constant(by)) if f64::from_bits(by) != 0.0 => {
            Some(of(a) / f64::from_bits(by).abs())
        }
        Divide(..) => None,
        Absolute(a) => Some(of(a)),
        Sine(_) | Cosine(_) => Some(1.0),
        Angle(..) => Some(4.0),
        Select(_, _, a, b) => Some(of(a).max(of(b))),
    }
}
