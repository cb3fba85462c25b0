//! The distance to singularity, `sigma_min`, in JavaScript: the scaled K_d as generated code, and
//! its least singular value (`singular.js`).

use sarrus_dynamics::{Model, Plan, Workspace};

use super::{compiled, head};
use crate::recorder::Traced;
use crate::trace::recorded;
use crate::{GenerateError, Lengths};

/// A script that declares a function of this name: `sigma_min` at closed tree coordinates, those
/// that a plan with `q` puts out; with the number of its operations before singular values. The
/// plan is any of the model that answers at this input. Allocates.
///
/// # Errors
/// [`GenerateError`]: the residual of some loop is no straight-line code.
pub fn sigma_min(
    model: &Model<f64>,
    plan: &Plan,
    name: &str,
) -> Result<(String, usize), GenerateError> {
    let sizes = Plan::loop_sizes(model);
    let count = sizes.iter().map(|m| m * m).sum();
    let (zero, _) = Plan::newton_start(model);
    let q = Plan::tree_order(model, &zero);
    let run = |model: &Model<Traced>, workspace: &mut Workspace<Traced>, q: &[Traced]| {
        let mut output = vec![Traced::constant(0.0); count];
        Plan::scaled_loops(model, workspace, q, &mut output);
        Some(output)
    };
    let loops = recorded(model, plan, &Lengths::default(), &q, false, run)?;
    let text = format!(
        "const {name} = (() => {{\n\"use strict\";\n{}\nconst sizes = {sizes:?};\n\
         const loops = {};\n{}return sigma;\n}})();\n",
        head(),
        compiled(&loops),
        include_str!("singular.js"),
    );
    Ok((text, loops.operations()))
}
