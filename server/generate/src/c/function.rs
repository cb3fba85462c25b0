//! `NAME.c`.

use std::collections::HashMap;
use std::fmt::Write as _;

use crate::Kernel;
use crate::c::literal;
use crate::graph::{Check, Comparison, Operation, Term};

/// The function of a kernel.
pub(super) fn function(kernel: &Kernel, name: &str) -> String {
    let mut text = format!(
        "/* {name}: straight-line code, see {name}.h. Compile with\n   {} -mfma (or a newer \
         baseline). */\n#include \"{name}.h\"\n\n#include <math.h>\n#include <stdint.h>\n#include \
         <string.h>\n\n",
        super::FLAGS.join(" ")
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
    Body { kernel, text: &mut text, angles: HashMap::new() }.write();
    text += "}\n";
    text
}

/// The statements of the function.
struct Body<'a> {
    kernel: &'a Kernel,
    text: &'a mut String,
    /// Where the sine and cosine of an angle stand.
    angles: HashMap<Term, String>,
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
            self.operation(at, operation);
        }
        self.checks();
        self.outputs();
    }

    fn line(&mut self, line: impl AsRef<str>) {
        // a string takes whatever is written to it
        let _ = writeln!(self.text, "    {}", line.as_ref());
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
        if list.is_empty() {
            return;
        }
        // whole vectors of four: what is left over is filled with zero
        let count = list.len().div_ceil(4) * 4;
        let names: Vec<String> = list.iter().map(|x| number(*x)).collect();
        self.line(format!("const double angle[{count}] = {{{}}};", names.join(", ")));
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

    fn checks(&mut self) {
        self.line("unsigned bad = 0u, over = 0u;");
        // x − x is zero where x is finite
        let finite = |check: &Check| match check {
            Check::Finite(x) => Some(format!("({0} - {0})", number(*x))),
            _ => None,
        };
        let mut sum: Vec<String> = self.kernel.checks.iter().filter_map(finite).collect();
        while sum.len() > 1 {
            sum = sum.chunks(2).map(|pair| format!("({})", pair.join(" + "))).collect();
        }
        if let Some(sum) = sum.first() {
            self.line(format!("bad |= (unsigned)!({sum} == 0.0);"));
        }
        for check in &self.kernel.checks {
            let bad = match *check {
                Check::Finite(_) => continue,
                Check::Branch(comparison, outcome) => {
                    format!("{}({})", if outcome { "!" } else { "" }, compared(comparison))
                }
                Check::NotZero(x) => format!("({} == 0.0)", number(x)),
                Check::CertainAngle(y, x) => {
                    format!("(({} == 0.0) & !({} > 0.0))", number(y), number(x))
                }
            };
            self.line(format!("bad |= (unsigned){bad};"));
        }
        for limited in &self.kernel.limited {
            let x = number(limited.x);
            if limited.lower.is_finite() {
                self.line(format!("over |= (unsigned)({x} < {});", literal(limited.lower)));
            }
            if limited.upper.is_finite() {
                self.line(format!("over |= (unsigned)({x} > {});", literal(limited.upper)));
            }
        }
    }

    fn outputs(&mut self) {
        self.line("const uint64_t none = UINT64_C(0) - (uint64_t)bad;");
        for (k, x) in self.kernel.outputs.iter().enumerate() {
            self.line(format!("out[{k}] = sarrus_masked({}, none);", number(*x)));
        }
        self.line("return (int)((bad << 1) | (over & ~bad));");
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
