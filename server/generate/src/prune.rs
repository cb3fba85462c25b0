//! Keeps the operations on which outputs and checks depend, and the checks that do not follow from
//! others.

use std::collections::{HashMap, HashSet};

use crate::graph::{Check, Comparison, Term};
use crate::row::Row;
use crate::{Kernel, bound};

/// The kernel without the rest, and with bounds that keep each dropped number finite.
pub(crate) fn pruned(mut kernel: Kernel, dropped: &[u32]) -> Kernel {
    let mut seen = HashSet::new();
    kernel.checks.retain(|check| !is_certain(check) && seen.insert(*check));
    bound::bound(&mut kernel, dropped);
    keep_strongest_bounds(&mut kernel);
    keep_live(&mut kernel);
    kernel
}

impl Kernel {
    /// The operations without the conditions under which their numbers are the plan's. It serves
    /// only to measure the cost of the conditions. Allocates.
    pub fn unchecked(&self) -> Kernel {
        let mut kernel = Kernel { checks: Vec::new(), limited: Vec::new(), ..self.clone() };
        keep_live(&mut kernel);
        kernel
    }
}

/// True where a check is one of constants, and holds.
fn is_certain(check: &Check) -> bool {
    let value = |x: Term| x.value().unwrap_or(f64::NAN);
    check.operands().all(|x| x.value().is_some()) && Row::of(check).holds(value)
}

/// Leaves out lower bounds of a number that has a greater one; a positive number is not zero.
fn keep_strongest_bounds(kernel: &mut Kernel) {
    let bound = |check: &Check| match *check {
        Check::Branch(Comparison::Less(x @ Term::Node { .. }, c), false) => Some((x, c.value()?)),
        _ => None,
    };
    let mut greatest: HashMap<Term, f64> = HashMap::new();
    for (x, c) in kernel.checks.iter().filter_map(bound) {
        let most = greatest.entry(x).or_insert(c);
        *most = most.max(c);
    }
    // numbers that are compared with zero as positive
    let positive: HashSet<Term> = kernel
        .checks
        .iter()
        .filter_map(|check| match *check {
            Check::Branch(Comparison::Less(c, x), true) if c.value() >= Some(0.0) => Some(x),
            _ => None,
        })
        .collect();
    kernel.checks.retain(|check| match check {
        Check::NotZero(x) => {
            !positive.contains(x) && greatest.get(x).is_none_or(|most| *most <= 0.0)
        }
        _ => bound(check).is_none_or(|(x, c)| greatest.get(&x) == Some(&c)),
    });
}

/// Leaves out operations without users and renumbers the rest.
fn keep_live(kernel: &mut Kernel) {
    let mut live = vec![false; kernel.operations.len()];
    let mut needs = |term: Term| term.at().into_iter().for_each(|at| live[at as usize] = true);
    kernel.outputs.iter().copied().for_each(&mut needs);
    kernel.checks.iter().flat_map(|check| check.operands()).for_each(&mut needs);
    kernel.limited.iter().for_each(|limited| needs(limited.x));
    for at in (0..kernel.operations.len()).rev() {
        if live[at] {
            let operands = kernel.operations[at].operands();
            operands.filter_map(Term::at).for_each(|at| live[at as usize] = true);
        }
    }

    let mut next = 0;
    let mut places = vec![0; live.len()];
    for (place, live) in places.iter_mut().zip(&live) {
        *place = next;
        next += u32::from(*live);
    }
    let moved = |term: Term| match term {
        Term::Constant(_) => term,
        Term::Node { at, negated } => Term::Node { at: places[at as usize], negated },
    };
    let mut kept = live.iter();
    kernel.operations.retain(|_| kept.next().copied().unwrap_or(false));
    kernel.operations.iter_mut().for_each(|operation| *operation = operation.map(moved));
    kernel.outputs.iter_mut().for_each(|term| *term = moved(*term));
    kernel.limited.iter_mut().for_each(|limited| limited.x = moved(limited.x));
    kernel.checks.iter_mut().for_each(|check| *check = check.map(moved));
}
