//! Programs with answers: `NAME_test.c`, and the launcher of a device.

use sarrus_dynamics::Model;

use crate::Kernel;
use crate::c::literal;

/// A program that compares answers with those of the generic kernel, from this template.
pub(super) fn filled(template: &str, kernel: &Kernel, model: &Model<f64>, name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let count = kernel.golden.len();
    let mut inputs = String::new();
    let mut outputs = String::new();
    let mut codes = String::new();
    for (code, input, output) in kernel.answers(model) {
        let row: Vec<String> = input.iter().map(|x| literal(*x)).collect();
        inputs += &format!("    {{{}}},\n", or_zero(row.join(", ")));
        let row: Vec<String> =
            output.iter().map(|x| format!("UINT64_C(0x{:016x})", x.to_bits())).collect();
        outputs += &format!("    {{{}}},\n", or_zero(row.join(", ")));
        codes += &format!("{code}, ");
    }
    template
        .replace("@NAME@", name)
        .replace("@UPPER@", &upper)
        .replace("@COUNT@", &count.to_string())
        .replace("@IN@", &kernel.inputs().max(1).to_string())
        .replace("@OUT@", &kernel.outputs().max(1).to_string())
        .replace("@CODES@", codes.trim_end_matches(", "))
        .replace("@INPUTS@", &inputs)
        .replace("@OUTPUTS@", &outputs)
}

fn or_zero(list: String) -> String {
    if list.is_empty() { "0".to_owned() } else { list }
}
