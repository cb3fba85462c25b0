//! A long function as several.
//!
//! Compile time grows faster than the length of a function, so a long one is divided. Each part has
//! a bounded number of statements; numbers that a later part needs pass through arrays, whose slots
//! are reused after their last use.

use std::collections::HashMap;

/// Statements of one part.
const LONGEST: usize = 4_000;
/// The arrays that parts share, beside those of numbers.
const ARRAYS: [(&str, &str); 11] = [
    ("in", "sarrus_in "),
    ("out", "sarrus_out "),
    ("seen", "double *"),
    ("limited", "double *"),
    ("sine", "double *"),
    ("cosine", "double *"),
    ("left", "sarrus_lanes *"),
    ("beyond", "sarrus_lanes *"),
    ("squares", "sarrus_rows *"),
    ("most", "sarrus_rows *"),
    ("least", "sarrus_rows *"),
];
/// The types of numbers, and the arrays in which they wait.
const KINDS: [(&str, &str); 3] =
    [("double", "one"), ("sarrus_pair", "two"), ("sarrus_rows", "rows")];

/// The statements of a function: its beginning, the operations, and its end.
pub(super) struct Statements {
    pub(super) head: Vec<String>,
    /// The lines of each operation, between which the function may be divided.
    pub(super) steps: Vec<Vec<String>>,
    pub(super) tail: Vec<String>,
}

/// Where a number waits for later parts.
#[derive(Clone, Copy)]
struct Place {
    kind: usize,
    at: usize,
}

/// One number that crosses parts.
struct Crossing {
    kind: usize,
    from: usize,
    last: usize,
}

impl Statements {
    /// The function, with the parts that it calls before it.
    pub(super) fn text(self, name: &str) -> String {
        let Statements { head, steps, tail } = self;
        let count = steps.iter().map(Vec::len).sum::<usize>().div_ceil(LONGEST).max(1);
        let whole = format!("\nSARRUS_FUNCTION int {name}(sarrus_in in, sarrus_out out)\n{{\n");
        if count == 1 {
            let lines = head.iter().chain(steps.iter().flatten()).chain(&tail);
            return format!("{whole}{}}}\n", lines.map(|line| indented(line)).collect::<String>());
        }
        // parts of equal length; the last lines are one more
        let mut parts: Vec<Vec<String>> = Vec::new();
        let each = steps.len().div_ceil(count);
        for steps in steps.chunks(each) {
            parts.push(steps.iter().flatten().cloned().collect());
        }
        parts.push(tail);
        let (places, sizes) = places(&parts);
        let crosses = |name: &str| places.get(name).copied();

        let has = |array: &str| {
            let lines = || parts.iter().flatten().chain(&head);
            lines().any(|line| words(line).any(|word| word == array))
        };
        let arrays: Vec<(&str, &str)> = ARRAYS.into_iter().filter(|(name, _)| has(name)).collect();
        let mut text = format!("\n/* what the parts of {name} share */\nstruct {name}_shared {{\n");
        arrays.iter().for_each(|(array, of)| text += &format!("    {of}{array};\n"));
        for ((kind, array), size) in KINDS.into_iter().zip(sizes).filter(|(_, size)| *size > 0) {
            text += &format!("    {kind} {array}[{size}];\n");
        }
        text += "};\n";

        let mut defined: HashMap<&str, usize> = HashMap::new();
        let mut main = String::new();
        for (k, lines) in parts.iter().enumerate() {
            let here: Vec<&str> =
                lines.iter().flat_map(|line| definitions(line)).map(|(_, name)| name).collect();
            here.iter().for_each(|name| {
                defined.insert(name, k);
            });
            let is_last = k + 1 == parts.len();
            let mut part = String::new();
            if !is_last {
                for (array, of) in &arrays {
                    if lines.iter().flat_map(|line| words(line)).any(|word| word == *array) {
                        part += &format!("    {of}const {array} = all->{array};\n");
                    }
                }
            }
            let of = if is_last { "all." } else { "all->" };
            let mut fetched: Vec<&str> = Vec::new();
            for word in lines.iter().flat_map(|line| words(line)) {
                let is_early = defined.get(word).is_some_and(|at| *at < k);
                if let Some(Place { kind, at }) = crosses(word).filter(|_| is_early)
                    && !fetched.contains(&word)
                {
                    let (kind, array) = KINDS[kind];
                    part += &format!("    const {kind} {word} = {of}{array}[{at}];\n");
                    fetched.push(word);
                }
            }
            lines.iter().for_each(|line| part += &indented(line));
            for name in here {
                if let Some(Place { kind, at }) = crosses(name) {
                    part += &format!("    {of}{}[{at}] = {name};\n", KINDS[kind].1);
                }
            }
            if is_last {
                main = part;
            } else {
                let arguments = format!("(struct {name}_shared *all)");
                text += &format!("\nSARRUS_APART void {name}_{k}{arguments}\n{{\n{part}}}\n");
            }
        }
        text += &whole;
        head.iter().for_each(|line| text += &indented(line));
        text += &format!("    struct {name}_shared all;\n");
        arrays.iter().for_each(|(array, _)| text += &format!("    all.{array} = {array};\n"));
        (0..parts.len() - 1).for_each(|k| text += &format!("    {name}_{k}(&all);\n"));
        text + &main + "}\n"
    }
}

