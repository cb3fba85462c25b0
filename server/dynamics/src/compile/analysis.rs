//! Rank, rows, blocks and mobility of a cluster's loops, fixed at load at sampled closed poses.

use sarrus_factorisations::{Mat, thin_svd};

use crate::closure::{
    Blocks, Level, Local, Numerical, Scratch, column_unit, constraint_residual, local_poses, scaled,
};
use crate::compile::assemble::Labels;
use crate::compile::blocks::{blocks, levers, sizes};
use crate::compile::idle::Drift;
use crate::compile::rank::{independent_rows, locks, matrix, null_space, rank};
use crate::compile::{mobility, redundant};
use crate::diagnostic::{Diagnostic, Site};
use crate::mechanism::{Body, Cluster};
use crate::model::Model;
use crate::scalar::{Dd, Real, noise};
use crate::spatial::Pose;
use sarrus_proto::Status;

/// Number of poses for the rank, and their distance from zero, in radians or cluster lengths.
pub(super) const POSES: usize = 3;
const REACH: f64 = 0.2;
/// Steps in which the offsets of couplings are reached from the zero pose.
const OFFSET_STEPS: usize = 64;
/// Deviation up to which a described zero pose already satisfies an offset `[m, rad]`.
const THERE: f64 = 1e-12;
/// Largest gap of a loop at zero, in cluster lengths.
const OPEN: f64 = 1e-6;
/// Gap at zero that the rounding of a file's numbers explains, in cluster lengths.
const ROUNDED: f64 = 1e-14;

/// Result of the analysis of one cluster.
pub(super) struct Analysis {
    pub(super) used: Vec<usize>,
    /// Other rows that may serve instead.
    pub(super) other_rows: Vec<Vec<usize>>,
    /// Of each choice of rows, the used ones first.
    pub(super) choices: Vec<Blocks>,
    /// Idle dependents, which keep their initial value.
    pub(super) locked: Vec<usize>,
}

/// A cluster at one closed pose: scaled K (rows × n_v, row-major) and the poses of its bodies.
pub(super) struct Sample {
    pub(super) K: Vec<f64>,
    pub(super) pose: Vec<Pose<f64>>,
}

impl Sample {
    /// The scaled K and the poses at q.
    pub(super) fn at(cluster: &Cluster<f64>, bodies: &[Body<f64>], q: &[f64]) -> Sample {
        let n = cluster.n_v;
        let Scratch { pose, K: unscaled, .. } = Scratch::at(cluster, bodies, q);
        let mut K = vec![0.0; cluster.rows.len() * n];
        let all: Vec<usize> = (0..n).collect();
        scaled(cluster, &unscaled, 0..cluster.rows.len(), &all, |r, v, x| K[r * n + v] = x);
        Sample { K, pose }
    }

    /// Columns of the scaled K.
    pub(super) fn columns(&self, columns: &[usize], cluster: &Cluster<f64>) -> Mat<f64> {
        matrix(&self.K, cluster.rows.len(), cluster.n_v, columns)
    }
}

/// The pose of highest rank, which is generic, and that rank.
pub(super) fn generic_of<'a>(
    cluster: &Cluster<f64>,
    samples: &'a [Sample],
) -> Option<(usize, &'a Sample)> {
    let all: Vec<usize> = (0..cluster.n_v).collect();
    samples
        .iter()
        .map(|sample| (rank(&sample.columns(&all, cluster)), sample))
        .max_by_key(|(rank, _)| *rank)
}

/// A cluster with the names for messages about it.
pub(super) struct Subject<'a> {
    pub(super) cluster: &'a Cluster<f64>,
    pub(super) bodies: &'a [Body<f64>],
    /// Its coordinates at the zero pose.
    pub(super) zero: &'a [f64],
    /// Of each of its bodies.
    pub(super) has_child_cluster: &'a [bool],
    /// Names of its velocities and of its rows.
    pub(super) names: &'a [String],
    pub(super) row_names: &'a [String],
    pub(super) site: Site,
}

impl<'a> Subject<'a> {
    pub(super) fn new(model: &'a Model<f64>, c: usize, labels: &'a Labels) -> Subject<'a> {
        let cluster = &model.clusters[c];
        Subject {
            cluster,
            bodies: model.bodies_of(cluster),
            zero: &model.described_zero[cluster.coordinates()],
            has_child_cluster: &labels.has_child_cluster,
            names: &labels.names,
            row_names: &labels.row_names,
            site: labels.site,
        }
    }
}

