//! Couplings of several joints: `<transmission>` with `<depends_on>` children, HyRoDyn's
//! extension of URDF, and `<coupling>`, that of URDF+.

use roxmltree::Node;

use sarrus_dynamics::description::{Curve, JointKind};
use sarrus_dynamics::{curve_fault, table_fit};

use super::Urdf;
use super::joint::{Master, master};
use super::xml::{Reader, Shape};
use crate::report::{Diagnostics, Span, quoted};

const TRANSMISSION: Shape = Shape { many: "joint", ignored: "*", ..Shape::of("name type") };
const JOINT: Shape = Shape { many: "depends_on", ignored: "*", ..Shape::of("name") };
const DEPENDS_ON: Shape = Shape::of("joint multiplier offset");
const CURVED: Shape = Shape::of("joint polynomial about table offset");
const COUPLING: Shape = Shape { once: "predecessor successor ratio", ..Shape::of("name type") };

/// The joints on which one joint depends.
pub(crate) struct Dependence {
    pub(crate) joint: String,
    pub(crate) span: Span,
    pub(crate) masters: Vec<Master>,
}

/// The dependence that a joint states by `<mimic>`.
pub(super) fn of_mimic<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Dependence> {
    let mimic = node.children().find(|child| child.has_tag_name("mimic"))?;
    let (joint, span) = reader.required(node, "name")?;
    Some(Dependence { joint, span, masters: vec![master(reader, mimic)?] })
}

/// The dependences of a transmission; the transmissions of other programs have none.
pub(super) fn read<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Vec<Dependence> {
    let mut dependences = Vec::new();
    if !node.descendants().any(|inner| inner.has_tag_name("depends_on")) {
        return dependences;
    }
    for joint in reader.children(node, &TRANSMISSION) {
        let name = reader.required(joint, "name");
        let mut masters = Vec::new();
        for term in reader.children(joint, &JOINT) {
            let is_curved = ["polynomial", "table"].iter().any(|name| term.has_attribute(*name));
            reader.children(term, if is_curved { &CURVED } else { &DEPENDS_ON });
            let curve = if is_curved { curve(reader, term) } else { None };
            masters.extend(master(reader, term).map(|of| Master { curve, ..of }));
        }
        if let Some((joint, span)) = name.filter(|_| !masters.is_empty()) {
            dependences.push(Dependence { joint, span, masters });
        }
    }
    dependences
}

/// The curve of `polynomial` or `table`; `None` after an error.
fn curve<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Curve> {
    let kinds = ["multiplier", "polynomial", "table"];
    if kinds.iter().filter(|kind| node.has_attribute(**kind)).count() > 1 {
        let found = "a multiplier, a polynomial or a table beside another of them";
        reader.diagnostics.error(reader.span(node), found, "one of the three", "remove the others");
        return None;
    }
    let curve = match (reader.list(node, "polynomial"), reader.list(node, "table")) {
        (Some(coefficients), _) => {
            let about = reader.number(node, "about").unwrap_or_default();
            Curve::Polynomial { about, coefficients }
        }
        (_, Some(numbers)) if numbers.len().is_multiple_of(2) => {
            Curve::Table(numbers.chunks_exact(2).map(|point| [point[0], point[1]]).collect())
        }
        _ => Curve::Table(Vec::new()),
    };
    if let Some(expected) = curve_fault(&curve) {
        let found = "a curve of `depends_on` that is none";
        reader.diagnostics.error(reader.span(node), found, expected, "correct its numbers");
        return None;
    }
    if let (Curve::Table(points), Some([off, bend])) = (&curve, table_fit(&curve)) {
        let found = format!(
            "the curve through a table of {} points leaves them by {off:.1e}; its second \
             derivative reaches {bend:.3}",
            points.len()
        );
        let help = "where that is large for the mechanism, the points have too few digits";
        reader.diagnostics.note(reader.span(node), found, help);
    }
    Some(curve)
}

/// `<coupling>` of URDF+: the turns between the common ancestor of two links and the successor are
/// those to the predecessor times the ratio.
pub(super) struct Gear {
    pub(super) span: Span,
    links: [(String, Span); 2],
    ratio: f64,
}

/// Reads a `<coupling>`; `None` after an error.
pub(super) fn gear<'t>(reader: &mut Reader<'t, '_>, node: Node<'_, 't>) -> Option<Gear> {
    let children = reader.children(node, &COUPLING);
    let find = |name: &str| children.iter().copied().find(|child| child.has_tag_name(name));
    let links = ["predecessor", "successor"].map(|end| reader.required(find(end)?, "link"));
    let ratio = find("ratio").and_then(|ratio| reader.required_number(ratio, "value"));
    let span = reader.span(node);
    let ([Some(predecessor), Some(successor)], Some(ratio)) = (links, ratio) else {
        let found = "`coupling` does not say which links turn at which ratio";
        let expected = "<predecessor link/>, <successor link/>, <ratio value/>";
        let help = "add them, or write <mimic joint multiplier/> into the joint that follows";
        return reader.diagnostics.refused(span, found, expected, help);
    };
    Some(Gear { span, links: [predecessor, successor], ratio })
}

impl Gear {
    /// Joints between the links with their factors: ratio · Σ q of the one path − Σ q of the other
    /// is zero. `None` after an error.
    pub(super) fn terms(
        &self,
        urdf: &Urdf,
        above: &[Option<usize>],
        diagnostics: &mut Diagnostics,
    ) -> Option<Vec<(usize, f64)>> {
        let ends = self.links.each_ref().map(|(name, span)| {
            let known = urdf.link_index.get(name).copied();
            if known.is_none() {
                let found = format!("the coupling names the link {}", quoted(name));
                let expected = diagnostics.one_of("a link of this file", name, urdf.link_names());
                diagnostics.error(*span, found, expected, "correct the name");
            }
            known
        });
        let [predecessor, successor] = urdf.paths(above, [ends[0]?, ends[1]?]);
        let terms = predecessor.iter().map(|j| (*j, self.ratio));
        Some(terms.chain(successor.iter().map(|j| (*j, -1.0))).collect())
    }

    /// The coupling as the dependence of its last free joint. `None` after an error.
    pub(super) fn dependence(
        &self,
        terms: &[(usize, f64)],
        urdf: &Urdf,
        diagnostics: &mut Diagnostics,
    ) -> Option<Dependence> {
        let span = self.span;
        let joint = |j: usize| urdf.joints.get(j);
        let follower = terms.iter().rev().find(|(j, factor)| {
            *factor != 0.0
                && joint(*j).is_some_and(|joint| {
                    joint.masters.is_empty() && joint.independent != Some(true)
                })
        });
        let one_axis = |j: usize| {
            matches!(
                joint(j).and_then(|joint| joint.kind),
                Some(JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic)
            )
        };
        let Some((follower, own)) = follower.filter(|_| terms.iter().all(|(j, _)| one_axis(*j)))
        else {
            let found = "a coupling without a joint of one axis that can follow";
            let help = "write <mimic joint multiplier/> into the joint that follows";
            return diagnostics.refused(span, found, "joints of one axis between the links", help);
        };
        let name = |j: usize| joint(j).map(|joint| joint.name.clone());
        let masters = terms.iter().filter(|(j, _)| j != follower).filter_map(|(j, factor)| {
            let [multiplier, offset] = [-factor / own, 0.0];
            Some(Master { joint: name(*j)?, span, multiplier, offset, curve: None })
        });
        Some(Dependence { joint: name(*follower)?, span, masters: masters.collect() })
    }
}
