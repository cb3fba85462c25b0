//! Whether links and joints form one tree.

use super::Urdf;
use crate::report::{Diagnostics, quoted};

/// Checks the tree and returns for each link whether no joint has it as its child.
pub(super) fn check(urdf: &Urdf, diagnostics: &mut Diagnostics) -> Vec<bool> {
    if urdf.links.is_empty() {
        diagnostics.error(urdf.span, "the robot has no link", "at least one", "add links");
    }
    // the joint above each link
    let mut above: Vec<Option<usize>> = vec![None; urdf.links.len()];
    let mut parents: Vec<Option<usize>> = vec![None; urdf.joints.len()];
    for (j, joint) in urdf.joints.iter().enumerate() {
        let [parent, child] =
            [(&joint.parent, "parent"), (&joint.child, "child")].map(|(end, what)| {
                let (name, span) = end.as_ref()?;
                let index = urdf.link_index.get(name).copied();
                if index.is_none() {
                    let found = format!(
                        "the {what} link {} of joint {} does not exist",
                        quoted(name),
                        quoted(&joint.name)
                    );
                    let help = diagnostics.did_you_mean(
                        name,
                        urdf.link_names(),
                        "correct the name or add the link",
                    );
                    let expected =
                        diagnostics.one_of("a link of this file", name, urdf.link_names());
                    diagnostics.error(*span, found, expected, help);
                }
                index
            });
        if let Some(slot) = parents.get_mut(j) {
            *slot = parent;
        }
        let Some(slot) = child.and_then(|child| above.get_mut(child)) else { continue };
        match slot.and_then(|first| urdf.joints.get(first)) {
            None => *slot = Some(j),
            Some(first) => {
                let (name, span) = joint.child.clone().unwrap_or((String::new(), joint.span));
                let found = format!(
                    "the link {} has two parents, by the joints {} and {}",
                    quoted(&name),
                    quoted(&first.name),
                    quoted(&joint.name)
                );
                diagnostics.error(
                    span,
                    found,
                    "one",
                    "cut the loop here and write it as a loop constraint",
                );
            }
        }
    }

    // roots
    let roots: Vec<usize> = above
        .iter()
        .enumerate()
        .filter(|(_, joint)| joint.is_none())
        .map(|(link, _)| link)
        .collect();
    let whole = urdf.joints.iter().all(|joint| {
        joint.child.as_ref().is_some_and(|(name, _)| urdf.link_index.contains_key(name))
    });
    if let [first, others @ ..] = roots.as_slice()
        && whole
    {
        let first = urdf.links.get(*first).map(|link| quoted(&link.name)).unwrap_or_default();
        // a link of a second name cannot be connected and has been reported
        let named = |i: &&usize| {
            urdf.links.get(**i).is_some_and(|link| urdf.link_index.get(&link.name) == Some(*i))
        };
        for link in others.iter().filter(named).filter_map(|other| urdf.links.get(*other)) {
            let found = format!("the link {} is a second root beside {first}", quoted(&link.name));
            diagnostics.error(link.span, found, "one root", "connect it by a joint or remove it");
        }
    }

    // cycles: walk up from every link; 0 is unknown, 1 on this walk, 2 done
    let mut state = vec![0_u8; urdf.links.len()];
    for start in 0..urdf.links.len() {
        let mut walk = Vec::new();
        let mut link = Some(start);
        while let Some(i) = link.filter(|i| state.get(*i) == Some(&0)) {
            state[i] = 1;
            walk.push(i);
            link = above[i].and_then(|joint| parents.get(joint).copied().flatten());
        }
        if let Some(joint) = link
            .filter(|i| state.get(*i) == Some(&1))
            .and_then(|i| above[i])
            .and_then(|joint| urdf.joints.get(joint))
        {
            let found = format!("the joint {} closes a cycle of links", quoted(&joint.name));
            diagnostics.error(
                joint.span,
                found,
                "a tree",
                "cut the loop and write it as a loop constraint",
            );
        }
        walk.into_iter().for_each(|i| state[i] = 2);
    }
    above.iter().map(Option::is_none).collect()
}
