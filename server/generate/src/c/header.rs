//! `NAME.h`.

use sarrus_dynamics::{Field, ModelInfo, Slot};

use crate::Kernel;
use crate::c::comment;

/// Sizes and orders of what goes in and comes out.
pub(super) fn header(kernel: &Kernel, name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let (given, want) = (kernel.plan.given(), kernel.plan.want());
    let mut text = format!(
        "/* {name}: {} of the robot {}, fingerprint {:016x}, {} operations.\n   SI and radians. \
         Written by sarrus. */\n#ifndef {upper}_H\n#define {upper}_H\n\n",
        request(kernel),
        comment(&kernel.info.robot),
        kernel.info.fingerprint,
        kernel.operations(),
    );
    text += &format!("#define {upper}_INPUTS {}\n", given.len());
    text += &format!("#define {upper}_OUTPUTS {}\n", want.len());
    for (what, slots) in [("IN", given.slots()), ("OUT", want.slots())] {
        text += "\n";
        for slot in slots {
            let field = slot.field.name().to_ascii_uppercase();
            let Slot { offset, rows, columns, .. } = slot;
            text += &format!("/* {}{} */\n", shape(*rows, *columns), names(&kernel.info, slot));
            text += &format!("#define {upper}_{what}_{field} {offset}\n");
        }
    }
    text += &format!(
        "\n/* what the function returns */\n#define {upper}_OK 0\n/* some coordinate, velocity or \
         force is outside of its limits; the numbers are right */\n#define {upper}_LIMITS_EXCEEDED \
         1\n/* ask the generic kernel: the numbers are none */\n#define {upper}_NOT_ANSWERED 2\n\n"
    );
    text += "#ifdef __cplusplus\nextern \"C\" {\n#endif\n\n";
    text += &format!(
        "/* in[{upper}_INPUTS], out[{upper}_OUTPUTS]; no memory, no state, one branch at\n   \
         the end: without an answer out is NaN */\nint \
         {name}(const double *in, double *out);\n\n"
    );
    text += "#ifdef __cplusplus\n}\n#endif\n\n#endif\n";
    text
}

fn request(kernel: &Kernel) -> &'static str {
    kernel.plan.query().check(&kernel.info).map_or("a query", |request| request.name())
}

fn shape(rows: usize, columns: usize) -> String {
    if columns == 1 { format!("{rows}") } else { format!("{rows} x {columns}, row by row") }
}

/// The names of the rows, where they are those of the whole robot.
fn names(info: &ModelInfo, slot: &Slot) -> String {
    use Field::*;
    let list = match slot.field {
        Y => &info.independent_q,
        Yd | Ydd | TauY | TauUnactuated | CY | MY => &info.independent,
        Q => &info.tree_q,
        Qd | Qdd | TauQ | G | GBias => &info.tree,
        U | Ud | Udd | TauU | GU | GUBias => &info.active,
        _ => return String::new(),
    };
    if list.len() == slot.rows { format!(": {}", comment(&list.join(" "))) } else { String::new() }
}
