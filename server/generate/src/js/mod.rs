//! JavaScript of a kernel: an object with the function, its sizes and orders, and a test.
//!
//! JavaScript has no fused multiply-add; `head.js` makes one of seventeen operations, which is
//! rounded as the instruction is. So the numbers have the bits of the generic kernel here too.

mod newton;
mod singular;

pub use singular::sigma_min;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use sarrus_dynamics::{Layout, Model};

use crate::c::{expression, identifier, names, request};
use crate::compiler::write_all;
use crate::error::BuildError;
use crate::graph::{Operation, Term};
use crate::row::Row;
use crate::run::{Cancel, run};
use crate::{Kernel, Lengths};

/// Operations of one function: V8 leaves functions of more than some 60 kB of its code
/// unoptimised.
const LONGEST: usize = 500;
/// The longest time for which node may run.
const NODE: Duration = Duration::from_secs(120);
/// The words of the templates in C, and their replacements here.
const WORDS: [(&str, &str); 17] = [
    ("SARRUS_INLINE void NAME(REAL x, REAL *sine, REAL *cosine)", "function sin_cos(x)"),
    ("SARRUS_INLINE REAL NAME(REAL y, REAL x)", "function atan2(y, x)"),
    ("BITS_OF(t) << 63", "bit(n, 0)"),
    ("BITS_OF(t) << 62", "bit(n, 1)"),
    ("*sine", "turn[0]"),
    ("*cosine", "turn[1]"),
    ("const REAL", "const"),
    ("const MASK", "const"),
    ("const BITS", "const"),
    ("(MASK)", ""),
    ("(double)NAN", "NaN"),
    ("FMA(", "fma("),
    ("SAME(", "("),
    ("CHOOSE(", "choose("),
    ("ABSOLUTE(", "Math.abs("),
    ("XOR_SIGN(", "signed("),
    ("BITS_OF(", "("),
];

/// The two files of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Script {
    /// The name of the object, which the files have too.
    pub name: String,
    /// `NAME.js`: a script that declares the object, for a page or for node.
    pub function: String,
    /// `NAME_test.js`: a program for node that ends with 0 where every answer has the generic
    /// kernel's bits.
    pub test: String,
    /// Lists `[state, [given], [wanted]]`: the returned number, the input, and the numbers of the
    /// generic kernel.
    pub states: Vec<String>,
    /// `ask` closes all loops from the given numbers alone.
    pub closes: bool,
    /// Operations of all its functions.
    pub operations: usize,
}

impl Script {
    /// JavaScript for a kernel of this model under this name, of which only letters, digits and
    /// `_` are kept. Allocates.
    pub fn new(kernel: &Kernel, model: &Model<f64>, name: &str) -> Script {
        let name = identifier(name);
        let (function, closing) = function(kernel, model, &name);
        let states = states(kernel, model);
        let rows: String = states.iter().map(|row| format!("  {row},\n")).collect();
        let test = include_str!("test.js").replace("@NAME@", &name).replace("@ROWS@", &rows);
        let closes = closing.is_some();
        let operations = kernel.operations() + closing.unwrap_or(0);
        Script { name, function, test, states, closes, operations }
    }

    /// Writes the files into a folder, which is made where it is missing; their paths.
    ///
    /// # Errors
    /// [`BuildError::Io`]: some file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, BuildError> {
        write_all(folder, &self.name, [(".js", &self.function), ("_test.js", &self.test)])
    }

    /// Runs the test that [`Script::write`] wrote with `node`, for at most 120 s, and returns its
    /// output; `None` where there is no node.
    ///
    /// # Errors
    /// [`BuildError`]: some bit is another, it takes too long, or was cancelled.
    pub fn test(&self, folder: &Path, cancel: &Cancel) -> Result<Option<String>, BuildError> {
        let is_there = run(Command::new("node").arg("--version"), "node", NODE, cancel);
        if !is_there.is_ok_and(|ended| ended.is_success) {
            return Ok(None);
        }
        let path = folder.join(format!("{}_test.js", self.name));
        let ended = run(Command::new("node").arg(&path), "node", NODE, cancel)?;
        match ended.is_success {
            true => Ok(Some(ended.words)),
            false => Err(BuildError::Failed {
                program: format!("node {}", path.display()),
                words: ended.words,
            }),
        }
    }
}

/// A double as JavaScript reads it, to the bit.
fn literal(x: f64) -> String {
    match format!("{x:?}").as_str() {
        "inf" => "Infinity".to_owned(),
        "-inf" => "(-Infinity)".to_owned(),
        text if x.is_sign_negative() => format!("({text})"),
        text => text.trim_end_matches(".0").to_owned(),
    }
}

