//! Links: their names, masses and inertias.

use roxmltree::Node;
use sarrus_dynamics::description::{Inertial, Placement};

use super::origin::origin;
use super::xml::{Reader, Shape};
use crate::inertia::{self, InertiaFault};
use crate::report::{Diagnostics, Span, quoted};

const LINK: Shape = Shape {
    once: "inertial",
    ignored: "visual collision contact self_collision_checking self_collide gravity sensor \
        material verbose",
    ..Shape::of("name type")
};
const INERTIAL: Shape = Shape { once: "origin mass inertia", ..Shape::of("") };
const MASS: Shape = Shape::of("value");
const INERTIA: Shape = Shape::of("ixx ixy ixz iyy iyz izz");

/// A link as written.
pub(crate) struct LinkEntry {
    /// Empty when it is missing, which has been reported.
    pub(crate) name: String,
    pub(crate) span: Span,
    pub(crate) inertial: Weight,
    /// False for a link between the parts of a joint.
    pub(crate) is_written: bool,
}

/// The `<inertial>` of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Weight {
    /// No inertial.
    Absent,
    /// It is malformed, which has been reported.
    Malformed,
    /// Both can be read.
    Given { span: Span, inertial: Inertial },
}

pub(super) fn read<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> LinkEntry {
    let name = reader.required(node, "name");
    let mut inertial = Weight::Absent;
    for child in reader.children(node, &LINK) {
        inertial = weight(reader, child);
    }
    LinkEntry {
        name: name.map(|(name, _)| name).unwrap_or_default(),
        span: reader.span(node),
        inertial,
        is_written: true,
    }
}

fn weight<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Weight {
    let span = reader.span(node);
    let children = reader.children(node, &INERTIAL);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    let origin = find("origin").map_or(Some(Placement::default()), |node| origin(reader, node));
    let mass = find("mass").map(|mass| {
        reader.children(mass, &MASS);
        reader.required_number(mass, "value")
    });
    let inertia = find("inertia").map(|inertia| {
        reader.children(inertia, &INERTIA);
        let [ixx, ixy, ixz, iyy, iyz, izz] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"]
            .map(|name| reader.required_number(inertia, name));
        Some([ixx?, ixy?, ixz?, iyy?, iyz?, izz?])
    });
    for (name, absent) in [("mass", mass.is_none()), ("inertia", inertia.is_none())] {
        if absent {
            let found = format!("`inertial` has no `{name}`");
            let expected = format!("<{name} …/>");
            reader.diagnostics.error(span, found, expected, "add it or remove the inertial");
        }
    }
    match (origin, mass.flatten(), inertia.flatten()) {
        (Some(origin), Some(mass), Some(inertia)) => {
            Weight::Given { span, inertial: Inertial { origin, mass, inertia } }
        }
        _ => Weight::Malformed,
    }
}

/// Reports masses and inertias that no body has; the root needs none.
pub(super) fn check(link: &LinkEntry, is_root: bool, diagnostics: &mut Diagnostics) {
    let name = quoted(&link.name);
    let massless = |span: Span, why: &str, diagnostics: &mut Diagnostics| {
        let found = format!("link {name} has {why}: a massless body");
        diagnostics.warning(span, found, "mass and inertia", "add them if it has any");
    };
    let (span, Inertial { mass, inertia, .. }) = match link.inertial {
        Weight::Given { span, inertial } => (span, inertial),
        Weight::Absent if !is_root && link.is_written => {
            return massless(link.span, "no inertial", diagnostics);
        }
        Weight::Absent | Weight::Malformed => return,
    };
    let no_inertia = inertia == [0.0; 6];
    if mass < 0.0 {
        let found = format!("the mass of link {name} is {mass}");
        diagnostics.dynamics(span, found, "zero or more", "correct the value");
    } else if mass == 0.0 && !no_inertia {
        let found = format!("link {name} has inertia but no mass");
        diagnostics.dynamics(span, found, "a mass, or zero inertia too", "correct one of them");
    } else if mass == 0.0 && !is_root {
        massless(span, "zero mass", diagnostics);
    } else if no_inertia && !is_root {
        let found = format!("link {name} has zero inertia: a point mass");
        diagnostics.warning(span, found, "an inertia", "add it if it is known");
    }
    let (found, expected) = match inertia::check(&inertia) {
        Ok(()) => return,
        Err(InertiaFault::Negative { least }) => (
            format!("the inertia of link {name} has the negative principal moment {least:.6e}"),
            "moments of zero or more",
        ),
        Err(InertiaFault::Triangle { moments: [a, b, c] }) => (
            format!(
                "the principal moments of link {name}, {a:.6e}, {b:.6e} and {c:.6e}, break the \
                 triangle inequality"
            ),
            "none above the sum of the others",
        ),
    };
    diagnostics.dynamics(span, found, expected, "correct the inertia about the centre of mass");
}
