//! The tree and the cuts of a model as a URDF and a submechanism file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use sarrus_dynamics::description::{Inertial, Placement};

use super::body::{Joint, Kind, Tree};
use super::equality::Cut;
use super::pose::{Pose, minus};
use crate::rewrite::number;
use crate::suggest::word;

/// A text as an attribute's value.
pub(crate) fn escaped(text: &str) -> String {
    let pairs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;")];
    pairs.iter().fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

fn list<const N: usize>(of: [f64; N], between: &str) -> String {
    // no negative zeros
    of.map(|x| number(x + 0.0)).join(between)
}

pub(crate) fn origin(at: Placement) -> String {
    if at == Placement::default() {
        return String::new();
    }
    format!("<origin xyz=\"{}\" rpy=\"{}\"/>", list(at.xyz, " "), list(at.rpy, " "))
}

/// The URDF.
pub(super) fn urdf(name: &str, tree: &Tree) -> String {
    let mut text = format!("<robot name=\"{}\" version=\"1.2\">\n", escaped(name));
    let mut joints = String::new();
    let mut transmissions = String::new();
    for (b, body) in tree.bodies.iter().enumerate() {
        if b == 0 {
            text += "  <link name=\"world\"/>\n";
            continue;
        }
        // each joint leads to a link of its own, the last one to the body where its anchor is the
        // body's origin
        let mut parent = tree.bodies.get(body.parent).map_or("", |of| of.name.as_str()).to_owned();
        let mut at = body.pose;
        for joint in body.joints.iter().filter_map(|j| tree.joints.get(*j)) {
            let is_last = body.joints.last().and_then(|j| tree.joints.get(*j)).map(|of| &of.name)
                == Some(&joint.name);
            let is_body = is_last && joint.pos == [0.0; 3];
            let child =
                if is_body { body.name.clone() } else { format!("{}/{}", body.name, joint.name) };
            let place = at.then(Pose::at(joint.pos));
            joints += &of_joint(joint, place, &parent, &child);
            transmissions += &transmission(joint);
            if !is_body {
                text += &link(&child, None);
            }
            parent = child;
            at = Pose::at(minus([0.0; 3], joint.pos));
        }
        if parent != body.name {
            let name = escaped(&format!("{}/frame", body.name));
            joints += &format!("  <joint name=\"{name}\" type=\"fixed\">");
            joints += &ends(&parent, &body.name);
            joints += &format!("{}</joint>\n", origin(at.placement()));
        }
        text += &link(&body.name, body.inertial);
    }
    text + &joints + &transmissions + "</robot>\n"
}

pub(crate) fn link(name: &str, inertial: Option<Inertial>) -> String {
    let Some(Inertial { origin: at, mass, inertia }) = inertial else {
        return format!("  <link name=\"{}\"/>\n", escaped(name));
    };
    let names = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];
    let moments: String = names
        .iter()
        .zip(inertia)
        .map(|(name, value)| format!(" {name}=\"{}\"", number(value + 0.0)))
        .collect();
    format!(
        "  <link name=\"{}\">\n    <inertial>{}<mass value=\"{}\"/>\n      <inertia{moments}/>\
         </inertial>\n  </link>\n",
        escaped(name),
        origin(at),
        number(mass)
    )
}

pub(crate) fn ends(parent: &str, child: &str) -> String {
    format!("<parent link=\"{}\"/><child link=\"{}\"/>", escaped(parent), escaped(child))
}

fn of_joint(joint: &Joint, place: Pose, parent: &str, child: &str) -> String {
    let kind = match joint.kind {
        _ if joint.held.is_some() => "fixed",
        Kind::Hinge if joint.range.is_some() => "revolute",
        Kind::Hinge => "continuous",
        Kind::Slide => "prismatic",
        Kind::Ball => "spherical",
        Kind::Free => "floating",
    };
    let place = match (joint.held, joint.kind) {
        (Some(at), Kind::Hinge) => place.then(Pose { p: [0.0; 3], r: Pose::turn(joint.axis, at) }),
        (Some(at), _) => place.then(Pose::at(joint.axis.map(|x| x * at))),
        (None, _) => place,
    };
    let mut text = format!("  <joint name=\"{}\" type=\"{kind}\">", escaped(&joint.name));
    text += &ends(parent, child);
    text += &origin(place.placement());
    let is_single = joint.is_single() && joint.held.is_none();
    if is_single {
        let _ = write!(text, "<axis xyz=\"{}\"/>", list(joint.axis, " "));
        let effort = joint.effort.min(joint.drive.unwrap_or(f64::INFINITY));
        let range = joint.range.map(|[lower, upper]| {
            format!(" lower=\"{}\" upper=\"{}\"", number(lower), number(upper))
        });
        let force = effort.is_finite().then(|| format!(" effort=\"{}\"", number(effort)));
        if range.is_some() || force.is_some() || kind == "prismatic" {
            let parts = [range, force].map(Option::unwrap_or_default);
            let _ = write!(text, "<limit{}/>", parts.concat());
        }
        if let Some(([(master, factor)], offset)) =
            joint.coupling.as_ref().map(|(terms, offset)| (terms.as_slice(), offset))
        {
            let _ = write!(
                text,
                "<mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
                escaped(master),
                number(*factor),
                number(offset + 0.0)
            );
        }
    }
    let terms = joint.terms;
    let dry = terms.friction.coulomb;
    let spring = terms.stiffness != 0.0 && is_single;
    let rotor = terms.rotor_inertia != 0.0 && is_single;
    let has_damping = is_single || joint.kind == Kind::Ball;
    let all = [
        ("damping", terms.damping, terms.damping != 0.0 && has_damping),
        ("friction", dry, dry != 0.0 && is_single),
        ("spring_stiffness", terms.stiffness, spring),
        ("spring_reference", terms.rest, spring),
        ("rotor_inertia", terms.rotor_inertia, rotor),
        ("gear_ratio", terms.gear_ratio, rotor),
    ];
    let dynamics: String = all
        .iter()
        .filter(|(.., is_there)| *is_there)
        .map(|(name, value, _)| format!(" {name}=\"{}\"", number(value + 0.0)))
        .collect();
    if !dynamics.is_empty() {
        let _ = write!(text, "<dynamics{dynamics}/>");
    }
    text + "</joint>\n"
}