fn number(x: Term) -> String {
    match x {
        Term::Constant(bits) => literal(f64::from_bits(bits)),
        Term::Node { at, negated } => format!("{}v{at}", if negated { "-" } else { "" }),
    }
}

/// The script, and the operations that close loops; none where it does not close all of them.
fn function(kernel: &Kernel, model: &Model<f64>, name: &str) -> (String, Option<usize>) {
    let info = &kernel.info;
    let plan = &kernel.plan;
    let list = |names: &[String]| {
        names.iter().map(|name| format!("\"{}\"", plain(name))).collect::<Vec<_>>().join(", ")
    };
    let numbers = plan.closed_numbers(model).into_iter().map(|numbers| {
        let joints = list(&numbers.joints);
        format!("    {{ name: \"{}\", joints: [{joints}] }},\n", numbers.name)
    });
    let (newton, closing) = match newton::newton(model, plan, &kernel.lengths) {
        Ok(Some((newton, operations))) => (newton, Some(operations)),
        Ok(None) => ("const close = (given) => given;".to_owned(), Some(0)),
        Err(_) => ("const close = () => null;".to_owned(), None),
    };
    let count = |number: usize| number.to_string();
    // names of joints go last: they are no template
    let words = [
        ("@NAME@", name.to_owned()),
        ("@REQUEST@", request(kernel).to_owned()),
        ("@FINGERPRINT@", format!("{:016x}", info.fingerprint)),
        ("@OPERATIONS@", count(kernel.operations() + closing.unwrap_or(0))),
        ("@HEAD@", head()),
        ("@CLOSED@", count(plan.closed_len())),
        ("@NEWTON@", newton),
        ("@ANSWER@", compiled(kernel)),
        ("@INPUTS@", count(kernel.inputs())),
        ("@OUTPUTS@", count(kernel.outputs())),
        ("@ROBOT@", plain(&info.robot)),
        ("@GIVEN@", fields(kernel, plan.given(), false) + &lengths(kernel)),
        ("@WANTED@", fields(kernel, plan.want(), true)),
        ("@NUMBERS@", numbers.collect()),
    ];
    let frame = include_str!("frame.js").to_owned();
    (words.iter().fold(frame, |text, (word, with)| text.replace(word, with)), closing)
}

/// Operations that JavaScript does not have: fused, and elementary functions as in C.
fn head() -> String {
    let of_c = [include_str!("../c/sin_cos.c"), include_str!("../c/atan2.c")].concat();
    let elementary = WORDS.iter().fold(of_c, |text, (word, with)| text.replace(word, with));
    include_str!("head.js").to_owned() + &elementary
}

/// An expression: the function of a kernel's operations.
fn compiled(kernel: &Kernel) -> String {
    let (parts, waiting) = parts(kernel);
    let calls: Vec<String> = (0..parts.len()).map(|k| format!("part{k}(given, wanted)")).collect();
    format!(
        "(() => {{\n// numbers that wait for later parts\n\
         const wait = new Float64Array({waiting});\n{}return (given, wanted) => {};\n}})()",
        parts.concat(),
        calls.join(" | "),
    )
}

/// Offset, rows and columns of each field, and the names of its rows.
fn fields(kernel: &Kernel, layout: &Layout, is_wanted: bool) -> String {
    let line = |slot: &sarrus_dynamics::Slot| {
        format!(
            "    {}: {{ at: {}, rows: {}, columns: {} }}, // {}\n",
            slot.field.name(),
            slot.offset,
            slot.rows,
            slot.columns,
            plain(names(kernel, slot, is_wanted).trim_start_matches(": ")),
        )
    };
    layout.slots().iter().map(line).collect()
}

/// The lengths behind the given fields, if there are any.
fn lengths(kernel: &Kernel) -> String {
    let Lengths { names, .. } = &kernel.lengths;
    let at = kernel.plan.given().len();
    let rows = names.len();
    let names = plain(&names.join(", "));
    let line = format!("    lengths: {{ at: {at}, rows: {rows}, columns: 1 }}, // {names}\n");
    if rows > 0 { line } else { String::new() }
}

/// Text in a string and in a comment.
fn plain(text: &str) -> String {
    let is_plain = |c: char| !c.is_control() && !"\"\\<>@\u{2028}\u{2029}".contains(c);
    text.chars().map(|c| if is_plain(c) { c } else { '_' }).collect()
}

