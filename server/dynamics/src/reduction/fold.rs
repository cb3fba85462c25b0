//! The description of a robot with joints held at some pose: the positions are folded into origins,
//! couplings and cuts.

use std::collections::BTreeMap;

use sarrus_proto::ClosureKind;

use crate::compile::{Structure, curve_at};
use crate::description::{
    Coupling, Curve, Description, JointKind, Loop, Submechanism, SubmechanismKind, Terms,
};
use crate::diagnostic::{CompileError, Diagnostic, Site};
use crate::initial_pose::{has_moved, moved, placed};
use crate::model::Model;
use crate::reduction::choice::Choice;
use crate::reduction::pose::Held;

/// For each remaining submechanism its index in the whole robot, and the same for its loops.
type Origins = Vec<(usize, Vec<usize>)>;

/// The robot with the held joints fixed.
pub(super) fn fold(
    description: &Description,
    structure: &Structure,
    choices: &[Choice],
    held: &Held,
) -> Result<(Description, Origins), CompileError> {
    let mut next = description.clone();
    for (&j, q) in &held.fixed {
        let joint = &mut next.joints[j];
        if let Some(origin) = moved(&description.joints[j], q) {
            joint.origin = origin;
        }
        (joint.kind, joint.limits) = (JointKind::Fixed, None);
        joint.terms = Terms::default();
    }
    couplings(description, choices, held, &mut next)?;
    next.zero_pose.retain(|(j, _)| {
        let c = structure.cluster_of[*j];
        choices.iter().all(|of| Some(of.cluster) != c)
    });
    next.zero_pose.extend(held.elsewhere.iter().cloned());
    next.zero_pose.sort_by_key(|(j, _)| *j);

    next.submechanisms.clear();
    let mut origins = Origins::new();
    for s in 0..description.submechanisms.len() {
        let (of, loops) = submechanism(description, structure, choices, held, s);
        if !of.spanning_tree.is_empty() {
            next.submechanisms.push(of);
            origins.push((s, loops));
        }
    }
    // cuts in frames of the old zero pose stay where they were on both links
    let joints = Description { submechanisms: Vec::new(), ..next.clone() };
    for cycle in next.submechanisms.iter_mut().flat_map(|of| &mut of.loops) {
        if has_moved(description, &joints, cycle)
            && let Some(cut) = placed(description, cycle)
        {
            cycle.cut = cut;
        }
    }
    Ok((next, origins))
}

/// The rest of a submechanism, and the loops that it keeps.
fn submechanism(
    description: &Description,
    structure: &Structure,
    choices: &[Choice],
    held: &Held,
    s: usize,
) -> (Submechanism, Vec<usize>) {
    let mut of = description.submechanisms[s].clone();
    let chosen = |j: &usize| {
        choices.iter().find(|of| structure.cluster_of[*j] == Some(of.cluster) && of.closed)
    };
    // its loops in words where its type does not define them any more
    let paths = &structure.paths[s];
    let is_touched =
        of.spanning_tree.iter().chain(paths.iter().flatten()).any(|j| chosen(j).is_some());
    let mut loops: Vec<usize> = (0..of.loops.len()).collect();
    if is_touched {
        let is_left = |l: &usize| {
            paths[*l].is_empty() || paths[*l].iter().any(|j| !held.fixed.contains_key(j))
        };
        loops = (0..structure.loops[s].len()).filter(is_left).collect();
        let cycle = |l: &usize| -> Loop { structure.loops[s][*l].clone() };
        of.loops = loops.iter().map(cycle).collect();
    }
    // a mechanism that is left with fewer degrees of freedom has no type, but for a platform on
    // fewer axes
    let is_other = |j: &usize| {
        chosen(j).is_some_and(|of| !of.independent.is_empty() && structure.has_loop(of.cluster))
    };
    let is_changed = of.spanning_tree.iter().any(is_other);
    let is_platform = matches!(
        of.kind,
        SubmechanismKind::Spu2U1 | SubmechanismKind::Sprr2U1 | SubmechanismKind::Ups6
    );
    if is_changed && !is_platform {
        set_numerical(&mut of);
    }
    let is_dropped = |j: &usize| choices.iter().any(|of| of.dropped.contains(j));
    for list in [&mut of.spanning_tree, &mut of.independent, &mut of.active] {
        list.retain(|j| !held.fixed.contains_key(j));
    }
    of.independent.retain(|j| !is_dropped(j));
    (of, loops)
}

