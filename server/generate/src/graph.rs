//! A graph of operations on doubles in the order in which they were recorded, each once.

/// A double: an operation's result or a constant, with a sign before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Term {
    /// The bits of a constant.
    Constant(u64),
    /// Node `at`, negated or not.
    Node { at: u32, negated: bool },
}

impl Term {
    pub(crate) const fn constant(x: f64) -> Term {
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
    /// The third where the first is less than the second, else the fourth.
    Select(Term, Term, Term, Term),
}

impl Comparison {
    /// The comparison of other operands.
    fn map(self, mut of: impl FnMut(Term) -> Term) -> Comparison {
        match self {
            Comparison::Less(a, b) => Comparison::Less(of(a), of(b)),
            Comparison::Equal(a, b) => Comparison::Equal(of(a), of(b)),
        }
    }
}

impl Operation {
    /// The operation on other operands.
    pub(crate) fn map(self, mut of: impl FnMut(Term) -> Term) -> Operation {
        use Operation::*;
        match self {
            Input(k) => Input(k),
            Add(a, b) => Add(of(a), of(b)),
            Multiply(a, b) => Multiply(of(a), of(b)),
            Divide(a, b) => Divide(of(a), of(b)),
            Fused(a, b, c) => Fused(of(a), of(b), of(c)),
            Root(x) => Root(of(x)),
            Absolute(x) => Absolute(of(x)),
            Sine(x) => Sine(of(x)),
            Cosine(x) => Cosine(of(x)),
            Angle(y, x) => Angle(of(y), of(x)),
            Select(x, y, a, b) => Select(of(x), of(y), of(a), of(b)),
        }
    }

    /// The operands.
    pub(crate) fn operands(&self) -> impl Iterator<Item = Term> + use<> {
        listed(|list| _ = self.map(list)).into_iter().flatten()
    }
}

/// The terms that a `map` visits.
fn listed(visit: impl FnOnce(&mut dyn FnMut(Term) -> Term)) -> [Option<Term>; 4] {
    let mut list = [None; 4];
    let mut places = list.iter_mut();
    visit(&mut |term| {
        places.next().into_iter().for_each(|place| *place = Some(term));
        term
    });
    list
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
    /// The check of other operands.
    pub(crate) fn map(self, mut of: impl FnMut(Term) -> Term) -> Check {
        match self {
            Check::Branch(comparison, outcome) => Check::Branch(comparison.map(of), outcome),
            Check::Finite(x) => Check::Finite(of(x)),
            Check::Bounded(x, bound) => Check::Bounded(of(x), bound),
            Check::NotZero(x) => Check::NotZero(of(x)),
            Check::CertainAngle(y, x) => Check::CertainAngle(of(y), of(x)),
        }
    }

    pub(crate) fn operands(&self) -> impl Iterator<Item = Term> + use<> {
        listed(|list| _ = self.map(list)).into_iter().flatten()
    }
}
