//! Linear couplings of several joints: `<transmission>` with `<depends_on>` children, HyRoDyn's
//! extension of URDF.

use roxmltree::Node;

use super::joint::{Master, master};
use super::xml::{Reader, Shape};
use crate::report::Span;

const TRANSMISSION: Shape =
    Shape { attributes: &["name", "type"], once: &[], many: &["joint"], ignored: &["*"] };
const JOINT: Shape =
    Shape { attributes: &["name"], once: &[], many: &["depends_on"], ignored: &["*"] };
const DEPENDS_ON: Shape =
    Shape { attributes: &["joint", "multiplier", "offset"], once: &[], many: &[], ignored: &[] };

/// What one joint of a transmission depends on.
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
            reader.children(term, &DEPENDS_ON);
            masters.extend(master(reader, term));
        }
        if let Some((joint, span)) = name.filter(|_| !masters.is_empty()) {
            dependences.push(Dependence { joint, span, masters });
        }
    }
    dependences
}
