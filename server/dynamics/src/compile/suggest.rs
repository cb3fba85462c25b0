//! Suggests independents from the loops alone.

use core::slice;

use crate::compile::analysis::{Sample, Subject, generic_of, idle_motions, is_idle_along};
use crate::compile::assemble::Assembly;
use crate::compile::mobility::{good_independents, off_zero, preferred};
use crate::compile::rank::null_space;
use crate::description::Description;
use crate::diagnostic::CompileError;
use crate::mechanism::Cluster;
use crate::scalar::{Dd, Real};

/// Sampled poses off the zero pose.
const TRIALS: usize = 6;

/// Independents that determine every joint.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SuggestedIndependents {
    /// Independents of each submechanism, in the order of its tree.
    pub independent: Vec<Vec<usize>>,
    /// Dependents that spin idly: no independent determines them.
    pub idle: Vec<usize>,
    /// Joints of several degrees of freedom of which some are independent and some are not.
    pub split: Vec<usize>,
}

/// Finds independents at generic closed poses, in this order of preference: declared independents,
/// actuated joints, joints on the base, joints of large motion. Allocates; takes milliseconds.
///
/// # Errors
/// Faults of the structure, as for [`crate::OpenModel::compile`].
pub fn suggest_independents(
    description: &Description,
) -> Result<SuggestedIndependents, CompileError> {
    let mut errors = Vec::new();
    let Some(assembly) = Assembly::new(description, &mut errors) else {
        return Err(CompileError::of(errors));
    };
    let model = assembly.model.map(Dd::to_f64);
    // a joint of several degrees of freedom has a name for each
    let joint_of = |name: &str| {
        let is_part = |joint: &str| name.rsplit_once('/').is_some_and(|(of, _)| of == joint);
        let find = |is_it: &dyn Fn(&str) -> bool| {
            description.joints.iter().position(|joint| is_it(&joint.name))
        };
        find(&|joint| joint == name).or_else(|| find(&is_part))
    };
    let mut dependent = vec![false; description.joints.len()];
    let [mut idle, mut split] = [const { Vec::new() }; 2];
    for &c in &model.closed_clusters {
        let labels = assembly.labels(c);
        let subject = Subject::new(&model, c, &labels);
        let Some([idle_ones, chosen]) = suggest(&subject) else { continue };
        for (v, name) in labels.names.iter().enumerate() {
            let Some(joint) = joint_of(name) else { continue };
            if idle_ones.contains(&v) {
                idle.push(joint);
            }
            dependent[joint] |= !chosen.contains(&v);
            split.extend(is_split(subject.cluster, &chosen, v).then_some(joint));
        }
    }
    let independent = description
        .submechanisms
        .iter()
        .map(|s| s.spanning_tree.iter().copied().filter(|joint| !dependent[*joint]).collect())
        .collect();
    idle.dedup();
    split.dedup();
    Ok(SuggestedIndependents { independent, idle, split })
}

/// Idle velocities of a cluster, and its independent velocities.
fn suggest(subject: &Subject<'_>) -> Option<[Vec<usize>; 2]> {
    let cluster = subject.cluster;
    let mut samples: Vec<Sample> = (0..TRIALS).filter_map(|k| off_zero(subject, k)).collect();
    if samples.is_empty() {
        samples.push(Sample::at(cluster, subject.bodies, subject.zero));
    }
    let (rank, generic) = generic_of(cluster, &samples)?;
    // a declared independent may be one freedom of a ball: then no declared one counts
    let [declared, active, on_base] = preferred(subject);
    let others = [active, on_base].concat();
    let body = |v: usize| cluster.dofs[v].body;
    let is_single = |v: &usize| (0..cluster.n_v).all(|w| w == *v || body(w) != body(*v));
    // without the balls, where one of their freedoms is idle
    let singles = others.iter().copied().chain(0..cluster.n_v).filter(is_single).collect();
    let sets = [[declared, others.clone()].concat(), others, singles].map(|preferred| {
        let chosen = good_independents(subject, generic, cluster.n_v - rank, &preferred);
        let is_idle = |v: &usize| spins(subject, generic, &chosen, *v);
        let (idle, chosen) = chosen.iter().copied().partition::<Vec<_>, _>(is_idle);
        [idle, chosen]
    });
    let fits = |[_, chosen]: &&[Vec<usize>; 2]| {
        if (0..cluster.n_v).any(|v| is_split(cluster, chosen, v)) {
            return false;
        }
        let mut cluster = cluster.clone();
        cluster.n_vy = chosen.len();
        cluster.dependent = (0..cluster.n_v).filter(|v| !chosen.contains(v)).collect();
        let trial = Subject { cluster: &cluster, ..*subject };
        let at_rank = |at: &&Sample| {
            generic_of(&cluster, slice::from_ref(*at)).is_some_and(|(own, _)| own == rank)
        };
        samples.iter().filter(at_rank).all(|at| idle_motions(&trial, at, rank).is_some())
    };
    sets.iter().find(fits).or(sets.first()).cloned()
}

/// True where a velocity depends on the chosen ones although others of its joint are among them.
fn is_split(cluster: &Cluster<f64>, chosen: &[usize], v: usize) -> bool {
    let body = |v: usize| cluster.dofs[v].body;
    !chosen.contains(&v) && chosen.iter().any(|w| body(*w) == body(v))
}

/// True where the motion that one independent makes alone is idle.
fn spins(subject: &Subject<'_>, at: &Sample, chosen: &[usize], v: usize) -> bool {
    let cluster = subject.cluster;
    let others: Vec<usize> = (0..cluster.n_v).filter(|w| *w == v || !chosen.contains(w)).collect();
    let free = null_space(&at.columns(&others, cluster));
    matches!(free.as_slice(), [direction] if is_idle_along(subject, at, &others, direction))
}