/// Rank, rows and blocks of a cluster; faults where the mobility does not fit the declared
/// independents. Couplings that are solved determine every dependent, of any size.
pub(super) fn analyse(
    subject: &Subject<'_>,
    is_solved: bool,
    errors: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Diagnostic>,
) -> Option<Analysis> {
    let &Subject { cluster, names, site, .. } = subject;
    let samples: Vec<Sample> = (0..POSES).map(|k| sample(subject, k)).collect();
    let (rank, generic) = generic_of(cluster, &samples)?;
    let drift = if is_solved { Some(Vec::new()) } else { idle_motions(subject, generic, rank) };
    let Some(drift) = drift else {
        errors.push(mobility::fault(subject, generic, rank));
        return None;
    };

    // one joint of each idle motion stands still: the one that moves most
    let locked = locks(&drift).iter().map(|a| cluster.dependent[*a]).collect::<Vec<_>>();
    let mut cluster = cluster.clone();
    cluster.dependent.retain(|v| !locked.contains(v));
    if !locked.is_empty() {
        warnings.push(Diagnostic::new(
            site,
            format!(
                "idle joints, which turn a rod between its ball joints and nothing else: {}",
                joined(names, &locked)
            ),
            format!(
                "{} joints that the independents determine",
                drift.len() + cluster.dependent.len()
            ),
            "they keep the value of the guess, zero without one, and have no velocity",
        ));
    }

    let screws = cluster.cuts.iter().flat_map(|cut| &cut.rows).map(|row| row.screw.as_ref());
    let screws = screws.zip(subject.row_names);
    for (_, name) in screws.filter(|(screw, _)| screw.is_some_and(|of| of.joints.is_empty())) {
        warnings.push(Diagnostic::new(
            site,
            format!("{name}: a screw along whose line no joint turns"),
            "a joint of the loop along it, whose coordinate counts the turns",
            "turn it by less than half a turn from zero, where its slide is known",
        ));
    }
    let n_dependent = cluster.dependent.len();
    let used = independent_rows(&generic.columns(&cluster.dependent, &cluster), n_dependent);
    if used.len() < cluster.rows.len() {
        redundant::warn(subject, &cluster, generic, &used, warnings);
    }
    let at_zero = Sample::at(&cluster, subject.bodies, subject.zero);
    let others: Vec<&[f64]> = samples.iter().chain([&at_zero]).map(|at| &at.K[..]).collect();
    let mut choices = vec![blocks(&cluster, &used, &generic.K, &others)];
    let mut other_rows = Vec::new();
    for (other, at) in redundant::choices(subject, &cluster, &used) {
        choices.push(blocks(&cluster, &other, &at.K, &[&at.K]));
        other_rows.push(other);
    }
    let poses: Vec<&[_]> = samples.iter().chain([&at_zero]).map(|at| &at.pose[..]).collect();
    for block in choices.iter_mut().flat_map(|choice| &mut choice.blocks) {
        block.sizes = sizes(&cluster, block, &others);
        block.volume = block.sizes.iter().product();
        block.levers = levers(&cluster, block, &poses).unwrap_or_default();
    }
    Some(Analysis { used, other_rows, choices, locked })
}

/// The idle motions of the dependents; `None` if the independents leave other motions undetermined
/// or the mobility differs from the declared one.
pub(super) fn idle_motions(
    subject: &Subject<'_>,
    at: &Sample,
    rank: usize,
) -> Option<Vec<Vec<f64>>> {
    let cluster = subject.cluster;
    let drift = null_space(&at.columns(&cluster.dependent, cluster));
    let excess = (cluster.n_v - rank).checked_sub(cluster.n_vy);
    let is_idle = |direction: &Vec<f64>| is_idle_along(subject, at, &cluster.dependent, direction);
    (excess == Some(drift.len()) && drift.iter().all(is_idle)).then_some(drift)
}

/// True where a motion is idle, given by its direction along these velocities in their units.
pub(super) fn is_idle_along(
    subject: &Subject<'_>,
    at: &Sample,
    along: &[usize],
    direction: &[f64],
) -> bool {
    let &Subject { cluster, bodies, has_child_cluster, .. } = subject;
    let mut rate = vec![0.0; cluster.n_v];
    along.iter().zip(direction).for_each(|(v, x)| rate[*v] = x * column_unit(cluster, *v));
    Drift { cluster, bodies, pose: &at.pose, rate, K: &at.K }.is_idle(has_child_cluster)
}

/// Some of the names, for a message.
pub(super) fn joined(names: &[String], indices: &[usize]) -> String {
    indices.iter().map(|i| names[*i].as_str()).collect::<Vec<_>>().join(", ")
}

