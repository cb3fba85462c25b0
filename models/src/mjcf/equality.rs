//! `<equality>`: cuts of loops, and couplings of joints and tendons.

use sarrus_dynamics::CutJoint;
use sarrus_dynamics::description::Placement;

use super::body::Tree;
use super::drive::Tendon;
use super::item::Item;
use super::source::Source;
use crate::pose::{Pose, unit};
use crate::report::{Diagnostics, Span, quoted};

/// A cut between two bodies.
pub(crate) struct Cut {
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) bodies: [usize; 2],
    pub(crate) places: [Placement; 2],
    pub(crate) joint: CutJoint,
}

/// Reads the equalities of a model.
pub(super) struct Equalities<'e, 'd> {
    pub(super) source: &'d mut Source<'e>,
    pub(super) tree: &'d mut Tree,
    pub(super) tendons: &'d mut [Tendon],
    pub(super) diagnostics: &'d mut Diagnostics,
    pub(super) cuts: &'d mut Vec<Cut>,
}

impl<'e> Equalities<'e, '_> {
    pub(super) fn read(mut self) {
        let root = self.source.root;
        for (n, element) in (1..).zip(root.all("equality").flat_map(|of| &of.children)) {
            let is_known = |tag: &str, name: &str| self.tree.has(tag, name);
            if self.source.leaves_out(element, is_known, self.diagnostics) {
                continue;
            }
            let item = self.source.classes.item(element, &["equality"], None, self.diagnostics);
            let name = item.text("name").map_or(format!("{}_{n}", item.tag()), Into::into);
            let name = self.source.name(&name, &self.source.suffix);
            self.diagnostics.named(item.span(), "equality", &name);
            if item.flag("active", self.diagnostics) == Some(false) {
                element.read_all();
                let found = format!("the equality {} is not active: left out", quoted(&name));
                self.diagnostics.note(item.span(), found, "write active=\"true\" if it is");
                continue;
            }
            let before = self.cuts.len();
            let is_read = match item.tag() {
                "connect" | "weld" => self.cut(&item, name.clone()).is_some(),
                "joint" | "tendon" => self.couple(&item, &name).is_some(),
                other => {
                    element.read_all();
                    let found = format!("the equality {} of {}", quoted(&name), quoted(other));
                    let help = "remove it";
                    let expected = "connect, weld, joint or tendon";
                    self.diagnostics.dynamics(item.span(), found, expected, help);
                    false
                }
            };
            let softness = ["solref", "solimp"].map(|of| item.text(of));
            if is_read {
                let [reference, impedance] = softness.map(|of| of.unwrap_or("as MuJoCo sets it"));
                let kind = if self.cuts.len() > before { "cut" } else { "coupling" };
                let found = format!(
                    "{} is soft in MuJoCo (solref {reference}, solimp {impedance}) and an exact \
                     {kind} here",
                    quoted(&name)
                );
                self.diagnostics.note(item.span(), found, "nothing to do");
            }
        }
    }

    /// Reports a name that stands for nothing.
    fn missing(&mut self, item: &Item<'_>, name: &str, kind: &str) {
        let written = quoted(item.text(name).unwrap_or_default());
        let found = format!("the {kind} {written}, which does not exist");
        self.diagnostics.error(item.at(name), found, format!("a {kind}"), "correct the name");
    }

    /// The body that an attribute names; the world without one.
    fn body(&mut self, item: &Item<'_>, name: &str) -> Option<usize> {
        let Some(written) = self.source.refers(item, name) else { return Some(0) };
        let found = self.tree.body(&written);
        if found.is_none() {
            self.missing(item, name, "body");
        }
        found
    }

    /// The site that an attribute names.
    fn site(&mut self, item: &Item<'_>, name: &str) -> Option<(usize, Pose)> {
        let written = self.source.refers(item, name).unwrap_or_default();
        let found = self.tree.sites.get(&written).copied();
        if found.is_none() {
            self.missing(item, name, "site");
        }
        found
    }

    /// `connect` or `weld`.
    fn cut(&mut self, item: &Item<'_>, name: String) -> Option<()> {
        let scale = item.number("torquescale", self.diagnostics).unwrap_or(1.0);
        let is_weld = item.tag() == "weld" && scale != 0.0;
        let (bodies, poses) = if item.has("site1") || item.has("site2") {
            let [first, second] = ["site1", "site2"].map(|name| self.site(item, name));
            let [first, second] = [first?, second?];
            ([first.0, second.0], [first.1, second.1])
        } else {
            if !item.has("body1") {
                let found = format!("the equality {} has no `body1`", quoted(&name));
                self.diagnostics.error(item.span(), found, "two bodies", "add it");
            }
            let bodies = [self.body(item, "body1"), self.body(item, "body2")];
            let bodies = [bodies[0]?, bodies[1]?];
            let [world_1, world_2] = bodies.map(|body| self.tree.pose(body));
            let relative = world_1.inverse().then(world_2);
            let anchor = item.numbers::<3>("anchor", self.diagnostics).unwrap_or_default();
            let relpose = item.numbers::<7>("relpose", self.diagnostics);
            if item.tag() == "connect" {
                // the anchor lies in the first body
                let point = Pose::at(anchor);
                (bodies, [point, relative.inverse().then(point)])
            } else {
                // in the second one, and the pose counts where its quaternion is not zero
                let given = relpose.and_then(|[x, y, z, qw, qx, qy, qz]| {
                    Some(Pose { p: [x, y, z], r: unit([qx, qy, qz, qw])? })
                });
                let at = Pose::at(anchor);
                (bodies, [given.unwrap_or_else(|| relative.then(at)), at])
            }
        };
        if bodies[0] == bodies[1] {
            let found = format!("both ends of the equality {} are one body", quoted(&name));
            self.diagnostics.error(item.span(), found, "two bodies", "correct one of them");
            return None;
        }
        let places = poses.map(Pose::placement);
        let joint = if is_weld { CutJoint::Weld } else { CutJoint::Spherical };
        self.cuts.push(Cut { name, span: item.span(), bodies, places, joint });
        Some(())
    }

    /// The terms of the joint or the tendon that an attribute names.
    fn terms(&mut self, item: &Item<'_>, name: &str) -> Option<Vec<(String, f64)>> {
        let written = self.source.refers(item, name).unwrap_or_default();
        let is_joint = item.tag() == "joint";
        let joint = self.tree.joints.iter().find(|of| of.name == written && of.is_single());
        let tendon = self.tendons.iter().find(|of| of.name == written);
        let found = match is_joint {
            true => joint.map(|of| vec![(of.name.clone(), 1.0)]),
            false => tendon.map(|of| of.terms.clone()),
        };
        if found.is_none() {
            self.missing(item, name, if is_joint { "hinge or slide" } else { "fixed tendon" });
        }
        found
    }

    /// The coordinate that an attribute names: of a joint, or of one that has a tendon's length.
    fn coordinate(&mut self, item: &Item<'_>, name: &str) -> Option<String> {
        let terms = self.terms(item, name)?;
        let written = self.source.refers(item, name).unwrap_or_default();
        match self.tendons.iter_mut().find(|of| item.tag() == "tendon" && of.name == written) {
            None => Some(terms.first()?.0.clone()),
            Some(tendon) => {
                tendon.leads = true;
                Some(tendon.joint.clone())
            }
        }
    }

    /// first = Σ c_k second^k, in coordinates that are zero in the file's pose: one joint follows
    /// the others, the first one that follows none yet.
    fn couple(&mut self, item: &Item<'_>, name: &str) -> Option<()> {
        let [first, second] = [1, 2].map(|k| format!("{}{k}", item.tag()));
        let has_second = item.text(&second).is_some_and(|of| !of.is_empty());
        let mut written = item.list("polycoef", 5, self.diagnostics).unwrap_or_default();
        let bends = has_second && written.iter().skip(2).any(|of| *of != 0.0);
        let number = |k: usize, default: f64| written.get(k).copied().unwrap_or(default);
        let [constant, factor] = [number(0, 0.0), number(1, 1.0)];
        let mut terms = self.terms(item, &first)?;
        let of_second = if has_second { self.terms(item, &second)? } else { Vec::new() };
        let leads = |joint: &str| bends && of_second.iter().any(|(of, _)| of == joint);
        let slope = if bends { 0.0 } else { -factor };
        terms.extend(of_second.iter().map(|(joint, of)| (joint.clone(), slope * of)));
        // Σ terms = constant, or the polynomial
        let mut sums: Vec<(String, f64)> = Vec::new();
        for (joint, of) in terms.into_iter().filter(|(_, of)| *of != 0.0) {
            match sums.iter_mut().find(|(known, _)| *known == joint) {
                Some((_, sum)) => *sum += of,
                None => sums.push((joint, of)),
            }
        }
        let is_free = |(joint, of): &(String, f64)| {
            let free = self.tree.joint(joint).and_then(|j| self.tree.joints.get(j));
            let free = free.is_some_and(|of| of.coupling.is_none() && of.held.is_none());
            free && *of != 0.0 && !leads(joint)
        };
        let Some(follower) = sums.iter().position(is_free) else {
            let found = format!("no joint of the coupling {} can follow the others", quoted(name));
            let help = "remove one of the couplings";
            self.diagnostics.dynamics(item.span(), found, "one that is free", help);
            return None;
        };
        let (joint, divisor) = sums.remove(follower);
        let curve = if bends { Some(self.coordinate(item, &second)?) } else { None };
        let j = self.tree.joint(&joint)?;
        let joint = self.tree.joints.get_mut(j)?;
        let offset = if bends { 0.0 } else { constant / divisor };
        if sums.is_empty() && !bends {
            joint.held = Some(offset);
        } else {
            let masters = sums.into_iter().map(|(joint, of)| (joint, -of / divisor)).collect();
            joint.coupling = Some((masters, offset));
            written.iter_mut().for_each(|of| *of /= divisor);
            joint.curve = curve.map(|of| (of, written));
        }
        Some(())
    }
}
