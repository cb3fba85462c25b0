//! The spanning tree of a model, and the cuts of its loops.

use std::collections::BTreeMap;

use super::Robot;
use super::joint::Draft;
use crate::mjcf::body::{Body, Joint, Kind, Tree};
use crate::mjcf::equality::Cut;
use crate::pose::Pose;
use crate::report::quoted;
use crate::rotation::rotated;

impl Robot<'_, '_> {
    /// The tree and the cuts.
    pub(super) fn tree(mut self) -> (Tree, Vec<Cut>) {
        let joints = std::mem::take(&mut self.joints);
        let drafts: Vec<Draft> =
            joints.into_iter().filter_map(|(of, scope)| self.draft(of, &scope)).collect();
        for (name, span) in &self.driven {
            let found = format!("a plug-in drives {}, which is no joint", quoted(name));
            self.diagnostics.dynamics(*span, found, "a joint", "correct the name");
        }
        let (above, closing) = spanning(&drafts, self.links.len());
        let up = |link: usize| above[link].map_or(0, |j| drafts[j].ends[0]);
        let n_free = above.iter().skip(1).filter(|of| of.is_none()).count();
        let mut tree = Tree { bodies: Vec::new(), joints: Vec::new(), sites: BTreeMap::new() };
        let mut bodies = vec![0; self.links.len()];
        let mut below = vec![Vec::new(); self.links.len()];
        (1..above.len()).rev().for_each(|link| below[up(link)].push(link));
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            open.extend(&below[at]);
            let link = &self.links[at];
            let inner = self.links[up(at)].pose.inverse().then(link.pose);
            let mut body = Body::new(link.name.clone(), link.span, bodies[up(at)], inner);
            body.inertial = link.inertial;
            bodies[at] = tree.bodies.len();
            tree.bodies.push(body);
            if let Some(j) = above[at] {
                drafts[j].joints.iter().for_each(|of| {
                    tree.add_joint(placed(of, drafts[j].at, link.pose, bodies[at]));
                });
            } else if at > 0 {
                let free = format!("{}/free", link.name);
                let free = if n_free == 1 { "floating_base".to_owned() } else { free };
                let found = format!("the joint {} moves a free link", quoted(&free));
                self.diagnostics.note(link.span, found, "fix it by a joint on the world");
                let joint = Joint::new(free, link.span, Kind::Free);
                tree.add_joint(Joint { body: bodies[at], ..joint });
            }
        }
        self.check_couplings(&tree);
        let cuts = closing.iter().filter_map(|j| self.cut(&drafts[*j], &bodies)).collect();
        (tree, cuts)
    }

    /// Reports couplings to joints that are not in the tree.
    fn check_couplings(&mut self, tree: &Tree) {
        let followers = tree.joints.iter().filter_map(|of| Some((of, &of.coupling.as_ref()?.0)));
        for (joint, (leader, _)) in followers.flat_map(|(of, all)| all.iter().map(move |t| (of, t)))
        {
            let found = tree.joint(leader).and_then(|j| tree.joints.get(j));
            if !found.is_some_and(|of| of.is_single() && of.held.is_none()) {
                let found = format!("{} follows {}", quoted(&joint.name), quoted(leader));
                self.fault(joint.span, found, "a joint of one axis in the tree");
            }
        }
    }

    /// A joint that closes a loop.
    fn cut(&mut self, draft: &Draft, bodies: &[usize]) -> Option<Cut> {
        let name = quoted(&draft.name);
        let span = draft.joints.first()?.span;
        if draft.acts() || draft.cut.is_none() {
            let found = format!("{name} closes a loop, and is more than a plain joint");
            let expected = "no damping, spring, rotor, coupling, thread and actuator";
            let help = "write it before the other joint of its child";
            self.diagnostics.dynamics(span, found, expected, help);
        }
        let is_limited = |of: &Joint| of.range.is_some() || of.terms.friction.coulomb != 0.0;
        if draft.joints.iter().any(is_limited) {
            let found = format!("the closing joint {name} has a range or dry friction");
            let help = "they are left out: limit another joint of its loop";
            self.diagnostics.warning(span, found, "none", help);
        }
        let places = draft.ends.map(|link| self.links[link].pose.inverse().then(draft.at));
        let places = places.map(Pose::placement);
        let ends = draft.ends.map(|link| bodies[link]);
        Some(Cut { name: draft.name.clone(), span, bodies: ends, places, joint: draft.cut? })
    }
}

/// The joint above each link, and the joints that close loops.
fn spanning(drafts: &[Draft], n_links: usize) -> (Vec<Option<usize>>, Vec<usize>) {
    let mut above: Vec<Option<usize>> = vec![None; n_links];
    let mut closing = Vec::new();
    let mut order: Vec<usize> = (0..drafts.len()).collect();
    let has_range = |j: usize| drafts[j].joints.iter().any(|of| of.range.is_some());
    order.sort_by_key(|j| (!drafts[*j].acts(), !has_range(*j)));
    for j in order {
        let [parent, child] = drafts[j].ends;
        let mut up = Some(parent);
        while let Some(link) = up.filter(|link| *link != child) {
            up = above[link].map(|j: usize| drafts[j].ends[0]);
        }
        if up.is_some() || above[child].is_some() {
            closing.push(j);
        } else {
            above[child] = Some(j);
        }
    }
    closing.sort_unstable();
    (above, closing)
}

/// A joint with its anchor and axis in a body, of which `link` is the pose.
fn placed(of: &Joint, at: Pose, link: Pose, body: usize) -> Joint {
    // an anchor in the origin of the link, but for rounding
    let rounding = 1e-15 * link.p.iter().fold(1.0_f64, |size, x| size.max(x.abs()));
    let pos = link.inverse().apply(at.p).map(|x| if x.abs() <= rounding { 0.0 } else { x });
    let pos = if of.held.is_some() { [0.0; 3] } else { pos };
    Joint { body, pos, axis: rotated(link.inverse().r, of.axis), ..of.clone() }
}
