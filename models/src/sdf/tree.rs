//! The spanning tree of a model, and the cuts of its loops.

use std::collections::BTreeMap;

use super::joint::{Axis, Draft, Kind};
use super::{Link, Robot};
use crate::mjcf::body::{Body, Joint, Kind as Motion, Tree};
use crate::mjcf::equality::Cut;
use crate::pose::Pose;
use crate::report::{Diagnostics, quoted};
use crate::rotation::rotated;
use sarrus_dynamics::description::Terms;

impl Robot<'_, '_> {
    /// The tree and the cuts.
    pub(super) fn tree(mut self) -> (Tree, Vec<Cut>) {
        let drafts = self.drafts();
        let Robot { links, driven, diagnostics, .. } = self;
        for (name, span) in driven {
            let found = format!("a plug-in drives {}, which is no joint of a link", quoted(&name));
            diagnostics.dynamics(span, found, "a joint", "correct the name");
        }
        let (above, closing) = spanning(&drafts, links.len());
        let mut below = vec![Vec::new(); links.len()];
        for (link, joint) in above.iter().enumerate().skip(1).rev() {
            below[joint.map_or(0, |j| drafts[j].ends[0])].push(link);
        }
        let world = Body::new(links[0].name.clone(), links[0].span, 0, Pose::NONE);
        let mut tree = Tree { bodies: vec![world], joints: Vec::new(), sites: BTreeMap::new() };
        let mut bodies = vec![0; links.len()];
        let is_free = |link: &usize| *link != 0 && above[*link].is_none();
        let n_free = (0..links.len()).filter(is_free).count();
        let mut open = vec![0];
        while let Some(at) = open.pop() {
            open.extend(&below[at]);
            if at == 0 {
                continue;
            }
            let parent = above[at].map_or(0, |j| drafts[j].ends[0]);
            let Link { name, span, at: pose, mass } = &links[at];
            let inner = links[parent].at.inverse().then(*pose);
            let mut body = Body::new(name.clone(), *span, bodies[parent], inner);
            body.inertial = *mass;
            bodies[at] = tree.bodies.len();
            tree.bodies.push(body);
            let own = match above[at] {
                Some(j) => joints(&drafts[j], *pose, bodies[at]),
                None => {
                    let free = if n_free == 1 { "floating_base" } else { &format!("{name}/free") };
                    let found = format!("the link {} is free", quoted(name));
                    let help = format!("the joint {} moves it", quoted(free));
                    diagnostics.note(*span, found, help);
                    let draft = Draft {
                        name: free.to_owned(),
                        span: *span,
                        kind: Kind::Ball,
                        ends: [0, at],
                        at: *pose,
                        axes: Vec::new(),
                        is_driven: false,
                    };
                    vec![joint(&draft, free.to_owned(), Motion::Free, None, *pose, bodies[at])]
                }
            };
            own.into_iter().for_each(|joint| tree.add_joint(joint));
        }
        check_couplings(&tree, diagnostics);
        let cuts = closing.iter().filter_map(|j| cut(&drafts[*j], &links, &bodies, diagnostics));
        (tree, cuts.collect())
    }
}

