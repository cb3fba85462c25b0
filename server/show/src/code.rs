//! The functions of a page: generated code, with states on which the page compares it.

use sarrus_dynamics::{ClosureKind, Field, FieldSet, Model, Plan, Query, Request};
use sarrus_generate::{GenerateError, Kernel, Script};
use sarrus_models::Loaded;

use crate::ShowError;

/// Frames of one query.
const FRAMES: usize = 32;
/// States of each function that a page compares.
const STATES: usize = 8;

/// The functions, and the links whose poses they compute.
pub(crate) struct Code {
    /// Declares `pose`, `force` and `frames`: a list of objects of [`Script`], each with its
    /// `states`.
    pub(crate) text: String,
    /// The links of the frames in their order.
    pub(crate) links: Vec<usize>,
    /// Operations of all functions.
    pub(crate) operations: usize,
}

/// Traces the functions of a robot.
pub(crate) fn code(loaded: &Loaded) -> Result<Code, ShowError> {
    let model = &loaded.compiled.model;
    let description = &loaded.description;
    // links that move against their parent
    let moving = |link: &usize| {
        let joint = description.joints.iter().find(|joint| joint.child == *link);
        let is_fixed = |kind| kind == sarrus_dynamics::description::JointKind::Fixed;
        joint.is_some_and(|joint| !is_fixed(joint.kind))
    };
    let named = |link: &usize| {
        let name = &description.links[*link].name;
        model.info().links.iter().position(|other| other == name)
    };
    let links: Vec<usize> = (0..description.links.len()).filter(moving).collect();
    let frames: Vec<u16> = links.iter().filter_map(named).map(|link| link as u16).collect();

    use Field::{FramePose, GU, Q, TauU, U, Y, Yd, Ydd};
    let pose = query(Request::Kinematics, &[Y], &[Q, U, GU]);
    let force = query(Request::InverseDynamics, &[Y, Yd, Ydd], &[TauU]);
    let mut operations = 0;
    let mut text = String::new();
    let mut add = |name: &str, query: &Query| -> Result<(), ShowError> {
        let (script, count) = script(model, query, name)?;
        let states: String =
            script.states.iter().take(STATES).map(|row| format!("  {row},\n")).collect();
        text += &format!("{}{name}.states = [\n{states}];\n", script.function);
        operations += count;
        Ok(())
    };
    add("pose", &pose)?;
    add("force", &force)?;
    let mut list = Vec::new();
    for (k, frames) in frames.chunks(FRAMES).enumerate() {
        let name = format!("frames{k}");
        add(&name, &query(Request::Kinematics, &[Y], &[FramePose]).with_frames(frames))?;
        list.push(name);
    }
    text += &format!("const frames = [{}];\n", list.join(", "));
    Ok(Code { text, links, operations })
}

fn query(request: Request, given: &[Field], want: &[Field]) -> Query {
    Query::new(request, FieldSet::of(given), FieldSet::of(want))
}

fn script(model: &Model<f64>, query: &Query, name: &str) -> Result<(Script, usize), ShowError> {
    let plan = Plan::new(model, query).map_err(GenerateError::from)?;
    if plan.closes_apart() {
        let closures = model.closures().iter();
        let newton = closures.filter(|closure| closure.kind == ClosureKind::Numerical);
        let names: Vec<&str> = newton.map(|closure| closure.name.as_str()).collect();
        return Err(ShowError::Newton { closures: names.join(", ") });
    }
    let kernel = Kernel::trace(model, &plan)?;
    Ok((Script::new(&kernel, model, name), kernel.operations()))
}
