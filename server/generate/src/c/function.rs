//! `NAME.c`.
//!
//! Operations that two like parts of the robot have in common are one instruction on two numbers
//! ([`crate::pair`]). Sines and arc tangents, where there are several, are one loop over an array
//! whose length is a multiple of four, so that compilers make vectors of it; checks and limits are
//! tables of bounds and one loop each.

use std::collections::HashMap;

use crate::c::elementary::elementary;
use crate::c::parts::Statements;
use crate::c::rows::rows;
use crate::c::table::{Table, Value};
use crate::c::{FLAGS, expression, fused, term};
use crate::graph::{Operation, Term};
use crate::pair::{Pairs, Step};
use crate::{Kernel, Manifest};

/// Numbers in a vector.
const LANES: usize = 4;
/// Number of repetitions from which a loop is faster: unused lanes of a vector are computed too.
const WORTH: usize = 3;

/// The function of a kernel.
pub(super) fn function(kernel: &Kernel, name: &str, is_for_devices: bool) -> String {
    let mut text =
        include_str!("head.c").replace("@NAME@", name).replace("@FLAGS@", &FLAGS.join(" "));
    text += include_str!("elementary.c");
    text += "\n#if !defined(SARRUS_DEVICE)\n";
    text += &elementary(kernel, false);
    let pairs = Pairs::new(kernel);
    if pairs.steps.iter().any(|step| matches!(step, Step::Pair(..))) {
        text += include_str!("pair.c");
    }
    let late = late_angles(kernel);
    let angles = HashMap::new();
    let follow = HashMap::new();
    let used = vec![false; kernel.operations.len()];
    let lines = Vec::new();
    let statements = Body { kernel, pairs, lines, angles, late, follow, used }.statements();
    text += &statements.text(name);
    text += "#endif\n";
    text += &rows(kernel, name, is_for_devices);
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
    pairs: Pairs<'a>,
    /// Text written since it was last taken.
    lines: Vec<String>,
    /// Where the sine and cosine of an angle stand.
    angles: HashMap<Term, String>,
    /// Arc tangents that are computed together.
    late: Vec<u32>,
    /// Stores that follow the statement of their number at once.
    follow: HashMap<usize, Vec<String>>,
    /// Whether a number is used by anything but the table of inputs.
    used: Vec<bool>,
}

