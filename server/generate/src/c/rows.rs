//! `NAME_rows`: several states at once, each in a lane of every number.
//!
//! The operations of the function for one state in their order, without its pairs and tables: a
//! vector is full without them. A row that fails a check sets its bit of the return value.

use std::collections::{HashMap, HashSet};

use crate::Kernel;
use crate::c::elementary::elementary;
use crate::c::parts::Statements;
use crate::c::watches::Watches;
use crate::c::{arithmetic, fused, number_of_rows};
use crate::graph::{Operation, Term};

/// The function for rows with its helpers, where the compiler has vectors and rows are requested.
pub(super) fn rows(kernel: &Kernel, name: &str) -> String {
    // as many lanes as the header declares
    let mut text = format!("#define SARRUS_LANES {}_ROWS\n", name.to_ascii_uppercase());
    text += include_str!("rows.c");
    text += &elementary(kernel, true);
    let input = |(at, operation): (usize, &Operation)| match operation {
        Operation::Input(k) => Some((*k, at)),
        _ => None,
    };
    let inputs = kernel.operations.iter().enumerate().filter_map(input).collect();
    let body = Body { kernel, angles: HashSet::new(), inputs };
    text += &body.statements().text(&format!("{name}_rows"));
    format!("\n#if defined(SARRUS_ROWS) && defined(__GNUC__)\n{text}#endif\n")
}

/// The statements of the function.
struct Body<'a> {
    kernel: &'a Kernel,
    /// Angles that have their sine and cosine.
    angles: HashSet<Term>,
    /// The operations of inputs that are not read yet.
    inputs: HashMap<u32, usize>,
}

impl Body<'_> {
    fn statements(mut self) -> Statements {
        let head = ["sarrus_lanes left[1] = {{0}}, beyond[1] = {{0}};", "(void)in;", "(void)out;"];
        let mut head: Vec<String> = head.map(str::to_owned).into();
        let mut watches = Watches::new(self.kernel);
        head.append(&mut watches.head);
        // the checks of a number follow it
        let mut follow: Vec<Vec<String>> = vec![Vec::new(); self.kernel.operations.len()];
        let mut after = |terms: [Option<Term>; 2], line: String| match terms
            .into_iter()
            .flatten()
            .filter_map(Term::at)
            .max()
        {
            Some(at) => follow[at as usize].push(line),
            None => head.push(line),
        };
        watches.lines.into_iter().for_each(|(terms, line)| after(terms, line));
        let apart = self.kernel.outputs.len();
        for (k, some) in self.kernel.outputs.chunks(2).enumerate() {
            let to = format!("out + {}, {apart}, {}", 2 * k, number_of_rows(some[0]));
            match some.get(1) {
                Some(x) => after(
                    [Some(some[0]), Some(*x)],
                    format!("sarrus_put_both({to}, {});", number_of_rows(*x)),
                ),
                None => after([Some(some[0]), None], format!("sarrus_put({to});")),
            }
        }
        let mut steps = Vec::new();
        for (at, operation) in self.kernel.operations.iter().enumerate() {
            let mut lines = self.operation(at, operation);
            lines.append(&mut follow[at]);
            steps.push(lines);
        }
        let end = "return sarrus_bits_of(left[0]) | sarrus_bits_of(beyond[0]) << SARRUS_LANES;";
        watches.tail.push(end.to_owned());
        Statements { head, steps, tail: watches.tail }
    }

    fn operation(&mut self, at: usize, operation: &Operation) -> Vec<String> {
        use Operation::*;
        let n = number_of_rows;
        let mut lines = Vec::new();
        let value = match *operation {
            Input(k) => return self.input(k),
            Add(..) | Multiply(..) | Divide(..) => arithmetic(operation, n).unwrap_or_default(),
            Fused(a, b, c) => {
                let name = fused(a.is_negated() != b.is_negated(), c.is_negated());
                let [a, b, c] = [a, b, c].map(|x| n(x.unsigned()));
                format!("sarrus_{name}({a}, {b}, {c})")
            }
            Root(x) => format!("sarrus_root({})", n(x)),
            Absolute(x) => format!("sarrus_absolute({})", n(x)),
            Sine(x) | Cosine(x) => {
                let of = x.at().unwrap_or_default();
                if self.angles.insert(x) {
                    let call = format!("sarrus_sin_cos_rows({}, &s{of}, &c{of});", n(x));
                    lines.extend([format!("sarrus_rows s{of}, c{of};"), call]);
                }
                let name = if matches!(operation, Sine(_)) { "s" } else { "c" };
                format!("{name}{of}")
            }
            Angle(y, x) => format!("sarrus_atan2_rows({}, {})", n(y), n(x)),
            Select(x, y, a, b) => {
                format!("sarrus_choose_rows({} < {}, {}, {})", n(x), n(y), n(a), n(b))
            }
        };
        lines.push(format!("const sarrus_rows v{at} = {value};"));
        lines
    }

    /// Reads an input, and the one beside it, unless it came with that.
    fn input(&mut self, k: u32) -> Vec<String> {
        let first = k & !1;
        let apart = self.kernel.inputs();
        match [first, first + 1].map(|k| self.inputs.remove(&k)) {
            [Some(a), Some(b)] => vec![
                format!("sarrus_rows v{a}, v{b};"),
                format!("sarrus_get_both(in + {first}, {apart}, &v{a}, &v{b});"),
            ],
            [Some(at), None] | [None, Some(at)] => {
                vec![format!("const sarrus_rows v{at} = sarrus_get(in + {k}, {apart});")]
            }
            [None, None] => Vec::new(),
        }
    }
}