fn indented(line: &str) -> String {
    format!("    {line}\n")
}

/// The names in a line.
fn words(line: &str) -> impl Iterator<Item = &str> {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    line.split(move |c| !is_word(c))
        .filter(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()))
}

/// The numbers that a line defines, with their kind.
fn definitions(line: &str) -> impl Iterator<Item = (usize, &str)> {
    let (is_constant, rest) =
        line.strip_prefix("const ").map_or((false, line), |rest| (true, rest));
    let kind = |(kind, (of, _)): (usize, (&str, &str))| {
        Some((kind, rest.strip_prefix(of)?.strip_prefix(' ')?))
    };
    let (kind, rest) = KINDS.into_iter().enumerate().find_map(kind).unwrap_or_default();
    // not arrays
    let names = if is_constant {
        rest.split_once(" = ").map(|(name, _)| name)
    } else {
        rest.strip_suffix(';')
    };
    let names = names.filter(|names| !names.contains('[')).unwrap_or_default();
    names.split(", ").filter(|name| !name.is_empty()).map(move |name| (kind, name))
}

/// Where numbers wait that a later part needs, and how many places there are of each kind.
fn places(parts: &[Vec<String>]) -> (HashMap<&str, Place>, [usize; 3]) {
    let mut crossings: HashMap<&str, Crossing> = HashMap::new();
    let mut order: Vec<&str> = Vec::new();
    for (k, lines) in parts.iter().enumerate() {
        for line in lines {
            for (kind, name) in definitions(line) {
                crossings.insert(name, Crossing { kind, from: k, last: k });
                order.push(name);
            }
            for word in words(line) {
                if let Some(crossing) = crossings.get_mut(word) {
                    crossing.last = k;
                }
            }
        }
    }
    let mut places = HashMap::new();
    let mut free = [const { Vec::new() }; 3];
    let mut sizes = [0; 3];
    // places that are free again from a part on
    let mut ends: Vec<Vec<Place>> = parts.iter().map(|_| Vec::new()).collect();
    let mut names = order.into_iter().peekable();
    for k in 0..parts.len() {
        for place in std::mem::take(&mut ends[k]) {
            free[place.kind].push(place.at);
        }
        while let Some(name) = names.next_if(|name| crossings[name].from == k) {
            let Crossing { kind, last, .. } = crossings[name];
            if last > k {
                let at = free[kind].pop().unwrap_or(sizes[kind]);
                sizes[kind] = sizes[kind].max(at + 1);
                let place = Place { kind, at };
                places.insert(name, place);
                // fetched at the beginning of its last part, whose own are put away at its end
                ends[last].push(place);
            }
        }
    }
    (places, sizes)
}
