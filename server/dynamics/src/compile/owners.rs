//! The submechanism that owns each joint.

use crate::description::{Description, JointKind};
use crate::diagnostic::{Diagnostic, Site};

/// The submechanism of each joint.
pub(super) fn owners(
    description: &Description,
    errors: &mut Vec<Diagnostic>,
) -> Option<Vec<usize>> {
    let mut owner = vec![usize::MAX; description.joints.len()];
    let mut fault = |site, found: String, expected: &str| {
        let help = "correct the lists of the submechanisms";
        errors.push(Diagnostic::new(site, found, expected, help));
    };
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        for &j in &submechanism.spanning_tree {
            match owner.get(j) {
                Some(&usize::MAX) => owner[j] = s,
                _ => fault(
                    Site::Submechanism(s),
                    "a joint that is in two submechanisms or does not exist".into(),
                    "each joint once",
                ),
            }
        }
        for &j in submechanism.independent.iter().chain(&submechanism.active) {
            if !submechanism.spanning_tree.contains(&j) {
                fault(
                    Site::Submechanism(s),
                    "an independent or active joint outside the spanning tree".into(),
                    "joints of jointnames_spanningtree",
                );
            }
        }
    }
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        let several = |j: &&usize| {
            description.joints.get(**j).is_some_and(|joint| {
                matches!(joint.kind, JointKind::Floating | JointKind::Spherical)
            })
        };
        for j in submechanism.active.iter().filter(several) {
            fault(
                Site::Submechanism(s),
                format!(
                    "the joint {} of several freedoms as an actuator",
                    description.joints[*j].name
                ),
                "actuators of one freedom",
            );
        }
    }
    for (j, joint) in description.joints.iter().enumerate() {
        if joint.kind != JointKind::Fixed && owner[j] == usize::MAX {
            fault(
                Site::Joint(j),
                format!("joint {} in no submechanism", joint.name),
                "each moving joint in one",
            );
        }
    }
    errors.is_empty().then_some(owner)
}
