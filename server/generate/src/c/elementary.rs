//! Sine, cosine and arc tangent in C, of one number or of a number of several states.

use crate::Kernel;
use crate::graph::Operation;

/// Replacements of the templates' words for a single number.
const OF_ONE: [(&str, &str); 10] = [
    ("NAME", "@"),
    ("REAL", "double"),
    ("MASK", "int"),
    ("FMA(", "fma("),
    ("SAME(", "("),
    ("CHOOSE(", "sarrus_choose("),
    ("ABSOLUTE(", "fabs("),
    ("XOR_SIGN(", "sarrus_xor_sign("),
    ("BITS_OF(", "sarrus_bits("),
    ("BITS", "uint64_t"),
];
/// Replacements of the templates' words for rows.
const OF_ROWS: [(&str, &str); 10] = [
    ("NAME", "@_rows"),
    ("REAL", "sarrus_rows"),
    ("MASK", "sarrus_lanes"),
    ("FMA(", "sarrus_fma("),
    ("SAME(", "sarrus_same("),
    ("CHOOSE(", "sarrus_choose_rows("),
    ("ABSOLUTE(", "sarrus_absolute("),
    ("XOR_SIGN(", "sarrus_xor_sign_rows("),
    ("BITS_OF(", "(sarrus_lanes)("),
    ("BITS", "sarrus_lanes"),
];

/// The elementary functions that a kernel uses.
pub(super) fn elementary(kernel: &Kernel, of_rows: bool) -> String {
    let has = |is: fn(&Operation) -> bool| kernel.operations.iter().any(is);
    let mut text = String::new();
    let words = if of_rows { OF_ROWS } else { OF_ONE };
    let mut add = |name: &str, template: &str| {
        let filled = |text: String, (word, with): (&str, &str)| text.replace(word, with);
        text += &words.into_iter().fold(template.to_owned(), filled).replace('@', name);
    };
    if has(|operation| matches!(operation, Operation::Sine(_) | Operation::Cosine(_))) {
        add("sarrus_sin_cos", include_str!("sin_cos.c"));
    }
    if has(|operation| matches!(operation, Operation::Angle(..))) {
        add("sarrus_atan2", include_str!("atan2.c"));
    }
    text
}