/// The functions of bounded length, and how many numbers wait between them.
fn parts(kernel: &Kernel) -> (Vec<String>, usize) {
    let operations = &kernel.operations;
    let count = operations.len().div_ceil(LONGEST).max(1);
    let part_of = |at: u32| at as usize / LONGEST;
    // outputs and conditions follow the last of their numbers
    let mut after: Vec<Vec<String>> = vec![Vec::new(); count];
    let mut users: Vec<(Term, usize)> = Vec::new();
    let mut add = |terms: &[Term], line: String| {
        let place = terms.iter().filter_map(|x| x.at()).map(part_of).max().unwrap_or(0);
        users.extend(terms.iter().map(|x| (*x, place)));
        after[place].push(line);
    };
    let checks = Row::all(&kernel.checks).into_iter().map(|row| (row, true));
    for (row, is_check) in checks.chain(Row::limits(kernel).into_iter().map(|row| (row, false))) {
        let terms: Vec<Term> = row.measure.terms().into_iter().flatten().collect();
        let x = row.measure.text(number, ["Math.abs", "larger"]);
        let [lower, upper] = [row.lower, row.upper].map(literal);
        add(
            &terms,
            match is_check {
                true => format!("if (!({x} >= {lower} && {x} <= {upper})) state |= 2;"),
                false => format!("if ({x} < {lower} || {x} > {upper}) state |= 1;"),
            },
        );
    }
    for (k, x) in kernel.outputs.iter().enumerate() {
        add(&[*x], format!("wanted[{k}] = {};", number(*x)));
    }
    for (at, operation) in operations.iter().enumerate() {
        users.extend(operation.operands().map(|x| (x, part_of(at as u32))));
    }
    // places of the numbers that a later part reads
    let mut places: HashMap<u32, usize> = HashMap::new();
    let mut fetched: Vec<Vec<u32>> = vec![Vec::new(); count];
    for (x, part) in users {
        let Some(at) = x.at().filter(|at| part_of(*at) < part) else { continue };
        let next = places.len();
        places.entry(at).or_insert(next);
        fetched[part].push(at);
    }
    let text = |(part, after): (usize, Vec<String>)| {
        let mut lines = vec!["let state = 0;".to_owned()];
        let mut fetch = std::mem::take(&mut fetched[part]);
        fetch.sort_unstable();
        fetch.dedup();
        lines.extend(fetch.iter().map(|at| format!("const v{at} = wait[{}];", places[at])));
        let mut angles: HashMap<Term, usize> = HashMap::new();
        let from = part * LONGEST;
        for (k, operation) in operations.iter().enumerate().skip(from).take(LONGEST) {
            lines.extend(statements(k, operation, &mut angles));
            if let Some(place) = places.get(&(k as u32)) {
                lines.push(format!("wait[{place}] = v{k};"));
            }
        }
        lines.extend(after);
        lines.push("return state;".to_owned());
        let lines: String = lines.iter().map(|line| format!("  {line}\n")).collect();
        format!("function part{part}(given, wanted) {{\n{lines}}}\n")
    };
    let waiting = places.len();
    (after.into_iter().enumerate().map(text).collect(), waiting)
}

/// The statements of operation `at`; sine and cosine of one angle are computed together.
fn statements(at: usize, operation: &Operation, angles: &mut HashMap<Term, usize>) -> Vec<String> {
    use Operation::*;
    let mut lines = Vec::new();
    let value = match *operation {
        Input(k) => format!("given[{k}]"),
        Sine(x) | Cosine(x) => {
            let of = *angles.entry(x).or_insert_with(|| {
                lines.push(format!("sin_cos({});", number(x)));
                lines.push(format!("const s{at} = turn[0], c{at} = turn[1];"));
                at
            });
            format!("{}{of}", if matches!(operation, Sine(_)) { "s" } else { "c" })
        }
        _ => {
            let names = ["fma", "Math.sqrt", "Math.abs", "atan2"];
            expression(operation, number, names).unwrap_or_default()
        }
    };
    lines.push(format!("const v{at} = {value};"));
    lines
}

/// The states of the test.
fn states(kernel: &Kernel, model: &Model<f64>) -> Vec<String> {
    let list = |numbers: &[f64]| numbers.iter().map(|x| literal(*x)).collect::<Vec<_>>().join(", ");
    let answers = kernel.answers(model);
    answers.map(|(code, x, y)| format!("[{code}, [{}], [{}]]", list(x), list(&y))).collect()
}
