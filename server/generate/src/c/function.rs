//! `NAME.c`.
//!
//! Sines and arc tangents, where there are several, are one loop over an array whose length is a
//! multiple of four, so that compilers make vectors of it. Checks do not gain by that.

use std::collections::HashMap;
use std::fmt::Write as _;

use crate::c::literal;
use crate::graph::{Check, Comparison, Operation, Term};
use crate::{Kernel, Manifest};

/// Numbers in a vector.
const LANES: usize = 4;
/// From how many on a loop is faster: what fills the vector is computed too.
const WORTH: usize = 3;

/// The function of a kernel.
pub(super) fn function(kernel: &Kernel, name: &str) -> String {
    let mut text = format!(
        "/* {name}: straight-line code, see {name}.h. Compile with\n   {} (or another baseline). \
         */\n#include \"{name}.h\"\n\n#include <math.h>\n#include <stdint.h>\n#include \
         <string.h>\n\n",
        crate::FLAGS.join(" ")
    );
    text += include_str!("elementary.c");
    let has = |is: fn(&Operation) -> bool| kernel.operations.iter().any(is);
    if has(|operation| matches!(operation, Operation::Sine(_) | Operation::Cosine(_))) {
        text += include_str!("sin_cos.c");
    }
    if has(|operation| matches!(operation, Operation::Angle(..))) {
        text += include_str!("atan2.c");
    }
    text += &format!("\nint {name}(const double *in, double *out)\n{{\n");
    if kernel.plan.given().is_empty() {
        text += "    (void)in;\n";
    }
    Body { kernel, text: &mut text, angles: HashMap::new(), late: late_angles(kernel) }.write();
    text += "}\n";
    text += &Manifest::of(kernel, name).c();
    text
}

/// The arc tangents of which no operation is made.
fn late_angles(kernel: &Kernel) -> Vec<u32> {
    let mut used = vec![false; kernel.operations.len()];
    let operands = kernel.operations.iter().flat_map(Operation::operands);
    operands.filter_map(Term::at).for_each(|at| used[at as usize] = true);
    let is_late = |(at, operation): (usize, &Operation)| {
        (matches!(operation, Operation::Angle(..)) && !used[at]).then_some(at as u32)
    };
    let late: Vec<u32> = kernel.operations.iter().enumerate().filter_map(is_late).collect();
    if late.len() < WORTH { Vec::new() } else { late }
}

/// The statements of the function.
struct Body<'a> {
    kernel: &'a Kernel,
    text: &'a mut String,
    /// Where the sine and cosine of an angle stand.
    angles: HashMap<Term, String>,
    /// Arc tangents that are computed together.
    late: Vec<u32>,
}

