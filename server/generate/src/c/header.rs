//! `NAME.h`.

use sarrus_dynamics::{Field, Model, Query, Slot};
use sarrus_proto::Rows;

use crate::Kernel;
use crate::c::comment;

/// Sizes and orders of inputs and outputs.
pub(super) fn header(kernel: &Kernel, model: &Model<f64>, name: &str) -> String {
    let upper = name.to_ascii_uppercase();
    let given = kernel.plan.given();
    let want = kernel.plan.want();
    let mut text = format!(
        "/* {name}: {} of the robot {}, fingerprint {:016x}, {} operations.\n   SI and radians. \
         Written by sarrus. */\n#ifndef {upper}_H\n#define {upper}_H\n\n",
        request(kernel),
        comment(&kernel.info.robot),
        kernel.info.fingerprint,
        kernel.operations(),
    );
    text += &format!("#define {upper}_INPUTS {}\n", kernel.inputs());
    text += &format!("#define {upper}_OUTPUTS {}\n", want.len());
    let closed = closed_inputs(kernel, model, &upper);
    for (what, slots) in [("IN", given.slots()), ("OUT", want.slots())] {
        text += "\n";
        for slot in slots {
            let field = macro_name(slot.field);
            let Slot { offset, rows, columns, .. } = slot;
            let names = names(kernel, slot, what == "OUT");
            text += &format!("/* {}{names} */\n", shape(*rows, *columns));
            text += &format!("#define {upper}_{what}_{field} {offset}\n");
        }
        if what == "IN" {
            text += &closed;
        }
    }
    text + &include_str!("header.h").replace("@UPPER@", &upper).replace("@NAME@", name)
}

/// Inputs that sarrus appends to the given numbers where Newton's method closes a loop.
fn closed_inputs(kernel: &Kernel, model: &Model<f64>, upper: &str) -> String {
    if !kernel.plan.closes_apart() {
        return String::new();
    }
    let mut text = include_str!("closed.h").to_owned();
    let mut offset = kernel.plan.given().len();
    for (k, numbers) in kernel.plan.closed_numbers(model).iter().enumerate() {
        let what = match numbers.name {
            "gain" => "by how much these closures let roundings grow",
            "start" => "where closures start",
            "seed" => "where the steps of a closed form start",
            "q" => "coordinates of dependent joints",
            "cos_sin" => "cosine and sine of joints",
            "G" => "rows of the loop Jacobian",
            "qd" => "velocities of dependent joints",
            _ => "their accelerations without those of the independents",
        };
        let rows = numbers.joints.len();
        let shape = shape(rows, numbers.columns);
        let joints = comment(&numbers.joints.join(" "));
        text += &format!("/* {what}, {shape}: {joints} */\n");
        let name = numbers.name.to_ascii_uppercase();
        text += &format!("#define {upper}_CLOSED_{k}_{name} {offset}\n");
        offset += rows * numbers.columns;
    }
    text
}

pub(crate) fn request(kernel: &Kernel) -> &'static str {
    kernel.plan.query().check(&kernel.info).map_or("a query", |request| request.name())
}

fn shape(rows: usize, columns: usize) -> String {
    if columns == 1 { format!("{rows}") } else { format!("{rows} x {columns}, row by row") }
}

/// The name of a field in macros: in upper case, but as it is where that is another field's too
/// (`G_u` and `g_u`).
fn macro_name(field: Field) -> String {
    let upper = |field: Field| field.name().to_ascii_uppercase();
    let same = Field::ALL.iter().filter(|other| upper(**other) == upper(field)).count();
    if same == 1 { upper(field) } else { field.name().to_owned() }
}

/// The rows of fields, in their order, and the columns of matrices. Wanted fields have the rows of
/// the joints that the query picks.
pub(crate) fn names(kernel: &Kernel, slot: &Slot, is_wanted: bool) -> String {
    use Field::*;
    let info = &kernel.info;
    let query = kernel.plan.query();
    let every = Query { n_joint_runs: 0, ..*query };
    let picked = Rows::of(if is_wanted { query } else { &every }, info);
    let joints = |names: &[String], picked: &[usize]| {
        let names = picked.iter().filter_map(|k| names.get(*k).map(String::as_str));
        names.collect::<Vec<_>>().join(" ")
    };
    let links = |links: &[u16], what: &str| {
        let names = links.iter().filter_map(|k| info.links.get(*k as usize).map(String::as_str));
        format!("{}; {what}", names.collect::<Vec<_>>().join(" "))
    };
    let frames = |what| links(query.frames(), what);
    let rows = match slot.field {
        Y => joints(&info.independent_q, &picked.qy),
        Yd | Ydd | TauY | TauUnactuated | CY | MY => joints(&info.independent, &picked.vy),
        Q | QGuess => joints(&info.tree_q, &picked.q),
        Qd | Qdd | QdGuess | TauQ | G | GBias => joints(&info.tree, &picked.v),
        U | Ud | Udd | TauU | GU | GUBias => joints(&info.active, &picked.u),
        Wrenches => links(query.wrench_links(), "each its moment, then its force"),
        FramePose => frames("each its position, then its quaternion x y z w"),
        FrameTwist | FrameAcc | JdYd => frames("each angular, then linear"),
        JacobianTree | JacobianIndependent | JacobianActuator => {
            frames("each six rows, angular, then linear")
        }
        _ => return String::new(),
    };
    let columns = match slot.field {
        G | GU | MY | JacobianIndependent | ComJacobian | Centroidal => &info.independent,
        JacobianTree => &info.tree,
        JacobianActuator => &info.active,
        _ => return format!(": {}", comment(&rows)),
    };
    comment(&format!(": {rows}; columns: {}", columns.join(" ")))
}
