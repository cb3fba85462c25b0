//! Parts that no submechanism file lists: loops of the URDF, and joints in no submechanism.

use std::collections::BTreeSet;

use sarrus_dynamics::description::{
    Cut, Description, Joint, JointKind, Loop, Placement, Submechanism, SubmechanismKind,
};
use sarrus_dynamics::{Site, closing_placements};

use crate::build::{self, Spans, Tied, tie};
use crate::report::{Diagnostics, quoted};
use crate::rotation::{between, product, quaternion, rotated, rpy};
use crate::submechanisms::MOST_ROWS;
use crate::urdf::{Closing, Place, Urdf};

/// The submechanism of the joints that a submechanism file does not list.
const UNLISTED: &str = "unlisted";

/// Angle between the axes of a loop that a file's rounding explains `[rad]`.
const OPEN: f64 = 1e-6;

/// Puts the loops of the URDF into the submechanisms that own their joints, or into a new one, and
/// the remaining moving joints into a last one.
pub(crate) fn complete(
    urdf: &Urdf,
    has_file: bool,
    description: &mut Description,
    spans: &mut Spans,
    diagnostics: &mut Diagnostics,
) {
    let mut owner: Vec<Option<usize>> = vec![None; description.joints.len()];
    for (s, part) in description.submechanisms.iter().enumerate() {
        part.spanning_tree.iter().for_each(|j| owner[*j] = Some(s));
    }
    let mut groups: Vec<Tied<(&Closing, Loop)>> = Vec::new();
    let above = urdf.above();
    // the submechanism and loop of each closing that lies on its predecessor alone
    let mut open: Vec<(usize, usize, Place)> = Vec::new();
    for closing in &urdf.closings {
        let Some(ends) = ends(urdf, closing, diagnostics) else { continue };
        let path = urdf.paths(&above, ends).concat();
        let cut = cut(closing, ends);
        if path.is_empty() {
            let name = quoted(&closing.name);
            let found =
                format!("the loop {name} lies between links that do not move against each other");
            let help = "remove it; it is not read";
            diagnostics.warning(closing.span, found, "links with a joint between them", help);
        } else if let Some(s) = path.iter().find_map(|j| owner[*j]) {
            let part = &mut description.submechanisms[s];
            if let Some(l) = attach(closing, cut, part, diagnostics) {
                spans.add_loop(s, closing.span, part.loops[l].rows.len());
                open.push((s, l, closing.place));
            }
        } else {
            tie(&mut groups, (path.into_iter().collect(), vec![(closing, cut)]));
        }
    }
    for group in groups {
        let s = description.submechanisms.len();
        let Some(part) = tied(urdf, &group, description, diagnostics) else { continue };
        spans.add(group.1.first().map_or(urdf.span, |(closing, _)| closing.span));
        for (l, (closing, cut)) in group.1.iter().enumerate() {
            spans.add_loop(s, closing.span, cut.rows.len());
            open.push((s, l, closing.place));
        }
        description.submechanisms.push(part);
    }
    place(description, &open, spans, diagnostics);
    let loops = description.submechanisms.iter().flat_map(|part| &part.loops);
    let n_rows: usize = loops.map(|cut| cut.rows.len()).sum();
    if n_rows > MOST_ROWS {
        let found = format!("the loops have {n_rows} rows");
        let help = "split the robot into robots of their own";
        diagnostics.error(urdf.span, found, format!("at most {MOST_ROWS}"), help);
    }

    // the rest
    let known: BTreeSet<usize> =
        description.submechanisms.iter().flat_map(|part| &part.spanning_tree).copied().collect();
    let name = unique(if has_file { UNLISTED } else { &urdf.name }, &description.submechanisms);
    let rest = serial(name, &description.joints, |joint| !known.contains(&joint));
    if !rest.spanning_tree.is_empty() || description.submechanisms.is_empty() {
        description.submechanisms.push(rest);
    }
}

