//! `NAME_rows`: several states at once, each in a lane of every number.
//!
//! The operations of the function for one state in their order, without its pairs and tables: a
//! vector is full without them. A row that fails a check sets its bit of the return value.

use std::collections::{HashMap, HashSet};

use crate::Kernel;
use crate::c::elementary::elementary;
use crate::c::parts::Statements;
use crate::c::watches::Watches;
use crate::c::{expression, fused, number_of_rows};
use crate::graph::{Operation, Term};

/// The function for rows with its helpers, where the compiler has vectors and rows are requested.
pub(super) fn rows(kernel: &Kernel, name: &str, is_for_devices: bool) -> String {
    // as many lanes as the header declares
    let mut text = format!("#define SARRUS_LANES {}_ROWS\n", name.to_ascii_uppercase());
    text += include_str!("rows.c");
    text += &elementary(kernel, true);
    let input = |(at, operation): (usize, &Operation)| match operation {
        Operation::Input(k) => Some((*k, at)),
        _ => None,
    };
    let inputs = kernel.operations.iter().enumerate().filter_map(input).collect();
    let of_plan: Vec<u32> = (0..kernel.operations.len() as u32).collect();
    let order = match is_for_devices {
        true => [depth_first(kernel), of_plan].into_iter().min_by_key(|x| last_uses(kernel, x)),
        false => Some(of_plan),
    };
    let order = order.unwrap_or_default();
    let body = Body { kernel, order, angles: HashSet::new(), inputs };
    text += &body.statements().text(&format!("{name}_rows"));
    format!("\n#if defined({}_ROWS)\n{text}#endif\n", name.to_ascii_uppercase())
}

/// The operations of each output in turn, each after its operands, the longest way to them first.
fn depth_first(kernel: &Kernel) -> Vec<u32> {
    let operands = |at: u32| kernel.operations[at as usize].operands().filter_map(Term::at);
    let mut ways: Vec<u32> = Vec::new();
    for at in 0..kernel.operations.len() as u32 {
        ways.push(operands(at).map(|from| 1 + ways[from as usize]).max().unwrap_or(0));
    }
    let mut is_open = vec![true; ways.len()];
    let mut order = Vec::new();
    // operations that only checks need come last
    let first = kernel.outputs.iter().filter_map(|x| x.at());
    for root in first.chain(0..ways.len() as u32) {
        let mut path = vec![root];
        while let Some(at) = path.last().copied() {
            let waiting = operands(at).filter(|from| is_open[*from as usize]);
            if let Some(from) = waiting.max_by_key(|from| ways[*from as usize]) {
                path.push(from);
                continue;
            }
            path.pop();
            if std::mem::take(&mut is_open[at as usize]) {
                order.push(at);
            }
        }
    }
    order
}

/// The places of the last uses of all numbers in an order: the earlier, the fewer numbers wait.
fn last_uses(kernel: &Kernel, order: &[u32]) -> usize {
    let mut last = vec![0; order.len()];
    for (place, at) in order.iter().enumerate() {
        let operands = kernel.operations[*at as usize].operands();
        operands.filter_map(Term::at).for_each(|from| last[from as usize] = place);
    }
    last.iter().sum()
}

/// The statements of the function.
struct Body<'a> {
    kernel: &'a Kernel,
    order: Vec<u32>,
    /// Angles that have their sine and cosine.
    angles: HashSet<Term>,
    /// The operations of inputs that are not read yet.
    inputs: HashMap<u32, usize>,
}

impl Body<'_> {
    fn statements(mut self) -> Statements {
        let head = [
            "sarrus_lanes left[1] = {SARRUS_NONE}, beyond[1] = {SARRUS_NONE};",
            "(void)in;",
            "(void)out;",
        ];
        let mut head: Vec<String> = head.map(str::to_owned).into();
        let mut watches = Watches::new(self.kernel);
        head.append(&mut watches.head);
        let order = std::mem::take(&mut self.order);
        let mut places = vec![0; order.len()];
        order.iter().enumerate().for_each(|(place, at)| places[*at as usize] = place);
        // the checks of a number follow it
        let mut follow: Vec<Vec<String>> = vec![Vec::new(); order.len()];
        let mut after = |terms: [Option<Term>; 2], line: String| match terms
            .into_iter()
            .flatten()
            .filter_map(Term::at)
            .max_by_key(|at| places[*at as usize])
        {
            Some(at) => follow[at as usize].push(line),
            None => head.push(line),
        };
        watches.lines.into_iter().for_each(|(terms, line)| after(terms, line));
        let apart = self.kernel.outputs.len();
        for (k, some) in self.kernel.outputs.chunks(2).enumerate() {
            let to = format!("out, {}, {apart}, {}", 2 * k, number_of_rows(some[0]));
            match some.get(1) {
                Some(x) => after(
                    [Some(some[0]), Some(*x)],
                    format!("sarrus_put_both({to}, {});", number_of_rows(*x)),
                ),
                None => after([Some(some[0]), None], format!("sarrus_put({to});")),
            }
        }
        let mut steps = Vec::new();
        for at in order.into_iter().map(|at| at as usize) {
            let mut lines = self.operation(at, &self.kernel.operations[at]);
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
            Fused(a, b, c) => {
                let name = fused(a.is_negated() != b.is_negated(), c.is_negated());
                let [a, b, c] = [a, b, c].map(|x| n(x.unsigned()));
                format!("sarrus_{name}({a}, {b}, {c})")
            }
            Sine(x) | Cosine(x) => {
                let of = x.at().unwrap_or_default();
                if self.angles.insert(x) {
                    let call = format!("sarrus_sin_cos_rows({}, &s{of}, &c{of});", n(x));
                    lines.extend([format!("sarrus_rows s{of}, c{of};"), call]);
                }
                let name = if matches!(operation, Sine(_)) { "s" } else { "c" };
                format!("{name}{of}")
            }
            Select(x, y, a, b) => {
                format!("sarrus_choose_rows({} < {}, {}, {})", n(x), n(y), n(a), n(b))
            }
            _ => {
                let names = ["", "sarrus_root", "sarrus_absolute", "sarrus_atan2_rows"];
                expression(operation, n, names).unwrap_or_default()
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
                format!("sarrus_get_both(in, {first}, {apart}, &v{a}, &v{b});"),
            ],
            [Some(at), None] | [None, Some(at)] => {
                vec![format!("const sarrus_rows v{at} = sarrus_get(in, {k}, {apart});")]
            }
            [None, None] => Vec::new(),
        }
    }
}
