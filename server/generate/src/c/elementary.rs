//! Sine, cosine and arc tangent in C, of one number or of a number of several states.

use crate::Kernel;
use crate::graph::Operation;

/// The templates' words, with their replacements for a single number and for rows.
const WORDS: [(&str, [&str; 2]); 10] = [
    ("NAME", ["@", "@_rows"]),
    ("REAL", ["double", "sarrus_rows"]),
    ("MASK", ["int", "sarrus_lanes"]),
    ("FMA(", ["fma(", "sarrus_fma("]),
    ("SAME(", ["(", "sarrus_same("]),
    ("CHOOSE(", ["sarrus_choose(", "sarrus_choose_rows("]),
    ("ABSOLUTE(", ["fabs(", "sarrus_absolute("]),
    ("XOR_SIGN(", ["sarrus_xor_sign(", "sarrus_xor_sign_rows("]),
    ("BITS_OF(", ["sarrus_bits(", "sarrus_bits_rows("]),
    ("BITS", ["uint64_t", "sarrus_lanes"]),
];

/// The elementary functions that a kernel uses.
pub(super) fn elementary(kernel: &Kernel, of_rows: bool) -> String {
    let has = |is: fn(&Operation) -> bool| kernel.operations.iter().any(is);
    let mut text = String::new();
    let mut add = |name: &str, template: &str| {
        let filled = |text: String, (word, with): (&str, [&str; 2])| {
            text.replace(word, with[usize::from(of_rows)])
        };
        text += &WORDS.into_iter().fold(template.to_owned(), filled).replace('@', name);
    };
    if has(|operation| matches!(operation, Operation::Sine(_) | Operation::Cosine(_))) {
        add("sarrus_sin_cos", include_str!("sin_cos.c"));
    }
    if has(|operation| matches!(operation, Operation::Angle(..))) {
        add("sarrus_atan2", include_str!("atan2.c"));
    }
    text
}