impl Body<'_> {
    fn statements(mut self) -> Statements {
        if self.kernel.inputs() == 0 {
            self.line("(void)in;");
        }
        let table = Table::new(self.kernel, &self.pairs);
        let angles = self.input_angles();
        let is_angle = |operation: &&Operation| match operation {
            Operation::Sine(x) | Operation::Cosine(x) => {
                x.at().is_some_and(|at| angles.contains(&at))
            }
            _ => false,
        };
        let others = self.kernel.operations.iter().filter(|operation| !is_angle(operation));
        let operands = others.flat_map(Operation::operands);
        let stored = table.stores().flat_map(|(_, _, value)| terms(value));
        let all = operands.chain(stored).chain(self.kernel.outputs.iter().copied());
        all.filter_map(Term::at).for_each(|at| self.used[at as usize] = true);
        self.line("uint64_t bad = 0, over = 0;");
        for array in table.arrays() {
            self.line(array);
        }
        self.plan_stores(&table);
        table.of_inputs().iter().for_each(|line| self.line(line));
        self.angles_of_inputs(angles);
        let head = std::mem::take(&mut self.lines);
        let mut steps = Vec::new();
        for (place, step) in self.pairs.steps.clone().into_iter().enumerate() {
            match step {
                Step::Pair(x, y) if self.used[x as usize] || self.used[y as usize] => {
                    self.pair(x, y);
                }
                Step::Pair(..) => {}
                Step::One(at) if self.late.contains(&at) || !self.used[at as usize] => {}
                Step::One(at) => self.operation(at),
            }
            self.stores_after(place);
            steps.push(std::mem::take(&mut self.lines));
        }
        self.late_angles();
        self.stores_after(usize::MAX);
        table.of_results().iter().for_each(|line| self.line(line));
        self.end();
        Statements { head, steps, tail: self.lines }
    }

    fn line(&mut self, line: impl AsRef<str>) {
        self.lines.push(line.as_ref().to_owned());
    }

    /// Checked numbers and outputs go to their arrays as soon as there are.
    fn plan_stores(&mut self, table: &Table) {
        let mut places = vec![0; self.kernel.operations.len()];
        for (place, step) in self.pairs.steps.iter().enumerate() {
            let (x, y) = match *step {
                Step::Pair(x, y) => (x, y),
                Step::One(x) => (x, x),
            };
            (places[x as usize], places[y as usize]) = (place, place);
        }
        self.late.iter().for_each(|at| places[*at as usize] = usize::MAX);
        let place = |terms: &[Term]| {
            terms.iter().filter_map(|x| x.at()).map(|at| places[at as usize]).max().unwrap_or(0)
        };
        let mut stores: Vec<(usize, String)> = Vec::new();
        for (array, k, value) in table.stores() {
            stores.push(match value {
                Value::Filling => (0, format!("{array}[{k}] = 0.0;")),
                Value::One(measure) => {
                    let terms: Vec<Term> = terms(value).collect();
                    let text = measure.text(|x| self.number(x), ["fabs", "sarrus_larger"]);
                    (place(&terms), format!("{array}[{k}] = {text};"))
                }
                Value::Pair(x, is_absolute) => {
                    let pair = format!("p{x}");
                    let pair = if is_absolute { format!("sarrus_absolute2({pair})") } else { pair };
                    (places[x as usize], format!("sarrus_store2({array} + {k}, {pair});"))
                }
            });
        }
        // inputs come first, and may stand where outputs go
        let of_input = |step: &Step| {
            let (Step::One(x) | Step::Pair(x, _)) = *step;
            self.input(x).is_some()
        };
        let first = self.pairs.steps.iter().rposition(of_input).unwrap_or(0);
        for (k, x) in self.kernel.outputs.iter().enumerate() {
            stores.push((place(&[*x]).max(first), format!("out[{k}] = {};", self.number(*x))));
        }
        for (place, line) in stores {
            self.follow.entry(place).or_default().push(line);
        }
    }

    fn stores_after(&mut self, place: usize) {
        for line in self.follow.remove(&place).unwrap_or_default() {
            self.line(line);
        }
    }

    /// A number by itself.
    fn number(&self, x: Term) -> String {
        let Some(at) = x.at() else { return term(x, "") };
        let name = match self.pairs.ordered(at) {
            None => format!("v{at}"),
            Some((first, _)) if first == at => format!("sarrus_first2(p{first})"),
            Some((first, _)) => format!("sarrus_second2(p{first})"),
        };
        term(x, &name)
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

    /// The number of an input.
    fn input(&self, at: u32) -> Option<u32> {
        match self.kernel.operations.get(at as usize) {
            Some(Operation::Input(k)) => Some(*k),
            _ => None,
        }
    }

    /// Inputs that are angles, where there are enough of them for a loop.
    fn input_angles(&self) -> Vec<u32> {
        let mut found: Vec<u32> = Vec::new();
        for operation in &self.kernel.operations {
            if let Operation::Sine(x) | Operation::Cosine(x) = operation
                && let Some(at) = x.at()
                && self.input(at).is_some()
                && !found.contains(&at)
            {
                found.push(at);
            }
        }
        if found.len() < WORTH { Vec::new() } else { found }
    }

    /// In one loop, the sines and cosines of inputs that are angles: pairs side by side.
    fn angles_of_inputs(&mut self, found: Vec<u32>) {
        if found.is_empty() {
            return;
        }
        let pair = |at: &u32| self.pairs.ordered(*at).filter(|(_, other)| found.contains(other));
        let paired = found.iter().filter(|at| self.pairs.lane(**at) == 0).filter_map(pair);
        let mut list: Vec<u32> = paired.flat_map(|(x, y)| [x, y]).collect();
        list.extend(found.iter().filter(|at| pair(at).is_none()));
        list.extend(found.iter().filter(|at| !list.contains(at)).copied().collect::<Vec<_>>());
        let names: Vec<String> =
            list.iter().filter_map(|at| self.input(*at)).map(|k| format!("in[{k}]")).collect();
        let count = self.array("const double angle", &names, "0.0");
        self.line(format!("double sine[{count}], cosine[{count}];"));
        self.line(format!("for (int k = 0; k < {count}; k++)"));
        self.line("    sarrus_sin_cos(angle[k], &sine[k], &cosine[k]);");
        for (k, at) in list.into_iter().enumerate() {
            self.angles.insert(Term::node(at), format!("[{k}]"));
        }
    }

    fn operation(&mut self, at: u32) {
        use Operation::*;
        let Some(operation) = self.kernel.operations.get(at as usize).copied() else { return };
        if let Sine(x) | Cosine(x) = operation {
            let place = self.angle(x);
            let name = if matches!(operation, Sine(_)) { "sine" } else { "cosine" };
            self.line(format!("const double v{at} = {name}{place};"));
            return;
        }
        let names = ["fma", "sqrt", "fabs", "sarrus_atan2"];
        let value = match operation {
            Input(k) => Some(format!("in[{k}]")),
            _ => expression(&operation, |x| self.number(x), names),
        };
        self.line(format!("const double v{at} = {};", value.unwrap_or_default()));
    }

    /// One operation on a pair of numbers.
    fn pair(&mut self, x: u32, y: u32) {
        use Operation::*;
        let Some(operation) = self.kernel.operations.get(x as usize).copied() else { return };
        let other = self.kernel.operations.get(y as usize).copied();
        let two: Vec<(bool, String)> =
            self.pairs.aligned(x, y).into_iter().map(|(p, q)| self.two(p, q)).collect();
        let signed = |k: usize| {
            let (negated, text) = &two[k];
            if *negated { format!("sarrus_minus2({text})") } else { text.clone() }
        };
        let plain = |k: usize| &two[k].1;
        let value = match (operation, other) {
            (Input(k), Some(Input(l))) => format!("sarrus_both2(in[{k}], in[{l}])"),
            (Sine(a), Some(Sine(b))) => self.two_angles("sine", a, b),
            (Cosine(a), Some(Cosine(b))) => self.two_angles("cosine", a, b),
            (Add(..), _) => match (two[0].0, two[1].0) {
                (false, false) => format!("sarrus_add2({}, {})", plain(0), plain(1)),
                (true, false) => format!("sarrus_subtract2({}, {})", plain(1), plain(0)),
                (_, true) => format!("sarrus_subtract2({}, {})", signed(0), plain(1)),
            },
            (Multiply(..), _) => format!("sarrus_multiply2({}, {})", signed(0), signed(1)),
            (Divide(..), _) => format!("sarrus_divide2({}, {})", signed(0), signed(1)),
            (Fused(..), _) => {
                let name = fused(two[0].0 != two[1].0, two[2].0);
                format!("sarrus_{name}2({}, {}, {})", plain(0), plain(1), plain(2))
            }
            (Root(_), _) => format!("sarrus_root2({})", signed(0)),
            (Absolute(_), _) => format!("sarrus_absolute2({})", plain(0)),
            _ => return,
        };
        self.line(format!("const sarrus_pair p{x} = {value};"));
    }

    /// Two numbers side by side, and whether the sign of both is to be changed.
    fn two(&self, p: Term, q: Term) -> (bool, String) {
        match (p.at(), q.at()) {
            (None, None) if p == q => (false, format!("sarrus_same2({})", term(p, ""))),
            (Some(a), Some(b)) if self.pairs.mate(a) == Some(b) => {
                let text = match self.pairs.lane(a) {
                    0 => format!("p{a}"),
                    _ => format!("sarrus_swapped2(p{b})"),
                };
                match (p.is_negated(), q.is_negated()) {
                    (s, t) if s == t => (s, text),
                    (true, _) => (false, format!("sarrus_signed2({text}, -0.0, 0.0)")),
                    _ => (false, format!("sarrus_signed2({text}, 0.0, -0.0)")),
                }
            }
            (Some(_), Some(_)) if p == q => {
                (p.is_negated(), format!("sarrus_same2({})", self.number(p.unsigned())))
            }
            _ => (false, format!("sarrus_both2({}, {})", self.number(p), self.number(q))),
        }
    }

    fn two_angles(&mut self, name: &str, a: Term, b: Term) -> String {
        let a = self.angle(a);
        let b = self.angle(b);
        let index = |place: &str| place.strip_prefix('[')?.strip_suffix(']')?.parse::<usize>().ok();
        match (index(&a), index(&b)) {
            (Some(k), Some(l)) if l == k + 1 => format!("sarrus_load2({name} + {k})"),
            _ => format!("sarrus_both2({name}{a}, {name}{b})"),
        }
    }

    /// Where sine and cosine of an angle stand; they are computed at its first use.
    fn angle(&mut self, x: Term) -> String {
        if let Some(place) = self.angles.get(&x) {
            return place.clone();
        }
        let place = format!("_{}", x.at().unwrap_or_default());
        self.line(format!("double sine{place}, cosine{place};"));
        self.line(format!("sarrus_sin_cos({}, &sine{place}, &cosine{place});", self.number(x)));
        self.angles.insert(x, place.clone());
        place
    }

    fn late_angles(&mut self) {
        let points = self.late.iter().filter_map(|at| match self.kernel.operations[*at as usize] {
            Operation::Angle(y, x) => Some((self.number(y), self.number(x))),
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

    /// The one branch: where there is no answer there are no numbers.
    fn end(&mut self) {
        self.line("if (bad) {");
        if !self.kernel.outputs.is_empty() {
            self.line(format!("    for (int k = 0; k < {}; k++)", self.kernel.outputs.len()));
            self.line("        out[k] = (double)NAN;");
        }
        self.line("    return 2;");
        self.line("}");
        if self.kernel.outputs.is_empty() {
            self.line("(void)out;");
        }
        self.line("return (int)(over & 1u);");
    }
}

/// The operands of a stored number.
fn terms(value: Value) -> impl Iterator<Item = Term> {
    let list = match value {
        Value::Filling => [None, None],
        Value::Pair(x, _) => [Some(Term::node(x)), None],
        Value::One(measure) => measure.terms(),
    };
    list.into_iter().flatten()
}
