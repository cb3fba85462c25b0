//! One submechanism under construction, and its defaults.

use super::cut::PendingCut;
use crate::description::{Joint, JointKind, Submechanism, SubmechanismKind};
use crate::diagnostic::{Diagnostic, Site};

/// A submechanism under construction, its lists by joint.
#[derive(Clone, Debug)]
pub(super) struct Group {
    name: String,
    kind: SubmechanismKind,
    pub(super) spanning_tree: Vec<usize>,
    pub(super) independent: Option<Vec<usize>>,
    pub(super) active: Option<Vec<usize>>,
    pub(super) cuts: Vec<PendingCut>,
}

impl Group {
    pub(super) fn new(name: String, kind: SubmechanismKind) -> Group {
        Group {
            name,
            kind,
            spanning_tree: Vec::new(),
            independent: None,
            active: None,
            cuts: Vec::new(),
        }
    }

    /// A submechanism with defaults for the omitted lists.
    pub(super) fn finished(
        &self,
        s: usize,
        joints: &[Joint],
        errors: &mut Vec<Diagnostic>,
    ) -> Submechanism {
        use SubmechanismKind::{Differential, Numerical, Serial, Transmission};
        let follows = |j: &usize| joints[*j].coupling.is_some();
        let kind = match self.kind {
            Serial if self.spanning_tree.iter().any(follows) => Transmission,
            kind => kind,
        };
        let looped = !self.cuts.is_empty()
            || !matches!(kind, Serial | Transmission | Differential | Numerical);
        if self.independent.is_none() && looped {
            errors.push(Diagnostic::new(
                Site::Submechanism(s),
                format!("the loops of {} without independent joints", self.name),
                "as many as the loops leave freedoms",
                "name them by `independent`",
            ));
        }
        let cuts = self.cuts.iter().enumerate();
        let loops = cuts.map(|(l, cut)| cut.finished(Site::Loop(s, l), errors)).collect();
        let free = || self.spanning_tree.iter().copied().filter(|j| !follows(j)).collect();
        let independent: Vec<usize> = self.independent.clone().unwrap_or_else(free);
        let has_motor =
            |j: &usize| !matches!(joints[*j].kind, JointKind::Floating | JointKind::Spherical);
        let driven = || independent.iter().copied().filter(has_motor).collect();
        Submechanism {
            name: self.name.clone(),
            kind,
            type_name: kind.name().into(),
            spanning_tree: self.spanning_tree.clone(),
            active: self.active.clone().unwrap_or_else(driven),
            independent,
            loops,
            closed_forms: true,
        }
    }
}
