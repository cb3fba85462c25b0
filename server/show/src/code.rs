//! The functions of a page: generated code, with states on which the page compares it.

use sarrus_dynamics::description::{JointKind, SubmechanismKind};
use sarrus_dynamics::{ClosureKind, Field, FieldSet, Model, Plan, Query, Request, Workspace};
use sarrus_generate::{GenerateError, Kernel, Outcome, Script, sigma_min};
use sarrus_models::Loaded;

use crate::ShowError;

/// Frames of one query.
pub(crate) const FRAMES: usize = 32;
/// Most links on which a force can act: each makes the code longer.
const TIPS: usize = 2;
/// States of each function that a page compares.
const STATES: usize = 8;

/// The functions, and the links whose poses they compute.
#[derive(Default)]
pub(crate) struct Code {
    /// Declares `pose`, `force` and `frames`: a list of objects of [`Script`], each with its
    /// `states`.
    pub(crate) text: String,
    /// The links of the frames in their order.
    pub(crate) links: Vec<usize>,
    /// Links on which a force can act, by their numbers in queries.
    pub(crate) tips: Vec<u16>,
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
        joint.is_some_and(|joint| joint.kind != JointKind::Fixed)
    };
    let named = |link: &usize| {
        let name = &description.links[*link].name;
        model.info().links.iter().position(|other| other == name)
    };
    let links: Vec<usize> = (0..description.links.len()).filter(moving).collect();
    let frames: Vec<u16> = links.iter().filter_map(named).map(|link| link as u16).collect();

    use Field::{FramePose, GU, Q, QGuess, TauU, U, Y, Yd, Ydd};
    let plain = query(Request::Kinematics, &[Y], &[Q]);
    let plain = Plan::new(model, &plain).map_err(GenerateError::from)?;
    let newton = plain.closes_apart();
    // from a guess Newton's method closes all loops that no closed form does
    let given =
        |fields: &[Field]| if newton { [fields, &[QGuess]].concat() } else { fields.to_vec() };
    let ends = tips(loaded);
    let tips: Vec<u16> = ends.iter().filter_map(named).map(|link| link as u16).collect();
    let mut code = Code { text: String::new(), links, tips, operations: 0 };
    let first = frames.len().min(FRAMES);
    let pose = query(Request::Kinematics, &given(&[Y]), &[Q, U, GU, FramePose]);
    code.add("pose", model, &pose.with_frames(&frames[..first]))?;
    let mut force = query(Request::InverseDynamics, &given(&[Y, Yd, Ydd]), &[TauU]);
    if !code.tips.is_empty() {
        force = force.with_wrenches(&code.tips);
    }
    code.add("force", model, &force)?;
    let mut list = vec!["pose".to_owned()];
    for (k, frames) in frames[first..].chunks(FRAMES).enumerate() {
        let name = format!("frames{k}");
        let query = query(Request::Kinematics, &given(&[Y]), &[FramePose]);
        code.add(&name, model, &query.with_frames(frames))?;
        list.push(name);
    }
    code.text += &format!("const frames = [{}];\n", list.join(", "));
    let (text, operations) = sigma_min(model, &plain, "sigma_min")?;
    code.text += &text;
    code.operations += operations;
    Ok(code)
}

/// The links at the ends of the tree that most independents move: a joint of a submechanism follows
/// all of its independents. Among links of one submechanism the one at most cuts leads, as the
/// platform of legs.
fn tips(loaded: &Loaded) -> Vec<usize> {
    let description = &loaded.description;
    let joints = &description.joints;
    let groups = &description.submechanisms;
    let moved_by = |link: usize| {
        let mut at = link;
        let mut moving: Vec<usize> = Vec::new();
        let mut own = 0;
        while let Some(k) = joints.iter().position(|joint| joint.child == at) {
            for group in groups.iter().filter(|group| group.spanning_tree.contains(&k)) {
                let is_serial = group.kind == SubmechanismKind::Serial;
                moving.extend(group.independent.iter().filter(|joint| !is_serial || **joint == k));
                own += usize::from(group.independent.contains(&k));
            }
            at = joints[k].parent;
        }
        moving.sort_unstable();
        moving.dedup();
        let loops = groups.iter().flat_map(|group| &group.loops);
        let cuts = loops.filter(|of| of.predecessor == link || of.successor == link).count();
        (moving.len(), cuts, own)
    };
    let moving = || joints.iter().filter(|joint| joint.kind != JointKind::Fixed);
    let is_tip = |link: &usize| moving().all(|joint| joint.parent != *link);
    let mut tips: Vec<usize> = moving().map(|joint| joint.child).filter(is_tip).collect();
    tips.sort_by_key(|link| std::cmp::Reverse(moved_by(*link)));
    tips.retain(|link| moved_by(*link).0 > 0);
    tips.truncate(TIPS);
    tips
}

impl Code {
    /// Adds the function of a query, with states; as its `rest` that of the branch at zero, where
    /// the other leaves zero to the plan, as where all forces are zero.
    fn add(&mut self, name: &str, model: &Model<f64>, query: &Query) -> Result<(), ShowError> {
        let plan = Plan::new(model, query).map_err(GenerateError::from)?;
        let kernel = Kernel::trace_for_display(model, &plan)?;
        self.add_kernel(name, model, &kernel)?;
        let zero = vec![0.0; plan.given().len()];
        let closed = plan
            .close(model, &mut Workspace::for_plans(model, [&plan]), &zero)
            .map(<[f64]>::to_vec);
        let left = |closed: &Vec<f64>| {
            kernel.evaluate(closed, &mut vec![0.0; kernel.outputs()]) == Outcome::NotAnswered
        };
        if closed.as_ref().is_some_and(left)
            && let Ok(kernel) = Kernel::trace_at(model, &plan, &zero)
        {
            let rest = format!("{name}_rest");
            self.add_kernel(&rest, model, &kernel)?;
            self.text += &format!("{name}.rest = {rest};\n");
        }
        Ok(())
    }

    fn add_kernel(
        &mut self,
        name: &str,
        model: &Model<f64>,
        kernel: &Kernel,
    ) -> Result<(), ShowError> {
        let script = Script::new(kernel, model, name);
        if !script.closes {
            let closures = model.closures().iter();
            let newton = closures.filter(|closure| closure.kind == ClosureKind::Numerical);
            let names: Vec<&str> = newton.map(|closure| closure.name.as_str()).collect();
            return Err(ShowError::Newton(names.join(", ")));
        }
        let states = script.states.iter().take(STATES).map(|row| format!("  {row},\n"));
        let states: String = states.collect();
        self.text += &format!("{}{name}.states = [\n{states}];\n", script.function);
        self.operations += script.operations;
        Ok(())
    }
}

fn query(request: Request, given: &[Field], want: &[Field]) -> Query {
    Query::new(request, FieldSet::of(given), FieldSet::of(want))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use sarrus_models::{Options, Source, load};

    use super::*;

    #[test]
    fn a_force_acts_on_the_link_that_all_motors_move() {
        for (robot, first) in [
            ("delta", "platform"),
            ("lambda", "Elbow_Link"),
            ("active_ankle", "foot"),
            ("stewart", "HipRotZ_Link"),
        ] {
            let loaded = load(&Source::Bundled(robot.to_owned()), &Options::default()).unwrap();
            let tips = tips(&loaded);
            let names: Vec<&str> =
                tips.iter().map(|link| loaded.description.links[*link].name.as_str()).collect();
            println!("{robot}: {names:?}");
            assert_eq!(names[0], first);
        }
    }
}
