//! Restricts a robot to some of its branches.

use crate::compile::Structure;
use crate::description::{Coupling, Cut, Description, Joint, Submechanism};
use crate::diagnostic::CompileError;
use crate::initial_pose::placed;
use crate::reduction::Reduced;

/// The robot restricted to some links and the dependencies of their motion: the joints on the path
/// to the root, the mechanisms that these belong to, and all links fixed to one of these. All other
/// branches are removed with their mass. Allocates.
///
/// # Errors
/// Faults of the structure, as of [`crate::OpenModel::compile`].
pub fn restricted(description: &Description, links: &[usize]) -> Result<Reduced, CompileError> {
    let structure = Structure::of(description)?;
    let moving = needed(description, &structure, links);
    let is_link = |link: usize| structure.carrier[link].is_none_or(|j| moving[j]);
    // a joint is that of its child link
    let kept = |count: usize, is_kept: &dyn Fn(usize) -> bool| -> (Vec<usize>, Vec<usize>) {
        let kept: Vec<usize> = (0..count).filter(|i| is_kept(*i)).collect();
        let mut new = vec![usize::MAX; count];
        kept.iter().enumerate().for_each(|(at, i)| new[*i] = at);
        (kept, new)
    };
    let (links, new_link) = kept(description.links.len(), &is_link);
    let (joints, new_joint) =
        kept(description.joints.len(), &|j| is_link(description.joints[j].child));
    let renamed = |j: &usize| Some(new_joint[*j]).filter(|j| *j != usize::MAX);

    let mut submechanisms = Vec::new();
    let mut parts = Vec::new();
    for (s, of) in description.submechanisms.iter().enumerate() {
        let lists = [&of.spanning_tree, &of.independent, &of.active];
        let [spanning_tree, independent, active] =
            lists.map(|list| list.iter().filter_map(renamed).collect::<Vec<usize>>());
        if spanning_tree.is_empty() && !of.spanning_tree.is_empty() {
            continue;
        }
        let is_kept = |l: &usize| {
            let ends = [of.loops[*l].predecessor, of.loops[*l].successor];
            ends.into_iter().all(is_link) && structure.paths[s][*l].iter().all(|j| moving[*j])
        };
        let kept: Vec<usize> = (0..of.loops.len()).filter(is_kept).collect();
        let mut loops = Vec::new();
        for &l in &kept {
            let mut cycle = of.loops[l].clone();
            cycle.cut = match cycle.cut {
                Cut::AtJoint(j) if renamed(&j).is_some() => Cut::AtJoint(new_joint[j]),
                Cut::AtLink(link) if is_link(link) => Cut::AtLink(new_link[link]),
                _ => placed(description, &cycle).unwrap_or(cycle.cut),
            };
            cycle.predecessor = new_link[cycle.predecessor];
            cycle.successor = new_link[cycle.successor];
            loops.push(cycle);
        }
        submechanisms.push(Submechanism {
            spanning_tree,
            independent,
            active,
            loops,
            ..of.clone()
        });
        parts.push((s, kept));
    }
    let joint = |j: &usize| {
        let joint = &description.joints[*j];
        let coupling = joint.coupling.as_ref().map(|of| Coupling {
            terms: of.terms.iter().map(|(j, x)| (new_joint[*j], *x)).collect(),
            offset: of.offset,
            curves: of.curves.iter().map(|(j, f)| (new_joint[*j], f.clone())).collect(),
        });
        let parent = new_link[joint.parent];
        let child = new_link[joint.child];
        Joint { parent, child, coupling, ..joint.clone() }
    };
    let position = |(j, q): &(usize, Vec<f64>)| Some((renamed(j)?, q.clone()));
    let description = Description {
        name: description.name.clone(),
        links: links.iter().map(|link| description.links[*link].clone()).collect(),
        joints: joints.iter().map(joint).collect(),
        submechanisms,
        gravity: description.gravity,
        zero_pose: description.zero_pose.iter().filter_map(position).collect(),
    };
    Ok(Reduced { description, warnings: Vec::new(), links, joints, submechanisms: parts })
}

/// For each joint whether the motion of some links depends on it.
fn needed(description: &Description, structure: &Structure, links: &[usize]) -> Vec<bool> {
    let mut needed = vec![false; description.joints.len()];
    let mut open: Vec<usize> =
        links.iter().filter_map(|link| *structure.carrier.get(*link)?).collect();
    while let Some(j) = open.pop() {
        if std::mem::replace(&mut needed[j], true) {
            continue;
        }
        open.extend(structure.parent[j]);
        if let Some(c) = structure.cluster_of[j] {
            open.extend(structure.clusters[c].iter().filter(|j| !needed[**j]));
        }
    }
    needed
}
