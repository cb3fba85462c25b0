//! Builds the [`Description`] from checked files, and maps its parts back to their positions.

use std::collections::BTreeSet;

use sarrus_dynamics::description::{
    Coupling, Cut, Description, Joint, JointKind, Limits, Link, Loop, Placement, Row, Submechanism,
    SubmechanismKind as Kind, Terms,
};
use sarrus_dynamics::{Diagnostic, Reduced, Site};

use crate::cut::{about, named};
use crate::report::{Diagnostics, Span};
use crate::submechanisms::kind::KNOWN;
use crate::submechanisms::{
    Entry, EntryValues, LoopValues, PlacementValues, Submechanisms, kind_named,
};
use crate::urdf::{JointEntry, Urdf, Weight};

/// Deviation of an axis from unit length that the rounding of a file explains.
const ROUNDED: f64 = 1e-6;

/// The positions of a description's parts in the files.
#[derive(Clone, Debug)]
pub(crate) struct Spans {
    robot: Span,
    links: Vec<Span>,
    joints: Vec<Span>,
    submechanisms: Vec<SubmechanismSpan>,
}

#[derive(Clone, Debug)]
struct SubmechanismSpan {
    span: Span,
    loops: Vec<(Span, Vec<Span>)>,
}

impl Spans {
    /// The positions of a robot's parts; submechanisms of no file have the robot's position.
    pub(crate) fn new(urdf: &Urdf, submechanisms: Option<&Submechanisms>) -> Spans {
        let span_of = |entry: &Entry| SubmechanismSpan {
            span: entry.name.as_ref().map_or(entry.span, |(_, span)| *span),
            loops: entry.loops.iter().map(|each| (each.span, each.rows.clone())).collect(),
        };
        let entries = submechanisms.into_iter().flat_map(|read| &read.entries);
        Spans {
            robot: submechanisms.map_or(urdf.span, |read| read.span),
            links: urdf.links.iter().map(|link| link.span).collect(),
            joints: urdf.joints.iter().map(|joint| joint.span).collect(),
            submechanisms: entries.map(span_of).collect(),
        }
    }

    /// Inserts a submechanism of no file before all others.
    pub(crate) fn put_first(&mut self) {
        self.submechanisms.insert(0, SubmechanismSpan { span: self.robot, loops: Vec::new() });
    }

    /// The positions of the parts of a reduced robot.
    pub(crate) fn of_reduced(&self, reduced: &Reduced) -> Spans {
        let links = reduced.links.iter().filter_map(|link| self.links.get(*link).copied());
        let joints = reduced.joints.iter().filter_map(|joint| self.joints.get(*joint).copied());
        let submechanisms = reduced.submechanisms.iter().map(|(s, loops)| {
            let span = self.of(Site::Submechanism(*s));
            let loops = loops.iter().map(|l| {
                let found = self.submechanisms.get(*s).and_then(|of| of.loops.get(*l));
                found.cloned().unwrap_or((span, Vec::new()))
            });
            SubmechanismSpan { span, loops: loops.collect() }
        });
        Spans {
            robot: self.robot,
            links: links.collect(),
            joints: joints.collect(),
            submechanisms: submechanisms.collect(),
        }
    }

    /// Adds a submechanism that no file lists.
    pub(crate) fn add(&mut self, span: Span) {
        self.submechanisms.push(SubmechanismSpan { span, loops: Vec::new() });
    }

    /// Adds a loop of the URDF to a submechanism, with this many rows.
    pub(crate) fn add_loop(&mut self, s: usize, span: Span, n_rows: usize) {
        if let Some(part) = self.submechanisms.get_mut(s) {
            part.loops.push((span, vec![span; n_rows]));
        }
    }

    /// Reports faults that the compiler found, each at the position of its part.
    pub(crate) fn report(
        &self,
        errors: Vec<Diagnostic>,
        warnings: Vec<Diagnostic>,
        diagnostics: &mut Diagnostics,
    ) {
        for of in errors {
            diagnostics.error(self.of(of.site), of.found, of.expected, of.help);
        }
        for of in warnings {
            diagnostics.warning(self.of(of.site), of.found, of.expected, of.help);
        }
    }