/// The coupling of a joint to several others.
fn transmission(joint: &Joint) -> String {
    let Some((terms, offset)) = joint.coupling.as_ref().filter(|(terms, _)| terms.len() > 1) else {
        return String::new();
    };
    let name = escaped(&joint.name);
    let mut text = format!("  <transmission name=\"{name}\">\n    <joint name=\"{name}\">\n");
    for (k, (master, factor)) in terms.iter().enumerate() {
        let master = escaped(master);
        let offset = number(if k == 0 { offset + 0.0 } else { 0.0 });
        let factor = number(*factor);
        let _ = writeln!(
            text,
            "      <depends_on joint=\"{master}\" multiplier=\"{factor}\" offset=\"{offset}\"/>"
        );
    }
    text + "    </joint>\n  </transmission>\n"
}

/// Joints that move together, and the cuts between them.
type Group<'a> = (BTreeSet<usize>, Vec<&'a Cut>);

/// Adds a group, joined with those that have a joint of it.
fn tie<'a>(groups: &mut Vec<Group<'a>>, mut group: Group<'a>) {
    let (joined, others): (Vec<Group<'a>>, Vec<Group<'a>>) =
        groups.drain(..).partition(|(known, _)| !known.is_disjoint(&group.0));
    let mut cuts = Vec::new();
    for (joints, of) in joined {
        group.0.extend(joints);
        cuts.extend(of);
    }
    group.1.splice(0..0, cuts);
    *groups = others;
    groups.push(group);
}

/// The submechanism file: joints that cuts and couplings tie are together, all others serial, in
/// the order of the file.
pub(super) fn submechanisms(name: &str, tree: &Tree, cuts: &[Cut]) -> String {
    let moves = |j: &usize| tree.joints.get(*j).is_some_and(|joint| joint.held.is_none());
    let mut groups: Vec<Group<'_>> = Vec::new();
    for (j, joint) in tree.joints.iter().enumerate() {
        if let Some((terms, _)) = &joint.coupling {
            let masters = terms.iter().filter_map(|(name, _)| tree.joint(name));
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
    let mut text = "submechanisms:\n".to_owned();
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
        text += &entry(&own, &joints, cuts, tree);
    }
    text
}

fn entry(name: &str, joints: &[usize], cuts: &[&Cut], tree: &Tree) -> String {
    let all = || joints.iter().filter_map(|j| tree.joints.get(*j));
    let kind = match cuts {
        [] if all().any(|joint| joint.coupling.is_some()) => "TRANSMISSION",
        [] => "SERIAL",
        _ => "NUMERICAL",
    };
    let names = |of: &mut dyn Iterator<Item = &Joint>| {
        of.map(|joint| word(&joint.name)).collect::<Vec<_>>().join(", ")
    };
    let mut text = format!(
        "- type: {kind}\n  contextual_name: {}\n  jointnames_spanningtree: [{}]\n  \
         jointnames_independent: []\n  jointnames_active: [{}]\n",
        word(name),
        names(&mut all()),
        names(&mut all().filter(|joint| joint.drive.is_some()))
    );
    if !cuts.is_empty() {
        text += "  loop_constraints:\n";
    }
    for cut in cuts {
        let [a, b] = cut.bodies.map(|body| tree.bodies.get(body).map_or("", |of| &*of.name));
        let kind = if cut.is_weld { "weld" } else { "spherical" };
        let _ = writeln!(text, "  - cut_joint: {}", word(&cut.name));
        let _ =
            writeln!(text, "    predecessor_body: {}\n    successor_body: {}", word(a), word(b));
        let _ = writeln!(text, "    cut_joint_type: {kind}");
        for (key, Placement { xyz, rpy }) in ["predecessor", "successor"].iter().zip(cut.places) {
            let xyz = list(xyz, ", ");
            let _ =
                writeln!(text, "    {key}_placement: {{xyz: [{xyz}], rpy: [{}]}}", list(rpy, ", "));
        }
    }
    text
}
