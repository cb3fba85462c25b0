//! A graph of operations on doubles in the order in which they were recorded, each once.

use std::collections::HashMap;

/// A double: an operation's result or a constant, with a sign before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Term {
    /// The bits of a constant.
    Constant(u64),
    /// Node `at`, negated or not.
    Node { at: u32, negated: bool },
}

impl Term {
    pub(crate) fn constant(x: f64) -> Term {
        Term::Constant(x.to_bits())
    }

    pub(crate) fn node(at: u32) -> Term {
        Term::Node { at, negated: false }
    }

    /// The value of a constant.
    pub(crate) fn value(self) -> Option<f64> {
        match self {
            Term::Constant(bits) => Some(f64::from_bits(bits)),
            Term::Node { .. } => None,
        }
    }

    /// The node, without its sign.
    pub(crate) fn at(self) -> Option<u32> {
        match self {
            Term::Constant(_) => None,
            Term::Node { at, .. } => Some(at),
        }
    }

    pub(crate) fn is_negated(self) -> bool {
        matches!(self, Term::Node { negated: true, .. })
    }

    pub(crate) fn negated(self) -> Term {
        match self {
            Term::Constant(bits) => Term::constant(-f64::from_bits(bits)),
            Term::Node { at, negated } => Term::Node { at, negated: !negated },
        }
    }

    /// The node without its sign.
    pub(crate) fn unsigned(self) -> Term {
        if self.is_negated() { self.negated() } else { self }
    }
}

/// a < b or a = b.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Comparison {
    Less(Term, Term),
    Equal(Term, Term),
}

/// One IEEE operation, rounded to nearest, or one of our elementary functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Operation {
    Input(u32),
    Add(Term, Term),
    Multiply(Term, Term),
    Divide(Term, Term),
    /// a b + c, rounded once.
    Fused(Term, Term, Term),
    Root(Term),
    Absolute(Term),
    Sine(Term),
    Cosine(Term),
    /// The angle of the point (second, first).
    Angle(Term, Term),
    Select(Comparison, Term, Term),
}

impl Operation {
    /// The operands.
    pub(crate) fn operands(&self) -> impl Iterator<Item = Term> + use<> {
        use Operation::*;
        let of = |comparison: Comparison| match comparison {
            Comparison::Less(a, b) | Comparison::Equal(a, b) => [Some(a), Some(b)],
        };
        let list = match *self {
            Input(_) => [None; 4],
            Root(a) | Absolute(a) | Sine(a) | Cosine(a) => [Some(a), None, None, None],
            Add(a, b) | Multiply(a, b) | Divide(a, b) | Angle(a, b) => {
                [Some(a), Some(b), None, None]
            }
            Fused(a, b, c) => [Some(a), Some(b), Some(c), None],
            Select(comparison, a, b) => {
                let [x, y] = of(comparison);
                [x, y, Some(a), Some(b)]
            }
        };
        list.into_iter().flatten()
    }
}

/// Conditions under which the recorded numbers are the kernel's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Check {
    /// A comparison of the kernel that came out like this.
    Branch(Comparison, bool),
    /// Neither infinite nor NaN.
    Finite(Term),
    /// At most as large as the double of these bits.
    Bounded(Term, u64),
    /// Not zero: otherwise its sign would matter.
    NotZero(Term),
    /// The angle of the point (second, first) does not hang on the sign of a zero.
    CertainAngle(Term, Term),
}

impl Check {
    pub(crate) fn operands(&self) -> impl Iterator<Item = Term> + use<> {
        let list = match *self {
            Check::Branch(Comparison::Less(a, b) | Comparison::Equal(a, b), _)
            | Check::CertainAngle(a, b) => [Some(a), Some(b)],
            Check::Finite(a) | Check::Bounded(a, _) | Check::NotZero(a) => [Some(a), None],
        };
        list.into_iter().flatten()
    }
}

/// Operations in their order, each once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    pub(crate) operations: Vec<Operation>,
    places: HashMap<Operation, u32>,
}

impl Graph {
    /// The node of an operation, an old one where there is one.
    pub(crate) fn node(&mut self, operation: Operation) -> u32 {
        let next = self.operations.len() as u32;
        *self.places.entry(operation).or_insert_with(|| {
            self.operations.push(operation);
            next
        })
    }

    pub(crate) fn len(&self) -> usize {
        self.operations.len()
    }
}