/// Finds the closed pose at y = 0 to the last digit: the zero pose of the joints, unless couplings
/// have offsets. A fault where the loops are open there.
pub(super) fn close_zero(
    cluster: &Cluster<Dd>,
    bodies: &[Body<Dd>],
    numerical: &mut Numerical<Dd>,
    site: Site,
) -> Option<Diagnostic> {
    let mut scratch = Scratch::new(cluster.n_q, cluster.rows.len());
    let mut state = State::new(cluster, &numerical.zero);
    local_poses(cluster, bodies, &state.q, &mut state.cos_sin, &mut scratch.pose);
    constraint_residual(cluster, &scratch.pose, &state.q, &mut scratch.phi);
    let rows = cluster.cuts.iter().flat_map(|cut| &cut.rows);
    let gap = |couplings: bool| {
        let rows = rows.clone().zip(&scratch.phi);
        rows.filter(|(row, _)| row.terms.is_empty() != couplings)
            .fold(0.0, |gap: f64, (_, phi)| gap.max(phi.to_f64().abs()))
    };
    let open = gap(false);
    let offset = gap(true);
    if open > OPEN * cluster.length {
        return Some(Diagnostic::new(
            site,
            format!("a loop that is open by {open:.3e} m (or rad) at the zero pose"),
            "placements that coincide at zero",
            "correct predecessor_placement, successor_placement or the joints' origins; \
            `sarrus check --assemble --write OUT.urdf` does it",
        ));
    }
    if open <= 1e-28 * cluster.length && offset == 0.0 {
        return None;
    }
    // offsets grow from zero in steps
    let steps = if offset <= THERE { 1 } else { OFFSET_STEPS };
    let mut part = cluster.clone();
    for k in 1..=steps {
        let share = Dd::from(k as f64) / Dd::from(steps as f64);
        for (row, whole) in part
            .cuts
            .iter_mut()
            .flat_map(|cut| &mut cut.rows)
            .zip(cluster.cuts.iter().flat_map(|cut| &cut.rows))
        {
            row.offset = whole.offset * share;
        }
        let outcome =
            numerical.close(&mut state.local(&part, bodies, &mut scratch), Level::Position);
        // at a dead point the rounding of a file has no correction
        if offset == 0.0 && open <= ROUNDED * cluster.length && outcome.status != Status::Ok {
            return None;
        }
        if outcome.status != Status::Ok {
            return Some(Diagnostic::new(
                site,
                format!("loops that do not close at y = 0 ({})", outcome.status),
                "a closed pose where the independents are zero and the couplings have their \
                offsets",
                "correct the offsets of the couplings, or the zero pose if it is a dead point: \
                 `sarrus check --assemble --near JOINT=0.1,… --write OUT.urdf`",
            ));
        }
        state.start.copy_from_slice(&state.q);
    }
    numerical.zero.copy_from_slice(&state.q);
    None
}

/// Numbers of one cluster, outside any workspace.
pub(super) struct State<T> {
    start: Vec<T>,
    pub(super) q: Vec<T>,
    cos_sin: Vec<(T, T)>,
    qd: Vec<T>,
    G: Vec<T>,
    g: Vec<T>,
}

impl<T: Real> State<T> {
    pub(super) fn new(cluster: &Cluster<T>, zero: &[T]) -> State<T> {
        State {
            start: zero.to_vec(),
            q: zero.to_vec(),
            cos_sin: vec![(T::ONE, T::ZERO); cluster.n],
            qd: vec![T::ZERO; cluster.n_v],
            G: vec![T::ZERO; cluster.n_v * cluster.n_vy],
            g: vec![T::ZERO; cluster.n_v],
        }
    }

    pub(super) fn local<'a>(
        &'a mut self,
        cluster: &'a Cluster<T>,
        bodies: &'a [Body<T>],
        scratch: &'a mut Scratch<T>,
    ) -> Local<'a, T> {
        Local {
            cluster,
            bodies,
            start: &self.start,
            from_zero: false,
            is_trial: false,
            tangent: None,
            q: &mut self.q,
            cos_sin: &mut self.cos_sin,
            qd: &mut self.qd,
            G: &mut self.G,
            g: &mut self.g,
            scratch,
        }
    }
}

/// A closed pose at some distance from zero, found by damped steps of least norm, which need no
/// rank; and the scaled K there.
fn sample(subject: &Subject<'_>, k: usize) -> Sample {
    let &Subject { cluster, bodies, zero, .. } = subject;
    let mut q = zero.to_vec();
    let mut closed = q.clone();
    const SUBSTEPS: usize = 8;
    for _ in 0..SUBSTEPS {
        for (i, &j) in cluster.independent.iter().enumerate() {
            let unit = column_unit(cluster, j);
            let step = REACH * unit * noise(31 * k + i) / SUBSTEPS as f64;
            cluster.dofs[j].advance(&mut q, step);
        }
        if !closed_near(cluster, bodies, &mut q, &cluster.dependent) {
            break;
        }
        closed.copy_from_slice(&q);
    }
    Sample::at(cluster, bodies, &closed)
}

/// Closes all rows by steps of least norm of some velocities; false if they stay open.
pub(super) fn closed_near(
    cluster: &Cluster<f64>,
    bodies: &[Body<f64>],
    q: &mut [f64],
    free: &[usize],
) -> bool {
    let rows = cluster.rows.len();
    let mut phi = vec![0.0; rows];
    for _ in 0..30 {
        let Scratch { pose, K, .. } = Scratch::at(cluster, bodies, q);
        constraint_residual(cluster, &pose, q, &mut phi);
        if phi.iter().all(|x| x.abs() < 1e-9 * cluster.length) {
            return true;
        }
        let K_free = matrix(&K, rows, cluster.n_v, free);
        let Some(svd) = thin_svd(&K_free) else { return false };
        let S = svd.S().column_vector();
        for a in 0..S.nrows() {
            if S[a] > 1e-6 * S[0] {
                let along: f64 = (0..rows).map(|r| svd.U()[(r, a)] * phi[r]).sum::<f64>() / S[a];
                for (i, &j) in free.iter().enumerate() {
                    cluster.dofs[j].advance(q, -svd.V()[(i, a)] * along);
                }
            }
        }
    }
    false
}