    /// The position of a part; that of the nearest enclosing part if it has none.
    pub(crate) fn of(&self, site: Site) -> Span {
        let submechanism = |s: usize| self.submechanisms.get(s);
        let span = match site {
            Site::Link(link) => self.links.get(link).copied(),
            Site::Joint(joint) => self.joints.get(joint).copied(),
            Site::Submechanism(s) => submechanism(s).map(|found| found.span),
            Site::Loop(s, l) => submechanism(s)
                .map(|found| found.loops.get(l).map_or(found.span, |(span, _)| *span)),
            Site::Row(s, l, r) => {
                let row = submechanism(s).and_then(|found| found.loops.get(l)?.1.get(r).copied());
                row.or_else(|| submechanism(s).map(|found| found.span))
            }
            _ => None,
        };
        span.unwrap_or(self.robot)
    }
}

/// The description of checked files, with the submechanisms that a file lists; `None` if the two
/// readings of the submechanism file differ, which should never happen to a checked file.
pub(crate) fn description(
    urdf: &Urdf,
    entries: Option<Vec<EntryValues>>,
    gravity: [f64; 3],
) -> Option<Description> {
    let links = urdf.links.iter().map(|link| {
        let inertial = match link.inertial {
            Weight::Given { inertial, .. } => Some(inertial),
            Weight::Absent | Weight::Malformed => None,
        };
        Link { name: link.name.clone(), inertial }
    });
    let joints = urdf.joints.iter().map(|entry| {
        let mut coupling = Coupling::default();
        for master in &entry.masters {
            let of = *urdf.joint_index.get(&master.joint)?;
            coupling.offset += master.offset;
            match &master.curve {
                Some(curve) => coupling.curves.push((of, curve.clone())),
                None => coupling.terms.push((of, master.multiplier)),
            }
        }
        Some(Joint {
            name: entry.name.clone(),
            kind: entry.kind?,
            parent: urdf.link_at(&entry.parent)?,
            child: urdf.link_at(&entry.child)?,
            origin: entry.origin,
            axis: entry.axis,
            limits: limits(entry),
            coupling: (!entry.masters.is_empty()).then_some(coupling),
            terms: entry.terms,
            motor: entry.motor.clone(),
        })
    });
    let joints: Vec<Joint> = joints.collect::<Option<_>>()?;
    let entries = entries.unwrap_or_default();
    let submechanisms =
        entries.into_iter().map(|entry| submechanism(urdf, entry)).collect::<Option<_>>()?;
    Some(Description {
        name: urdf.name.clone(),
        links: links.collect(),
        joints,
        submechanisms,
        gravity,
        zero_pose: Vec::new(),
    })
}

/// The limits of a joint of one axis; a continuous one has no range.
fn limits(entry: &JointEntry) -> Option<Limits> {
    let limits = entry.limits?;
    match entry.kind? {
        JointKind::Revolute | JointKind::Prismatic => Some(limits),
        JointKind::Continuous => {
            Some(Limits { lower: f64::NEG_INFINITY, upper: f64::INFINITY, ..limits })
        }
        _ => None,
    }
}

/// Joints that move together, and the cuts between them.
pub(crate) type Tied<C> = (BTreeSet<usize>, Vec<C>);