/// The links of a loop; `None` after an error, and where it holds the root to the world.
fn ends(urdf: &Urdf, closing: &Closing, diagnostics: &mut Diagnostics) -> Option<[usize; 2]> {
    let ends = closing.links.each_ref().map(|(name, span)| {
        let known = urdf.link_index.get(name).copied();
        // if no link is the world, the root is fixed in it
        let known = known.or_else(|| urdf.root.filter(|_| name == "world"));
        if known.is_none() {
            let found =
                format!("the loop {} names the link {}", quoted(&closing.name), quoted(name));
            let expected = diagnostics.one_of("a link of this file", name, urdf.link_names());
            diagnostics.error(*span, found, expected, "correct the name");
        }
        known
    });
    let [a, b] = [ends[0]?, ends[1]?];
    let is_world = closing.links.iter().any(|(name, _)| name == "world");
    if a == b && !is_world {
        let found = format!("both ends of the loop {} are one link", quoted(&closing.name));
        diagnostics.error(closing.span, found, "two links", "correct one of them");
    }
    (a != b).then_some([a, b])
}

/// Puts a loop into a submechanism that a file lists; its index there.
fn attach(
    closing: &Closing,
    cut: Loop,
    part: &mut Submechanism,
    diagnostics: &mut Diagnostics,
) -> Option<usize> {
    let name = quoted(&closing.name);
    let [a, b] = [cut.predecessor, cut.successor];
    let same = |known: &&Loop| [[a, b], [b, a]].contains(&[known.predecessor, known.successor]);
    if let Some(known) = part.loops.iter().find(same) {
        let found = format!("the loop {name} of the URDF is that of {}", quoted(&known.name));
        let help = "remove one of them; that of the submechanism file is read";
        diagnostics.warning(closing.span, found, "each loop once", help);
        return None;
    }
    if part.kind == SubmechanismKind::Serial {
        let part = quoted(&part.name);
        let found = format!("the loop {name} closes joints of the serial submechanism {part}");
        let help = "write `type: NUMERICAL`, and in jointnames_independent as many joints as move \
            freely";
        return diagnostics.refused(closing.span, found, "a type with loops", help);
    }
    part.loops.push(cut);
    Some(part.loops.len() - 1)
}

/// A submechanism of joints that only loops of the URDF tie; `None` when no file declares which of
/// them are independent, which is reported with the lines to write.
fn tied(
    urdf: &Urdf,
    (joints, cuts): &Tied<(&Closing, Loop)>,
    description: &Description,
    diagnostics: &mut Diagnostics,
) -> Option<Submechanism> {
    let (first, _) = cuts.first()?;
    let tree: Vec<usize> = joints.iter().copied().collect();
    let joint = |j: &usize| urdf.joints.get(*j);
    let free = |j: &&usize| joint(j).is_some_and(|joint| joint.masters.is_empty());
    let is = |is_true: bool| {
        move |j: &&usize| joint(j).is_some_and(|of| of.independent == Some(is_true))
    };
    let mut declared: Vec<usize> = tree.iter().filter(is(true)).copied().collect();
    if declared.is_empty() && tree.iter().any(|j| is(false)(&j)) {
        // URDF+ marks the dependent joints; the others are independent
        declared = tree.iter().filter(free).filter(|j| !is(false)(j)).copied().collect();
    }
    let is_actuated = |j: &&usize| joint(j).is_some_and(|of| urdf.actuated.contains(&of.name));
    let actuated: Vec<usize> = tree.iter().filter(free).filter(is_actuated).copied().collect();
    let (independent, active) = match (declared.is_empty(), actuated.is_empty()) {
        (false, true) => (declared.clone(), declared),
        (false, false) => (declared, actuated),
        (true, false) => (actuated.clone(), actuated),
        (true, true) => {
            let names: Vec<&str> =
                tree.iter().filter_map(joint).map(|of| of.name.as_str()).collect();
            let found = format!(
                "the loop {}, and neither an actuated joint among its {} joints nor an independent \
                 one",
                quoted(&first.name),
                names.len()
            );
            let help = format!(
                "write a submechanism file: submechanisms: [{{type: NUMERICAL, contextual_name: \
                 {}, jointnames_independent: […], jointnames_active: […], \
                 jointnames_spanningtree: [{}]}}]",
                first.name,
                names.join(", ")
            );
            let expected = "a transmission with an actuator, or independent=\"true\"";
            return diagnostics.refused(first.span, found, expected, help);
        }
    };
    let name = unique(&first.name, &description.submechanisms);
    let part = build::group(name, SubmechanismKind::Numerical, tree);
    let loops = cuts.iter().map(|(_, cut)| cut.clone()).collect();
    Some(Submechanism { loops, independent, active, ..part })
}