/// Platforms that are closed by their closed form no more are closed numerically.
pub(super) fn recognise(next: &mut Description, held: &Held) {
    let is_touched = |of: &Submechanism| {
        let is_remaining = |j: &usize| held.remaining.iter().any(|other| other.0 == *j);
        of.kind != SubmechanismKind::Numerical
            && !of.loops.is_empty()
            && of.spanning_tree.iter().any(is_remaining)
    };
    if !next.submechanisms.iter().any(is_touched) {
        return;
    }
    let kinds: Vec<ClosureKind> = Model::compile(next)
        .map(|compiled| compiled.model.closures().iter().map(|of| of.kind).collect())
        .unwrap_or_default();
    for (s, of) in next.submechanisms.iter_mut().enumerate() {
        if is_touched(of) && kinds.get(s) != Some(&ClosureKind::Analytic) {
            set_numerical(of);
        }
    }
}

fn set_numerical(of: &mut Submechanism) {
    of.kind = SubmechanismKind::Numerical;
    of.type_name = "NUMERICAL".into();
}

/// Couplings among the joints that are left: a held follower hands its relation to another joint of
/// it.
fn couplings(
    description: &Description,
    choices: &[Choice],
    held: &Held,
    next: &mut Description,
) -> Result<(), CompileError> {
    let is_free = |j: &usize| choices.iter().any(|of| of.independent.contains(j));
    let mut handed: BTreeMap<usize, Coupling> = BTreeMap::new();
    for (f, joint) in description.joints.iter().enumerate() {
        let Some(coupling) = &joint.coupling else { continue };
        let (fixed, left): (Vec<(usize, f64)>, Vec<(usize, f64)>) =
            coupling.terms.iter().copied().partition(|(j, _)| held.at.contains_key(j));
        let constant: f64 = fixed.iter().map(|(j, x)| x * held.at[j]).sum();
        let (still, curves): (Vec<_>, Vec<_>) =
            coupling.curves.iter().cloned().partition(|(j, _)| held.at.contains_key(j));
        let value = |(j, f): &(usize, Curve)| curve_at(f, held.at[j])[0];
        let offset = coupling.offset + constant + still.iter().map(value).sum::<f64>();
        let Some(position) = held.at.get(&f) else {
            next.joints[f].coupling = Some(Coupling { terms: left, offset, curves });
            continue;
        };
        next.joints[f].coupling = None;
        if left.is_empty() && curves.is_empty() {
            continue;
        }
        // q_f = Σ m q + offset, for one of the others
        let own = |j: &usize| description.joints[*j].coupling.is_some() || handed.contains_key(j);
        let mut others = left.iter().filter(|_| curves.is_empty());
        let Some(&(to, m)) = others.find(|(j, m)| *m != 0.0 && !is_free(j) && !own(j)) else {
            let error = Diagnostic::new(
                Site::Joint(f),
                format!("a lock of {}, whose coupling no other joint can have", joint.name),
                "a joint that it follows and that follows no other",
                "lock the joints that it follows instead",
            );
            return Err(CompileError::of(vec![error]));
        };
        let terms = left.iter().filter(|of| of.0 != to).map(|(j, x)| (*j, -x / m)).collect();
        handed.insert(to, Coupling { terms, offset: (position - offset) / m, curves });
    }
    for (j, coupling) in handed {
        next.joints[j].coupling = Some(coupling);
    }
    Ok(())
}
