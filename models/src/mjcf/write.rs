//! The tree and the cuts of a model as a description, still without independent joints.

use std::collections::{BTreeMap, BTreeSet};

use sarrus_dynamics::description::{
    Coupling, Curve, Cut as Place, Description, Inertial, Joint as Written, JointKind, Limits,
    Link, Loop, Submechanism, SubmechanismKind, Terms,
};

use super::body::{Joint, Kind, Tree};
use super::equality::Cut;
use crate::build::{self, Tied, tie};
use crate::pose::{Pose, minus};

/// Links and joints in the order of the file, each joint of the model with its index there.
struct Writer<'t> {
    tree: &'t Tree,
    links: Vec<Link>,
    joints: Vec<Written>,
    /// The link of each body.
    bodies: Vec<usize>,
}

/// The robot.
pub(crate) fn description(name: &str, tree: &Tree, cuts: &[Cut]) -> Description {
    let mut of = Writer { tree, links: Vec::new(), joints: Vec::new(), bodies: Vec::new() };
    of.bodies();
    let places: Vec<usize> = tree
        .joints
        .iter()
        .map(|joint| of.joints.iter().position(|of| of.name == joint.name).unwrap_or(0))
        .collect();
    for (joint, at) in tree.joints.iter().zip(&places) {
        let Some((terms, offset)) = joint.coupling.as_ref().filter(|_| joint.is_single()) else {
            continue;
        };
        // a joint that is held is a constant
        let held = |name: &String| tree.joint(name).and_then(|j| tree.joints.get(j)?.held);
        let master = |name: &String| {
            tree.joint(name).filter(|_| held(name).is_none()).and_then(|j| places.get(j).copied())
        };
        let still = terms.iter().filter_map(|(name, factor)| Some(factor * held(name)?));
        let bent = joint.curve.iter().filter_map(|(name, of)| Some((held(name)?, of)));
        let bent = bent.map(|(x, of)| of.iter().rev().fold(0.0, |sum, c| sum * x + c));
        let offset = offset + still.chain(bent).sum::<f64>();
        let terms = terms.iter().filter_map(|(name, factor)| Some((master(name)?, *factor)));
        let curve = |(name, of): &(String, Vec<f64>)| {
            Some((master(name)?, Curve::Polynomial { about: 0.0, coefficients: of.clone() }))
        };
        let curves = Vec::from_iter(joint.curve.as_ref().and_then(curve));
        let coupling = Coupling { terms: terms.collect(), offset, curves };
        if let Some(written) = of.joints.get_mut(*at) {
            written.coupling = Some(coupling);
        }
    }
    let submechanisms = submechanisms(name, &of, &places, cuts);
    Description {
        name: name.to_owned(),
        links: of.links,
        joints: of.joints,
        submechanisms,
        gravity: [0.0; 3],
        zero_pose: Vec::new(),
    }
}

impl Writer<'_> {
    fn link(&mut self, name: &str, inertial: Option<Inertial>) -> usize {
        self.links.push(Link { name: name.to_owned(), inertial });
        self.links.len() - 1
    }

    fn bodies(&mut self) {
        let tree = self.tree;
        for (b, body) in tree.bodies.iter().enumerate() {
            if b == 0 {
                let world = self.link("world", None);
                self.bodies.push(world);
                continue;
            }
            // each joint leads to a link of its own, the last one to the body where its anchor is
            // the body's origin
            let mut parent = self.bodies.get(body.parent).copied().unwrap_or(0);
            let mut at = body.pose;
            let mut is_there = false;
            for (k, joint) in body.joints.iter().enumerate() {
                let Some(joint) = tree.joints.get(*joint) else { continue };
                is_there = k + 1 == body.joints.len() && joint.pos == [0.0; 3];
                let child = match is_there {
                    true => self.link(&body.name, body.inertial),
                    false => self.link(&format!("{}/{}", body.name, joint.name), None),
                };
                self.joints.push(written(joint, at.then(Pose::at(joint.pos)), [parent, child]));
                parent = child;
                at = Pose::at(minus([0.0; 3], joint.pos));
            }
            if !is_there {
                let child = self.link(&body.name, body.inertial);
                let name = format!("{}/frame", body.name);
                let links = [parent, child];
                self.joints.push(build::joint(name, JointKind::Fixed, at.placement(), links));
                parent = child;
            }
            self.bodies.push(parent);
        }
    }
}