/// Adds a group, joined with those that have a joint of it.
pub(crate) fn tie<C>(groups: &mut Vec<Tied<C>>, mut group: Tied<C>) {
    let (joined, others): (Vec<Tied<C>>, Vec<Tied<C>>) =
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

/// Joints as a submechanism of this kind, of which none is independent yet.
pub(crate) fn group(name: String, kind: Kind, spanning_tree: Vec<usize>) -> Submechanism {
    let known = KNOWN.iter().find(|known| known.kind == kind);
    Submechanism {
        name,
        kind,
        type_name: known.map_or("", |known| known.name).to_owned(),
        spanning_tree,
        independent: Vec::new(),
        active: Vec::new(),
        loops: Vec::new(),
        closed_forms: true,
    }
}

/// A joint of this kind at a place between two links, without limits and terms.
pub(crate) fn joint(
    name: String,
    kind: JointKind,
    origin: Placement,
    [parent, child]: [usize; 2],
) -> Joint {
    Joint {
        name,
        kind,
        parent,
        child,
        origin,
        axis: [1.0, 0.0, 0.0],
        limits: None,
        coupling: None,
        terms: Terms::default(),
        motor: None,
    }
}

fn submechanism(urdf: &Urdf, entry: EntryValues) -> Option<Submechanism> {
    let indices = |names: Option<Vec<String>>| -> Option<Vec<usize>> {
        let names = names.unwrap_or_default();
        let parts = names.iter().flat_map(|name| match urdf.parts.get(name) {
            Some(parts) => parts.iter().collect(),
            None => vec![name],
        });
        parts.map(|name| urdf.joint_index.get(name).copied()).collect()
    };
    let (kind, _) = kind_named(&entry.r#type)?;
    let loops = entry.loop_constraints.unwrap_or_default().into_iter();
    Some(Submechanism {
        name: entry.contextual_name.or(entry.name)?,
        kind,
        type_name: entry.r#type,
        spanning_tree: indices(entry.jointnames_spanningtree)?,
        independent: indices(entry.jointnames_independent)?,
        active: indices(entry.jointnames_active)?,
        loops: loops.map(|each| closed_loop(urdf, each)).collect::<Option<_>>()?,
        closed_forms: entry.closed_forms.as_deref() != Some("off"),
    })
}

fn closed_loop(urdf: &Urdf, each: LoopValues) -> Option<Loop> {
    let is_framed = each.frames.is_some();
    let [first, second] = match each.frames {
        Some(frames) => frames,
        None => [each.predecessor_body?, each.successor_body?],
    };
    let predecessor = *urdf.link_index.get(&first)?;
    let successor = *urdf.link_index.get(&second)?;
    let name = each.cut_joint.unwrap_or_else(|| format!("{first}_{second}"));
    let at_joint = urdf.joint_index.get(&name).map(|joint| Cut::AtJoint(*joint));
    let cut = match (each.predecessor_placement, each.successor_placement) {
        (Some(predecessor), Some(successor)) => {
            Cut::Placed { predecessor: placement(predecessor), successor: placement(successor) }
        }
        _ if is_framed => {
            Cut::Placed { predecessor: Placement::default(), successor: Placement::default() }
        }
        _ => at_joint.unwrap_or(Cut::AtLink(predecessor)),
    };
    let rows = match each.cut_joint_type {
        Some(written) => {
            let [axis, axis2] = [each.axis, each.axis2].map(Option::unwrap_or_default);
            about(named(&written)?, axis, axis2).rows()
        }
        None => each
            .constraint_axes?
            .into_iter()
            .map(|row| Row { name: row.name, axis: of_unit_length(row.axis), against: None })
            .collect(),
    };
    Some(Loop { name, predecessor, successor, cut, rows })
}

/// A constraint axis of which the longer part, of the turn or of the translation, has unit length;
/// unchanged where it has that up to rounding.
fn of_unit_length(axis: [f64; 6]) -> [f64; 6] {
    let largest = axis.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let length = |part: &[f64]| part.iter().map(|x| (x / largest).powi(2)).sum::<f64>().sqrt();
    let (turn, translation) = axis.split_at(3);
    let longer = length(turn).max(length(translation));
    let is_unit = (longer * largest - 1.0).abs() <= ROUNDED;
    if is_unit { axis } else { axis.map(|x| x / largest / longer) }
}

fn placement(values: PlacementValues) -> Placement {
    Placement { xyz: values.xyz, rpy: values.rpy }
}