impl Body<'_> {
    fn write(&mut self) {
        let operations = &self.kernel.operations;
        // inputs and, in one loop, the sines and cosines of those that are angles
        for (at, operation) in operations.iter().enumerate() {
            if let Operation::Input(k) = operation {
                self.line(format!("const double v{at} = in[{k}];"));
            }
        }
        self.angles_of_inputs();
        for (at, operation) in operations.iter().enumerate() {
            if !self.late.contains(&(at as u32)) {
                self.operation(at, operation);
            }
        }
        self.late_angles();
        self.checks();
        self.limits();
        self.outputs();
    }

    fn line(&mut self, line: impl AsRef<str>) {
        // a string takes whatever is written to it
        let _ = writeln!(self.text, "    {}", line.as_ref());
    }

    /// An array of whole vectors, filled up; how many it holds.
    fn array(&mut self, head: &str, list: &[String], filling: &str) -> usize {
        let count = list.len().div_ceil(LANES) * LANES;
        let filling = std::iter::repeat_n(filling, count - list.len());
        let all: Vec<&str> = list.iter().map(String::as_str).chain(filling).collect();
        self.line(format!("{head}[{count}] = {{"));
        for row in all.chunks(LANES) {
            self.line(format!("    {},", row.join(", ")));
        }
        self.line("};");
        count
    }

    fn angles_of_inputs(&mut self) {
        let operations = &self.kernel.operations;
        let is_input = |term: &Term| {
            let operation = term.at().and_then(|at| operations.get(at as usize));
            matches!(operation, Some(Operation::Input(_)))
        };
        let mut list: Vec<Term> = Vec::new();
        for operation in operations {
            if let Operation::Sine(x) | Operation::Cosine(x) = operation
                && is_input(x)
                && !list.contains(x)
            {
                list.push(*x);
            }
        }
        if list.len() < WORTH {
            return;
        }
        let names: Vec<String> = list.iter().map(|x| number(*x)).collect();
        let count = self.array("const double angle", &names, "0.0");
        self.line(format!("double sine[{count}], cosine[{count}];"));
        self.line(format!("for (int k = 0; k < {count}; k++)"));
        self.line("    sarrus_sin_cos(angle[k], &sine[k], &cosine[k]);");
        for (k, x) in list.into_iter().enumerate() {
            self.angles.insert(x, format!("[{k}]"));
        }
    }

    fn operation(&mut self, at: usize, operation: &Operation) {
        use Operation::*;
        let n = number;
        let value = match *operation {
            Input(_) => return,
            Add(a, b) => match b {
                Term::Node { negated: true, .. } => format!("{} - {}", n(a), n(b.negated())),
                _ => format!("{} + {}", n(a), n(b)),
            },
            Multiply(a, b) => format!("{} * {}", n(a), n(b)),
            Divide(a, b) => format!("{} / {}", n(a), n(b)),
            Fused(a, b, c) => format!("fma({}, {}, {})", n(a), n(b), n(c)),
            Root(x) => format!("sqrt({})", n(x)),
            Absolute(x) => format!("fabs({})", n(x)),
            Sine(x) => format!("sine{}", self.angle(x)),
            Cosine(x) => format!("cosine{}", self.angle(x)),
            Angle(y, x) => format!("sarrus_atan2({}, {})", n(y), n(x)),
            Select(comparison, a, b) => {
                format!("{} ? {} : {}", compared(comparison), n(a), n(b))
            }
        };
        self.line(format!("const double v{at} = {value};"));
    }

    /// Where sine and cosine of an angle stand; they are computed at its first use.
    fn angle(&mut self, x: Term) -> String {
        if let Some(place) = self.angles.get(&x) {
            return place.clone();
        }
        let place = format!("_{}", x.at().unwrap_or_default());
        self.line(format!("double sine{place}, cosine{place};"));
        self.line(format!("sarrus_sin_cos({}, &sine{place}, &cosine{place});", number(x)));
        self.angles.insert(x, place.clone());
        place
    }

    fn late_angles(&mut self) {
        let points =
            self.late.iter().filter_map(|at| match self.kernel.operations.get(*at as usize) {
                Some(Operation::Angle(y, x)) => Some((number(*y), number(*x))),
                _ => None,
            });
        let (y, x): (Vec<String>, Vec<String>) = points.unzip();
        if y.is_empty() {
            return;
        }
        self.array("const double angle_y", &y, "0.0");
        let count = self.array("const double angle_x", &x, "1.0");
        self.line(format!("double turn[{count}];"));
        self.line(format!("for (int k = 0; k < {count}; k++)"));
        self.line("    turn[k] = sarrus_atan2(angle_y[k], angle_x[k]);");
        for (k, at) in self.late.clone().into_iter().enumerate() {
            self.line(format!("const double v{at} = turn[{k}];"));
        }
    }

    /// The conditions that make the answer bad, as masks that are joined pair by pair.
    fn checks(&mut self) {
        let zero = Term::constant(0.0);
        let bad = |check: &Check| match *check {
            Check::Branch(comparison, true) => format!("!({})", compared(comparison)),
            Check::Branch(comparison, false) => compared(comparison),
            Check::NotZero(x) => compared(Comparison::Equal(x, zero)),
            Check::CertainAngle(y, x) => {
                format!("({} == 0.0) & !({} > 0.0)", number(y), number(x))
            }
            // x − x is zero where x is finite
            Check::Finite(x) => format!("!({0} - {0} == 0.0)", number(x)),
        };
        let list = self.kernel.checks.iter().map(bad).collect();
        self.joined("bad", list);
    }

    fn limits(&mut self) {
        let mut list = Vec::new();
        for limited in &self.kernel.limited {
            let x = number(limited.x);
            if limited.lower.is_finite() {
                list.push(format!("{x} < {}", literal(limited.lower)));
            }
            if limited.upper.is_finite() {
                list.push(format!("{x} > {}", literal(limited.upper)));
            }
        }
        self.joined("over", list);
    }

    /// A mask: all bits where one of the conditions holds.
    fn joined(&mut self, name: &str, conditions: Vec<String>) {
        let masks = conditions.into_iter().map(|condition| format!("sarrus_mask({condition})"));
        let mut masks: Vec<String> = masks.collect();
        let mut parts = 0;
        // statements of eight, then of what they leave
        while masks.len() > 1 {
            let mut next = Vec::new();
            for group in masks.chunks(8) {
                let part = format!("{name}{parts}");
                self.line(format!("const uint64_t {part} ="));
                self.line(format!("    {};", group.join(" |\n        ")));
                next.push(part);
                parts += 1;
            }
            masks = next;
        }
        let all = masks.first().map_or("UINT64_C(0)", String::as_str);
        self.line(format!("const uint64_t {name} = {all};"));
    }

    fn outputs(&mut self) {
        for (k, x) in self.kernel.outputs.iter().enumerate() {
            self.line(format!("out[{k}] = sarrus_masked({}, bad);", number(*x)));
        }
        if self.kernel.outputs.is_empty() {
            self.line("(void)out;");
        }
        self.line("return (int)((bad & 2u) | (over & ~bad & 1u));");
    }
}

fn number(term: Term) -> String {
    match term {
        Term::Constant(bits) => literal(f64::from_bits(bits)),
        Term::Node { at, negated: false } => format!("v{at}"),
        Term::Node { at, negated: true } => format!("-v{at}"),
    }
}

fn compared(comparison: Comparison) -> String {
    match comparison {
        Comparison::Less(a, b) => format!("{} < {}", number(a), number(b)),
        Comparison::Equal(a, b) => format!("{} == {}", number(a), number(b)),
    }
}
