//! Whether links and joints form one tree.

use super::Urdf;
use super::joint::JointEntry;
use crate::report::{Diagnostics, quoted};

/// Checks the tree and returns for each link whether no joint has it as its child.
pub(super) fn check(urdf: &Urdf, diagnostics: &mut Diagnostics) -> Vec<bool> {
    if urdf.links.is_empty() {
        diagnostics.error(urdf.span, "the robot has no link", "at least one", "add links");
    }
    let above = connect(urdf, diagnostics);
    let is_root: Vec<bool> = above.iter().map(Option::is_none).collect();
    check_roots(urdf, &is_root, diagnostics);
    check_cycles(urdf, &above, diagnostics);
    is_root
}

/// The joint above each link; reports unknown links and links with two parents.
fn connect(urdf: &Urdf, diagnostics: &mut Diagnostics) -> Vec<Option<usize>> {
    let mut above: Vec<Option<usize>> = vec![None; urdf.links.len()];
    for (j, joint) in urdf.joints.iter().enumerate() {
        let [_, child] = ["parent", "child"].map(|end| link_at(urdf, joint, end, diagnostics));
        let Some(slot) = child.and_then(|child| above.get_mut(child)) else { continue };
        match slot.and_then(|first| urdf.joints.get(first)) {
            None => *slot = Some(j),
            Some(first) => {
                let (name, span) = joint.child.clone().unwrap_or((String::new(), joint.span));
                let [name, a, b] = [&name, &first.name, &joint.name].map(|name| quoted(name));
                let found = format!("the link {name} has two parents, by the joints {a} and {b}");
                let help = "cut the loop here and write it as a loop constraint";
                diagnostics.error(span, found, "one", help);
            }
        }
    }
    above
}

/// The link at an end of a joint; `None` after an error.
fn link_at(
    urdf: &Urdf,
    joint: &JointEntry,
    end: &str,
    diagnostics: &mut Diagnostics,
) -> Option<usize> {
    let written = if end == "parent" { &joint.parent } else { &joint.child };
    let (name, span) = written.as_ref()?;
    let index = urdf.link_index.get(name).copied();
    if index.is_none() {
        let [link, joint] = [name, &joint.name].map(|name| quoted(name));
        let found = format!("the {end} link {link} of joint {joint} does not exist");
        let expected = diagnostics.one_of("a link of this file", name, urdf.link_names());
        let help = "correct the name or add the link";
        diagnostics.unknown(*span, found, expected, name, urdf.link_names(), help);
    }
    index
}

/// Reports every root but the first, where all children are known.
fn check_roots(urdf: &Urdf, is_root: &[bool], diagnostics: &mut Diagnostics) {
    let whole = urdf.joints.iter().all(|joint| {
        joint.child.as_ref().is_some_and(|(name, _)| urdf.link_index.contains_key(name))
    });
    // a link of a second name cannot be connected and has been reported
    let is_named = |i: usize| urdf.link_index.get(&urdf.links[i].name) == Some(&i);
    let mut roots = (0..urdf.links.len()).filter(|i| is_root[*i]);
    let Some(first) = roots.next().filter(|_| whole) else { return };
    let first = quoted(&urdf.links[first].name);
    for link in roots.filter(|i| is_named(*i)).map(|i| &urdf.links[i]) {
        let found = format!("the link {} is a second root beside {first}", quoted(&link.name));
        diagnostics.error(link.span, found, "one root", "connect it by a joint or remove it");
    }
}

/// Reports one joint of each cycle, by a walk up from every link.
fn check_cycles(urdf: &Urdf, above: &[Option<usize>], diagnostics: &mut Diagnostics) {
    // 0 is unknown, 1 on this walk, 2 done
    let mut state = vec![0_u8; urdf.links.len()];
    for start in 0..urdf.links.len() {
        let mut walk = Vec::new();
        let mut link = Some(start);
        while let Some(i) = link.filter(|i| state.get(*i) == Some(&0)) {
            state[i] = 1;
            walk.push(i);
            link = above[i].and_then(|joint| urdf.link_at(&urdf.joints[joint].parent));
        }
        if let Some(joint) = link
            .filter(|i| state.get(*i) == Some(&1))
            .and_then(|i| above[i])
            .and_then(|joint| urdf.joints.get(joint))
        {
            let found = format!("the joint {} closes a cycle of links", quoted(&joint.name));
            let help = "cut the loop and write it as a loop constraint";
            diagnostics.error(joint.span, found, "a tree", help);
        }
        walk.into_iter().for_each(|i| state[i] = 2);
    }
}