fn written(joint: &Joint, place: Pose, links: [usize; 2]) -> Written {
    let kind = match joint.kind {
        _ if joint.held.is_some() => JointKind::Fixed,
        Kind::Hinge if joint.range.is_some() => JointKind::Revolute,
        Kind::Hinge => JointKind::Continuous,
        Kind::Slide => JointKind::Prismatic,
        Kind::Ball => JointKind::Spherical,
        Kind::Free => JointKind::Floating,
    };
    let place = match (joint.held, joint.kind) {
        (Some(at), Kind::Hinge) => place.then(Pose { p: [0.0; 3], r: Pose::turn(joint.axis, at) }),
        (Some(at), _) => place.then(Pose::at(joint.axis.map(|x| x * at))),
        (None, _) => place,
    };
    let mut of = build::joint(joint.name.clone(), kind, place.placement(), links);
    let terms = joint.terms;
    if joint.kind == Kind::Ball {
        of.terms.damping = terms.damping;
    }
    if !joint.is_single() || joint.held.is_some() {
        return of;
    }
    of.axis = joint.axis;
    of.terms = Terms { rest: if terms.stiffness == 0.0 { 0.0 } else { terms.rest }, ..terms };
    let effort = joint.effort.min(joint.drive.unwrap_or(f64::INFINITY));
    let none = [f64::NEG_INFINITY, f64::INFINITY];
    let has_limit = effort.is_finite() || joint.velocity.is_finite();
    if joint.range.is_some() || has_limit || kind == JointKind::Prismatic {
        let [lower, upper] = joint.range.unwrap_or(none);
        of.limits = Some(Limits { lower, upper, velocity: joint.velocity, effort });
    }
    of
}

/// Joints that cuts and couplings tie are together, all others serial, in the order of the file.
fn submechanisms(name: &str, of: &Writer<'_>, places: &[usize], cuts: &[Cut]) -> Vec<Submechanism> {
    let tree = of.tree;
    let moves = |j: &usize| tree.joints.get(*j).is_some_and(|joint| joint.held.is_none());
    let mut groups: Vec<Tied<&Cut>> = Vec::new();
    for (j, joint) in tree.joints.iter().enumerate() {
        if let Some((terms, _)) = &joint.coupling {
            let names = terms.iter().map(|(name, _)| name);
            let names = names.chain(joint.curve.iter().map(|(name, _)| name));
            let masters = names.filter_map(|name| tree.joint(name)).filter(&moves);
            tie(&mut groups, (masters.chain([j]).collect(), Vec::new()));
        }
    }
    for cut in cuts {
        tie(&mut groups, (tree.between(cut.bodies).into_iter().collect(), vec![cut]));
    }
    let mut owner: BTreeMap<usize, usize> = BTreeMap::new();
    for (g, (joints, _)) in groups.iter().enumerate() {
        owner.extend(joints.iter().map(|j| (*j, g)));
    }
    let mut all = Vec::new();
    let mut names = BTreeSet::new();
    let mut j = 0;
    while j < tree.joints.len() {
        if !moves(&j) {
            j += 1;
            continue;
        }
        let (joints, cuts): (Vec<usize>, &[&Cut]) = match owner.get(&j) {
            Some(g) => {
                let (joints, cuts) = &groups[*g];
                j += 1;
                if joints.first() != Some(&(j - 1)) {
                    continue;
                }
                (joints.iter().copied().collect(), cuts)
            }
            // all that stand together
            None => {
                let first = j;
                while j < tree.joints.len() && !owner.contains_key(&j) {
                    j += 1;
                }
                ((first..j).filter(|j| moves(j)).collect(), &[])
            }
        };
        let first = joints.first().and_then(|j| tree.joints.get(*j));
        let first = first.map_or("", |joint| joint.name.as_str());
        let mut own = match (cuts, owner.contains_key(&(j - 1))) {
            ([], false) => name.to_owned(),
            ([], true) => first.to_owned(),
            ([cut, ..], _) => cut.name.clone(),
        };
        while !names.insert(own.clone()) {
            own.push('_');
        }
        all.push(submechanism(own, of, &joints, places, cuts));
    }
    all
}

fn submechanism(
    name: String,
    of: &Writer<'_>,
    joints: &[usize],
    places: &[usize],
    cuts: &[&Cut],
) -> Submechanism {
    let own = || joints.iter().filter_map(|j| Some((of.tree.joints.get(*j)?, *places.get(*j)?)));
    let kind = match cuts {
        [] if own().any(|(joint, _)| joint.coupling.is_some()) => SubmechanismKind::Transmission,
        [] => SubmechanismKind::Serial,
        _ => SubmechanismKind::Numerical,
    };
    let loops = cuts.iter().map(|cut| {
        let [predecessor, successor] = cut.places;
        let link = |body: usize| of.bodies.get(body).copied().unwrap_or(0);
        Loop {
            name: cut.name.clone(),
            predecessor: link(cut.bodies[0]),
            successor: link(cut.bodies[1]),
            cut: Place::Placed { predecessor, successor },
            rows: cut.joint.rows(),
        }
    });
    Submechanism {
        active: own().filter(|(joint, _)| joint.drive.is_some()).map(|(_, at)| at).collect(),
        loops: loops.collect(),
        ..build::group(name, kind, own().map(|(_, place)| place).collect())
    }
}
