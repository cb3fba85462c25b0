//! Independents that would do, whatever a description declares.

use core::slice;

use crate::closure::column_unit;
use crate::compile::analysis::{Sample, Subject, generic_of, idle_motions};
use crate::compile::assemble::Assembly;
use crate::compile::idle::Drift;
use crate::compile::mobility::{good_independents, off_zero, preferred};
use crate::compile::rank::null_space;
use crate::description::Description;
use crate::diagnostic::{CompileError, Site};
use crate::scalar::{Dd, Scalar};

/// Poses off the zero pose at which the loops are looked at.
const TRIALS: usize = 6;

/// Independents that determine every joint.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SuggestedIndependents {
    /// Of each submechanism, in the order of its tree.
    pub independent: Vec<Vec<usize>>,
    /// Joints that spin idly: dependents that no independent has to determine.
    pub idle: Vec<usize>,
}

/// Finds independents at generic closed poses: those that are declared as far as they do, then
/// actuated joints, then joints on the base, then those that move most. Allocates; milliseconds.
///
/// # Errors
/// Faults of the structure, as of [`crate::OpenModel::compile`].
pub fn suggest_independents(
    description: &Description,
) -> Result<SuggestedIndependents, CompileError> {
    let mut errors = Vec::new();
    let assembly = match Assembly::new(description, &mut errors) {
        Some(assembly) if errors.is_empty() => assembly,
        _ => return Err(CompileError { errors, warnings: Vec::new() }),
    };
    let model = assembly.model.map(Dd::to_f64);
    // a joint of several degrees of freedom has a name for each
    let joint_of = |name: &str| {
        let is_it =
            |joint: &str| name == joint || name.rsplit_once('/').is_some_and(|(of, _)| of == joint);
        description.joints.iter().position(|joint| is_it(&joint.name))
    };
    let mut dependent = vec![false; description.joints.len()];
    let mut idle = Vec::new();
    for &c in &model.closed_clusters {
        let cluster = &model.clusters[c];
        let names = assembly.names(c);
        let row_names: Vec<String> =
            cluster.rows.iter().map(|row| assembly.meta.loops[*row].clone()).collect();
        let has_child_cluster: Vec<bool> = (0..cluster.n)
            .map(|b| model.clusters.iter().any(|child| child.parent == cluster.body + b))
            .collect();
        let subject = Subject {
            cluster,
            bodies: model.bodies_of(cluster),
            zero: &model.described_zero[cluster.coordinates()],
            has_child_cluster: &has_child_cluster,
            names: &names,
            row_names: &row_names,
            site: Site::Submechanism(assembly.owner[c]),
        };
        let mut samples: Vec<Sample> = (0..TRIALS).filter_map(|k| off_zero(&subject, k)).collect();
        if samples.is_empty() {
            samples.push(Sample::at(cluster, subject.bodies, subject.zero));
        }
        let Some((rank, generic)) = generic_of(cluster, &samples) else { continue };
        // what is declared may be a joint of a ball: then nothing of it counts
        let [declared, active, on_base] = preferred(cluster);
        let others = [active, on_base].concat();
        let sets = [[declared, others.clone()].concat(), others].map(|preferred| {
            let chosen = good_independents(&subject, generic, cluster.n_v - rank, &preferred);
            let is_idle = |v: &usize| spins(&subject, generic, &chosen, *v);
            chosen.iter().copied().partition::<Vec<_>, _>(is_idle)
        });
        let fits = |(_, chosen): &&(Vec<usize>, Vec<usize>)| {
            let mut cluster = cluster.clone();
            cluster.n_vy = chosen.len();
            cluster.dependent = (0..cluster.n_v).filter(|v| !chosen.contains(v)).collect();
            let trial = Subject { cluster: &cluster, ..subject };
            let at_rank = |at: &&Sample| {
                generic_of(&cluster, slice::from_ref(*at)).is_some_and(|of| of.0 == rank)
            };
            samples.iter().filter(at_rank).all(|at| idle_motions(&trial, at, rank).is_some())
        };
        let Some((idle_ones, chosen)) = sets.iter().find(fits).or(sets.first()) else { continue };
        for (v, name) in names.iter().enumerate() {
            let Some(joint) = joint_of(name) else { continue };
            if idle_ones.contains(&v) {
                idle.push(joint);
            }
            dependent[joint] |= !chosen.contains(&v);
        }
    }
    let independent = description
        .submechanisms
        .iter()
        .map(|of| of.spanning_tree.iter().copied().filter(|joint| !dependent[*joint]).collect())
        .collect();
    idle.dedup();
    Ok(SuggestedIndependents { independent, idle })
}

/// True where the motion that one independent makes alone is idle.
fn spins(subject: &Subject<'_>, at: &Sample, chosen: &[usize], v: usize) -> bool {
    let &Subject { cluster, bodies, has_child_cluster, .. } = subject;
    let others: Vec<usize> = (0..cluster.n_v).filter(|w| *w == v || !chosen.contains(w)).collect();
    let free = null_space(&at.columns(&others, cluster));
    let [direction] = free.as_slice() else { return false };
    let mut rate = vec![0.0; cluster.n_v];
    others.iter().zip(direction).for_each(|(w, x)| rate[*w] = x * column_unit(cluster, *w));
    Drift { cluster, bodies, pose: &at.pose, rate, K: &at.K }.is_idle(has_child_cluster)
}
