//! Programs with answers: `NAME_test.c`, and the launcher of a device.

use sarrus_dynamics::{Model, Status, Workspace};

use crate::c::literal;
use crate::{Kernel, Outcome};

/// A program that compares answers with those of the generic kernel, from this template.
pub(super) fn filled(template: &str, kernel: &Kernel, model: &Model<f64>, name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let count = kernel.golden.len();
    let mut workspace = Workspace::for_plans(model, [&kernel.plan]);
    let mut output = vec![0.0; kernel.outputs()];
    let mut inputs = String::new();
    let mut outputs = String::new();
    let mut codes = String::new();
    for input in &kernel.golden {
        let code = match kernel.evaluate(input, &mut output) {
            Outcome::Ok => 0,
            Outcome::LimitsExceeded => 1,
            Outcome::NotAnswered => 2,
        };
        // the answer is the generic kernel's, not ours
        let given = &input[..kernel.plan.given().len()];
        let answer = kernel.plan.run(model, &mut workspace, given, &mut output);
        debug_assert!(answer.status == Status::Ok);
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