/// A loop as a cut; without the successor's placement if the URDF has none.
fn cut(closing: &Closing, [predecessor, successor]: [usize; 2]) -> Loop {
    let cut = match closing.place {
        Place::Both([predecessor, successor]) => Cut::Placed { predecessor, successor },
        Place::Predecessor(at) if at == Placement::default() => Cut::AtLink(predecessor),
        Place::Predecessor(at) | Place::Point(at, _) | Place::Axes([at, _], _) => {
            Cut::Placed { predecessor: at, successor: Placement::default() }
        }
    };
    let rows = closing.joint.rows();
    Loop { name: closing.name.clone(), predecessor, successor, cut, rows }
}

/// Places the cuts of these loops on their successors, at the predecessor's frame in the zero pose.
fn place(
    description: &mut Description,
    open: &[(usize, usize, Place)],
    spans: &Spans,
    diagnostics: &mut Diagnostics,
) {
    for (s, l, closed) in closing_placements(description) {
        let Some((_, _, place)) = open.iter().find(|of| (of.0, of.1) == (s, l)) else { continue };
        let of = &mut description.submechanisms[s].loops[l];
        let Cut::Placed { successor, .. } = &mut of.cut else { continue };
        match place {
            Place::Both(_) => {}
            Place::Predecessor(_) => *successor = closed,
            Place::Point(_, xyz) => *successor = Placement { xyz: *xyz, ..closed },
            Place::Axes([_, at], [axis, own]) => {
                let [x_s_p, x_s_c] = [closed.rpy, at.rpy].map(quaternion);
                let turn = between(rotated(x_s_p, *axis), rotated(x_s_c, *own));
                let rpy = turn.map_or(closed.rpy, |turn| rpy(product(turn, x_s_p)));
                let gap = turn.map_or(0.0, |[x, y, z, w]| 2.0 * x.hypot(y).hypot(z).atan2(w));
                if gap > OPEN {
                    // the loop is open at zero, which is an error unless it is to be assembled
                    let found = format!(
                        "the axes of the loop {} are {gap:.3e} rad apart at the zero pose",
                        quoted(&of.name)
                    );
                    let help = "correct parent_axis, child_axis or the joints' origins";
                    let span = spans.of(Site::Loop(s, l));
                    diagnostics.warning(span, found, "axes that coincide at zero", help);
                }
                *successor = Placement { xyz: at.xyz, rpy };
            }
        }
    }
}

/// A submechanism of no file: the moving joints that it `has`, in the order of the URDF,
/// independent unless they follow others.
fn serial(name: String, joints: &[Joint], has: impl Fn(usize) -> bool) -> Submechanism {
    let moving: Vec<usize> =
        (0..joints.len()).filter(|j| joints[*j].kind != JointKind::Fixed && has(*j)).collect();
    let independent: Vec<usize> =
        moving.iter().copied().filter(|j| joints[*j].coupling.is_none()).collect();
    let is_single =
        |j: &usize| !matches!(joints[*j].kind, JointKind::Floating | JointKind::Spherical);
    let active = independent.iter().copied().filter(is_single).collect();
    let is_free = independent.len() == moving.len();
    let kind = if is_free { SubmechanismKind::Serial } else { SubmechanismKind::Transmission };
    Submechanism { independent, active, ..build::group(name, kind, moving) }
}

/// A name that no submechanism has yet.
fn unique(name: &str, others: &[Submechanism]) -> String {
    let mut name = name.to_owned();
    while others.iter().any(|part| part.name == name) {
        name.push('_');
    }
    name
}