/// The joint above each link, and the joints that close loops.
fn spanning(drafts: &[Draft], n_links: usize) -> (Vec<Option<usize>>, Vec<usize>) {
    let mut above: Vec<Option<usize>> = vec![None; n_links];
    let mut closing = Vec::new();
    let mut order: Vec<usize> = (0..drafts.len()).collect();
    order.sort_by_key(|j| {
        let has_range = drafts[*j].axes.iter().any(|axis| axis.range.is_some());
        (drafts[*j].terms().is_empty(), !has_range)
    });
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

/// The joints of one axis that a joint consists of, on a body at this pose in the world.
fn joints(draft: &Draft, pose: Pose, body: usize) -> Vec<Joint> {
    let name = |suffix: &str| format!("{}{suffix}", draft.name);
    let one = |suffix: &str, motion: Motion, k: usize| {
        joint(draft, name(suffix), motion, draft.axes.get(k), pose, body)
    };
    match draft.kind {
        Kind::Fixed => {
            vec![Joint { held: Some(0.0), pos: [0.0; 3], ..one("", Motion::Hinge, 0) }]
        }
        Kind::Ball => vec![one("", Motion::Ball, 0)],
        Kind::Revolute => vec![one("", Motion::Hinge, 0)],
        Kind::Prismatic => vec![one("", Motion::Slide, 0)],
        Kind::Universal => vec![one("/r1", Motion::Hinge, 0), one("/r2", Motion::Hinge, 1)],
        Kind::Screw(length) => {
            let coupling = Some((vec![(draft.name.clone(), length)], 0.0));
            let slide = one("/slide", Motion::Slide, 0);
            let plain = Joint { range: None, terms: Terms::default(), drive: None, ..slide };
            let none = f64::INFINITY;
            let slide = Joint { effort: none, velocity: none, coupling, ..plain };
            vec![one("", Motion::Hinge, 0), slide]
        }
    }
}

fn joint(
    draft: &Draft,
    name: String,
    kind: Motion,
    axis: Option<&Axis>,
    pose: Pose,
    body: usize,
) -> Joint {
    let into = pose.inverse();
    // an anchor in the origin of the link, but for rounding
    let rounding = 1e-15 * (1.0 + pose.p.iter().fold(0.0_f64, |size, x| size.max(x.abs())));
    let pos = into.apply(draft.at.p).map(|x| if x.abs() <= rounding { 0.0 } else { x });
    let none = f64::INFINITY;
    let mimic = axis.and_then(|axis| axis.mimic.clone());
    Joint {
        name,
        span: draft.span,
        body,
        kind,
        pos,
        axis: axis.map_or([0.0, 0.0, 1.0], |axis| rotated(into.r, axis.direction)),
        reference: 0.0,
        range: axis.and_then(|axis| axis.range),
        effort: axis.map_or(none, |axis| axis.effort),
        velocity: axis.map_or(none, |axis| axis.velocity),
        terms: axis.map(|axis| axis.terms).unwrap_or_default(),
        coupling: mimic.map(|(leader, [factor, offset])| (vec![(leader, factor)], offset)),
        held: None,
        drive: draft.is_driven.then_some(none),
    }
}

/// Reports couplings to joints that are not in the tree.
fn check_couplings(tree: &Tree, diagnostics: &mut Diagnostics) {
    for joint in &tree.joints {
        for (leader, _) in joint.coupling.iter().flat_map(|(terms, _)| terms) {
            let found = tree.joint(leader).and_then(|j| tree.joints.get(j));
            if !found.is_some_and(|of| of.is_single() && of.held.is_none()) {
                let words = format!("{} follows {}", quoted(&joint.name), quoted(leader));
                let expected = "a joint of one axis in the tree";
                diagnostics.error(joint.span, words, expected, "correct the name");
            }
        }
    }
}

/// A joint that closes a loop.
fn cut(
    draft: &Draft,
    links: &[Link],
    bodies: &[usize],
    diagnostics: &mut Diagnostics,
) -> Option<Cut> {
    let name = quoted(&draft.name);
    let mut terms = draft.terms();
    let joint = draft.cut();
    if joint.is_none() {
        terms.push("a thread");
    }
    if !terms.is_empty() {
        let found = format!("the closing joint {name} has {}", terms.join(", "));
        let help = "write it before the other joint of its child";
        diagnostics.dynamics(draft.span, found, "a joint of the tree", help);
    }
    let is_limited = |of: &Axis| of.range.is_some() || of.terms.friction.coulomb != 0.0;
    if draft.axes.iter().any(is_limited) {
        let found = format!("the closing joint {name} has a range or dry friction");
        let help = "they are left out: limit another joint of its loop";
        diagnostics.warning(draft.span, found, "none", help);
    }
    let places = draft.ends.map(|link| links[link].at.inverse().then(draft.at).placement());
    let ends = draft.ends.map(|link| bodies[link]);
    Some(Cut { name: draft.name.clone(), span: draft.span, bodies: ends, places, joint: joint? })
}
