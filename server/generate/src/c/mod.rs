//! C11 of a kernel: the function, its header, a test with answers of the generic kernel.

mod device;
mod elementary;
mod function;
mod header;
mod parts;
mod rows;
mod table;
mod test;
mod watches;

pub use device::{Device, Launcher};
pub(crate) use header::{names, request};

use sarrus_dynamics::Model;
use sarrus_proto::fnv1a_64;

use crate::Kernel;
use crate::graph::{Operation, Term};

/// The files of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// The name of the function, which the files have too.
    pub name: String,
    /// `NAME.h`.
    pub header: String,
    /// `NAME.c`.
    pub function: String,
    /// `NAME_test.c`: a program that ends with 0 where every answer has the generic kernel's bits.
    pub test: String,
    /// Of devices.
    pub launcher: Option<Launcher>,
}

impl Source {
    /// C for a kernel of this model under this name, of which only letters, digits and `_` are
    /// kept. Allocates.
    pub fn new(kernel: &Kernel, model: &Model<f64>, name: &str) -> Source {
        Source::made(kernel, model, name, None)
    }

    /// As above with a launcher. The function for rows is in an order in which a device spills few
    /// registers; on a processor it may take a seventh longer.
    pub fn of_device(kernel: &Kernel, model: &Model<f64>, name: &str, device: Device) -> Source {
        Source::made(kernel, model, name, Some(device))
    }

    fn made(kernel: &Kernel, model: &Model<f64>, name: &str, device: Option<Device>) -> Source {
        let name = identifier(name);
        Source {
            header: header::header(kernel, model, &name),
            function: function::function(kernel, &name, device.is_some()),
            test: test::filled(include_str!("test.c"), kernel, model, &name),
            launcher: device.map(|device| Launcher::new(kernel, model, &name, device)),
            name,
        }
    }
}

/// Whether this build of sarrus needs a processor with FMA and AVX2; compiled code may then need it
/// too.
const HAS_BASELINE: bool =
    cfg!(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2"));

/// The flags that keep the bits: no contraction, and no call in place of an instruction. Statements
/// are not vectorised either: there gcc fuses multiplications even without contraction
/// (`vfmaddsub`). A build with a baseline passes it on, so that `fma` is an instruction; a portable
/// build compiles for every processor, and `fma` is a call there.
pub const FLAGS: &[&str] = if HAS_BASELINE { &ALL } else { ALL.split_at(ALL.len() - 1).0 };

const ALL: [&str; 7] = [
    "-std=c11",
    "-O2",
    "-ffp-contract=off",
    "-fno-tree-slp-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-march=x86-64-v3",
];

/// Names are not longer: file systems take 255 bytes with an ending, and C some more.
const LONGEST: usize = 100;

/// A name that C and file systems take; the end of a long one is its hash.
pub(crate) fn identifier(name: &str) -> String {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let word: String = name.chars().map(|c| if is_word(c) { c } else { '_' }).collect();
    let is_start = |c: char| c.is_ascii_alphabetic();
    let mut word = if word.starts_with(is_start) { word } else { format!("robot_{word}") };
    if word.len() > LONGEST {
        // ASCII alone
        word.truncate(LONGEST - 17);
        word += &format!("_{:016x}", fnv1a_64(name.as_bytes()));
    }
    word
}

/// A double as C reads it, to the bit.
fn literal(x: f64) -> String {
    let text = format!("{x:?}");
    match text.as_str() {
        "NaN" => "(double)NAN".to_owned(),
        "inf" => "(double)INFINITY".to_owned(),
        "-inf" => "(-(double)INFINITY)".to_owned(),
        _ if x.is_sign_negative() => format!("({text})"),
        _ => text,
    }
}

/// A constant, or this name of a number with the sign before it.
fn term(x: Term, name: &str) -> String {
    match x {
        Term::Constant(bits) => literal(f64::from_bits(bits)),
        Term::Node { negated, .. } => format!("{}{name}", if negated { "-" } else { "" }),
    }
}

/// A number of each row, or the same constant for all.
fn number_of_rows(x: Term) -> String {
    match x.at() {
        Some(at) => term(x, &format!("v{at}")),
        None => format!("sarrus_same({})", term(x, "")),
    }
}

/// An operation as an expression of a language, with its names of four functions; none of inputs,
/// sines and cosines.
pub(crate) fn expression(
    operation: &Operation,
    n: impl Fn(Term) -> String,
    [fused, root, absolute, angle]: [&str; 4],
) -> Option<String> {
    Some(match *operation {
        Operation::Add(a, b) if b.is_negated() => format!("{} - {}", n(a), n(b.negated())),
        Operation::Add(a, b) => format!("{} + {}", n(a), n(b)),
        Operation::Multiply(a, b) => format!("{} * {}", n(a), n(b)),
        Operation::Divide(a, b) => format!("{} / {}", n(a), n(b)),
        Operation::Fused(a, b, c) => format!("{fused}({}, {}, {})", n(a), n(b), n(c)),
        Operation::Root(x) => format!("{root}({})", n(x)),
        Operation::Absolute(x) => format!("{absolute}({})", n(x)),
        Operation::Angle(y, x) => format!("{angle}({}, {})", n(y), n(x)),
        Operation::Select(x, y, a, b) => format!("{} < {} ? {} : {}", n(x), n(y), n(a), n(b)),
        Operation::Input(_) | Operation::Sine(_) | Operation::Cosine(_) => return None,
    })
}

/// The fused multiply-add with the signs of its product and of its addend.
fn fused(is_product_negated: bool, is_sum_negated: bool) -> &'static str {
    match (is_product_negated, is_sum_negated) {
        (false, false) => "fma",
        (false, true) => "fms",
        (true, false) => "fnma",
        (true, true) => "fnms",
    }
}

/// Text of a comment that neither ends it nor begins another, nor changes the order in which code
/// is shown.
fn comment(text: &str) -> String {
    let turns = |c: char| {
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}')
            || matches!(c, '\u{2028}' | '\u{2029}' | '\u{2066}'..='\u{2069}')
    };
    let text = text.replace("*/", "* /").replace("/*", "/ *");
    text.chars().map(|c| if c.is_control() || turns(c) { ' ' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_robots_fit_c_and_file_systems() {
        assert_eq!(identifier("2 é-arm"), "robot_2___arm");
        let long = "a".repeat(300);
        let [one, other] = [identifier(&long), identifier(&format!("{long}b"))];
        assert!(one.len() == LONGEST && one.starts_with("aaa") && one != other, "{one} {other}");
        assert_eq!(identifier(&long[..LONGEST]), long[..LONGEST]);
        for text in ["a */ b", "/* a", "*/*", "/*/", "\u{202e}a\u{2066}\nb\u{85}\0"] {
            let plain = comment(text);
            assert!(!plain.contains("*/") && !plain.contains("/*"), "{plain}");
            assert!(plain.chars().all(|c| c == ' ' || c.is_ascii_graphic()), "{plain:?}");
        }
        assert_eq!(comment("bras gauche é"), "bras gauche é");
    }
}
