//! Chooses the joints that determine a mechanism once some of them are held still.

use std::collections::BTreeMap;

use crate::compile::Structure;
use crate::description::{Description, JointKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::model::{Compiled, Model};
use crate::reduction::exchange::{Exchange, exchange};
use crate::reduction::pose::{Held, zero_position};

/// The reduction of one cluster.
pub(super) struct Choice {
    pub(super) cluster: usize,
    /// Joints that determine its pose together with the independents, and their held positions; a
    /// joint of several degrees of freedom is held at zero.
    pub(super) locked: Vec<(usize, f64)>,
    /// Remaining independents, as declared.
    pub(super) independent: Vec<usize>,
    /// Independents that now depend on these.
    pub(super) dropped: Vec<usize>,
    /// Several joints move together in it.
    pub(super) closed: bool,
}

/// Chooses for a cluster with joints held at the given positions, if any; a fault and `None` if
/// they cannot be held together.
pub(super) fn choose(
    description: &Description,
    structure: &Structure,
    cluster: usize,
    held: &BTreeMap<usize, Option<f64>>,
    compiled: &mut Option<Compiled>,
    errors: &mut Vec<Diagnostic>,
) -> Option<Choice> {
    let joints = &structure.clusters[cluster];
    let declared: Vec<usize> = (description.submechanisms.iter())
        .flat_map(|of| &of.independent)
        .copied()
        .filter(|j| joints.contains(j))
        .collect();
    let is_held = |j: &usize| held.contains_key(j);
    let at_or_zero = |j: usize| (j, held.get(&j).copied().flatten().unwrap_or(0.0));
    let is_coupled = joints.iter().any(|j| description.joints[*j].coupling.is_some());
    let closed = joints.len() > 1 || is_coupled || structure.has_loop(cluster);
    let mut choice = Choice {
        cluster,
        locked: Vec::new(),
        independent: Vec::new(),
        dropped: Vec::new(),
        closed,
    };

    // without a freedom left, or with one less for each independent
    let no_others = joints.iter().filter(|j| is_held(j)).all(|j| declared.contains(j));
    if no_others || declared.iter().all(is_held) {
        let (locked, left): (Vec<usize>, Vec<usize>) = declared.into_iter().partition(is_held);
        choice.locked = locked.into_iter().map(at_or_zero).collect();
        choice.independent = left;
        return Some(choice);
    }

    exchanged(description, held, &declared, joints, choice, compiled, errors)
}

/// Exchanges independents for the dependent joints that are held; a fault and `None` where they
/// cannot be held together.
fn exchanged(
    description: &Description,
    held: &BTreeMap<usize, Option<f64>>,
    declared: &[usize],
    joints: &[usize],
    mut choice: Choice,
    compiled: &mut Option<Compiled>,
    errors: &mut Vec<Diagnostic>,
) -> Option<Choice> {
    let is_held = |j: &usize| held.contains_key(j);
    let locked: Vec<usize> = joints.iter().copied().filter(is_held).collect();
    let name = |j: &usize| description.joints[*j].name.as_str();
    let names = |of: &[usize]| of.iter().map(name).collect::<Vec<_>>().join(", ");
    if compiled.is_none() {
        match Model::compile(description) {
            Ok(whole) => *compiled = Some(whole),
            Err(error) => errors.extend(error.errors),
        }
    }
    let mut fault = |joint: usize, found: String, expected: &str| {
        let help = format!("lock independents instead: {}", names(declared));
        errors.push(Diagnostic::new(Site::Joint(joint), found, expected, help));
        None
    };
    let several = |j: &&usize| {
        matches!(description.joints[**j].kind, JointKind::Spherical | JointKind::Floating)
    };
    let first = locked.iter().find(|j| !declared.contains(j)).copied().unwrap_or_default();
    if let Some(j) = locked.iter().chain(declared).find(several) {
        let found = format!(
            "a lock of {}, which depends on {}, beside the joint {} of several degrees of freedom",
            name(&first),
            names(declared),
            name(j)
        );
        return fault(first, found, "independent joints");
    }
    let (own, others): (Vec<usize>, Vec<usize>) =
        locked.iter().copied().partition(|j| declared.contains(j));
    let (given, found): (Vec<usize>, Vec<usize>) =
        others.into_iter().partition(|j| held.get(j).copied().flatten().is_some());
    let left: Vec<usize> = declared.iter().copied().filter(|j| !is_held(j)).collect();
    let compiled = compiled.as_ref()?;
    let Exchange { held: taken, dropped } =
        exchange(description, &compiled.model, [&given, &found], &left);
    // a mechanism of one freedom stands still as a whole at the zero pose
    if let ([only], [_], []) = (declared, &taken[..], &given[..]) {
        choice.locked = vec![(*only, 0.0)];
        return Some(choice);
    }
    let locked = [own, taken].concat();
    if locked.is_empty() {
        let found = format!("a lock of {}, which never moves", name(&first));
        return fault(first, found, "a joint that moves");
    }
    let left = left.into_iter().filter(|j| !dropped.contains(j)).collect();
    let zero = |j| zero_position(description, &compiled.exact, j);
    let position = |j| held.get(&j).copied().flatten().unwrap_or_else(|| zero(j));
    choice.locked = locked.into_iter().map(|j| (j, position(j))).collect();
    choice.independent = left;
    choice.dropped = dropped;
    Some(choice)
}

impl Choice {
    /// Warnings about a mechanism that keeps some degree of freedom.
    pub(super) fn remarks(&self, description: &Description, held: &Held) -> Vec<Diagnostic> {
        let mut remarks = Vec::new();
        let (Some(&(first, _)), false) = (self.locked.first(), self.independent.is_empty()) else {
            return remarks;
        };
        let name = |j: &usize| description.joints[*j].name.as_str();
        let names = |of: &[usize]| of.iter().map(name).collect::<Vec<_>>().join(", ");
        if !self.dropped.is_empty() {
            remarks.push(Diagnostic::new(
                Site::Joint(first),
                format!(
                    "{} is no independent joint any more: with {} locked it depends on {}",
                    names(&self.dropped),
                    names(&self.locked.iter().map(|(j, _)| *j).collect::<Vec<_>>()),
                    names(&self.independent)
                ),
                "locks of independent joints",
                "leave it, or lock the joint that is not to be independent",
            ));
        }
        let actuators: Vec<usize> = (description.submechanisms.iter())
            .flat_map(|of| &of.active)
            .copied()
            .filter(|j| held.remaining.contains(&(*j, self.cluster)))
            .collect();
        if actuators.len() > self.independent.len() {
            remarks.push(Diagnostic::new(
                Site::Joint(first),
                format!(
                    "{} actuators ({}) that move {} independent joint{} ({})",
                    actuators.len(),
                    names(&actuators),
                    self.independent.len(),
                    if self.independent.len() == 1 { "" } else { "s" },
                    names(&self.independent)
                ),
                "as many",
                "nothing to do: inverse dynamics shares forces among them by least norm",
            ));
        }
        remarks
    }
}
