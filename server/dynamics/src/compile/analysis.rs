//! What is fixed at load about the loops of a cluster: rank, rows, blocks, mobility; and the checks
//! that need closed poses.

use faer::Mat;

use crate::closure::{
    Blocks, Level, Local, Numerical, Scratch, column_unit, constraint_jacobian,
    constraint_residual, local_poses, scaled,
};
use crate::compile::blocks::blocks;
use crate::compile::idle::Drift;
use crate::compile::rank::{RANK_GAP, independent_rows, locks, matrix, null_space, rank};
use crate::diagnostic::{Diagnostic, Site};
use crate::mechanism::{Body, Cluster};
use crate::scalar::{Dd, Scalar, noise};
use crate::spatial::Pose;
use sarrus_proto::Status;

/// Poses at which rank is judged, and how far from zero they lie, in radians or cluster lengths.
pub(super) const POSES: usize = 3;
const REACH: f64 = 0.2;
/// Steps in which the offsets of couplings are reached from the zero pose.
const OFFSET_STEPS: usize = 64;
/// Largest gap of a loop at zero, in cluster lengths.
const OPEN: f64 = 1e-6;

/// The result for one cluster.
pub(super) struct Analysis {
    pub(super) used: Vec<usize>,
    pub(super) blocks: Blocks,
    /// Idle dependents that keep the value that they start with.
    pub(super) locked: Vec<usize>,
}

/// A cluster at one closed pose: scaled K (rows × n_v, row-major) and the poses of its bodies.
struct Sample {
    K: Vec<f64>,
    pose: Vec<Pose<f64>>,
}

/// A cluster with what a message about it needs.
pub(super) struct Subject<'a> {
    pub(super) cluster: &'a Cluster<f64>,
    pub(super) bodies: &'a [Body<f64>],
    /// Of each of its bodies.
    pub(super) has_child_cluster: &'a [bool],
    /// Names of its velocities and of its rows.
    pub(super) names: &'a [String],
    pub(super) row_names: &'a [String],
    pub(super) site: Site,
}

/// Rank, rows and blocks of a cluster; faults where the mobility does not fit the declared
/// independents.
pub(super) fn analyse(
    subject: &Subject<'_>,
    errors: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Diagnostic>,
) -> Option<Analysis> {
    let &Subject { cluster, bodies, has_child_cluster, names, row_names, site } = subject;
    let (n, rows) = (cluster.n_v, cluster.rows.len());
    let samples: Vec<Sample> = (0..POSES).map(|k| sample(cluster, bodies, k)).collect();

    // the pose of highest rank is generic
    let (rank, generic) = samples
        .iter()
        .map(|sample| (rank(&matrix(&sample.K, rows, n, &(0..n).collect::<Vec<_>>())), sample))
        .max_by_key(|x| x.0)?;
    let K_d = matrix(&generic.K, rows, n, &cluster.dependent);
    let drift = null_space(&K_d);
    let excess = (n - rank).checked_sub(cluster.n_vy);
    if excess != Some(drift.len())
        || drift.iter().any(|motion| !is_idle(cluster, bodies, has_child_cluster, generic, motion))
    {
        errors.push(wrong_mobility(cluster, &K_d, rank, names, row_names, site));
        return None;
    }

    // one joint of each idle motion stands still: the one that moves most
    let locked = locks(&drift).iter().map(|a| cluster.dependent[*a]).collect::<Vec<_>>();
    let mut cluster = cluster.clone();
    cluster.dependent.retain(|v| !locked.contains(v));
    if !locked.is_empty() {
        let name = |v: &usize| names[*v].as_str();
        warnings.push(Diagnostic {
            site,
            found: format!(
                "idle joints, which turn a rod between its ball joints and nothing else: {}",
                list(&locked, name)
            ),
            expected: format!(
                "{} joints that the independents determine",
                drift.len() + cluster.dependent.len()
            ),
            help: "they keep the value of the guess, zero without one, and have no velocity".into(),
        });
    }

    let n_dependent = cluster.dependent.len();
    let K_d = matrix(&generic.K, rows, n, &cluster.dependent);
    let used = independent_rows(&K_d, n_dependent);
    if used.len() < rows {
        let dropped = (0..rows).filter(|r| !used.contains(r)).map(|r| {
            format!(
                "{} (off by {:.1e} along the motion)",
                row_names[r],
                off_by(&samples, &cluster, r, n)
            )
        });
        warnings.push(Diagnostic {
            site,
            found: format!("redundant constraint axes: {}", dropped.collect::<Vec<_>>().join(", ")),
            expected: format!("{n_dependent} independent axes for {n_dependent} dependent joints"),
            help: "they are left out of the solution; what the loop-closure forces share is the \
                least norm"
                .into(),
        });
    }
    let blocks = blocks(&cluster, &used, &generic.K);
    Some(Analysis { used, blocks, locked })
}

/// True where a direction of the dependents is idle at a sample.
fn is_idle(
    cluster: &Cluster<f64>,
    bodies: &[Body<f64>],
    has_child_cluster: &[bool],
    at: &Sample,
    direction: &[f64],
) -> bool {
    let mut rate = vec![0.0; cluster.n_v];
    cluster
        .dependent
        .iter()
        .zip(direction)
        .for_each(|(v, x)| rate[*v] = x * column_unit(cluster, *v));
    Drift { cluster, bodies, pose: &at.pose, rate, K: &at.K }.is_idle(has_child_cluster)
}

fn list<'a>(of: &[usize], name: impl Fn(&usize) -> &'a str) -> String {
    of.iter().map(name).collect::<Vec<_>>().join(", ")
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
    let gap = |of_coupling: bool| {
        let of_kind =
            rows.clone().zip(&scratch.phi).filter(|(row, _)| row.terms.is_empty() != of_coupling);
        of_kind.fold(0.0, |gap: f64, (_, phi)| gap.max(phi.to_f64().abs()))
    };
    let (open, offset) = (gap(false), gap(true));
    if open > OPEN * cluster.length {
        return Some(Diagnostic {
            site,
            found: format!("a loop that is open by {open:.3e} m (or rad) at the zero pose"),
            expected: "placements that coincide at zero".into(),
            help: "correct predecessor_placement, successor_placement or the joints' origins; \
                `sarrus check --assemble --write OUT.urdf` does it"
                .into(),
        });
    }
    if open <= 1e-28 * cluster.length && offset == 0.0 {
        return None;
    }
    // the offsets come in little by little
    let steps = if offset == 0.0 { 1 } else { OFFSET_STEPS };
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
            numerical.close(&part, bodies, &mut state.local(&mut scratch), Level::Position);
        if outcome.status != Status::Ok {
            return Some(Diagnostic {
                site,
                found: format!("loops that do not close at y = 0 ({})", outcome.status),
                expected:
                    "a closed pose where the independents are zero and the couplings have their \
                    offsets"
                        .into(),
                help: "correct the offsets of the couplings".into(),
            });
        }
        state.start.copy_from_slice(&state.q);
    }
    numerical.zero.copy_from_slice(&state.q);
    None
}

/// Numbers of one cluster, outside any workspace.
struct State<T> {
    start: Vec<T>,
    q: Vec<T>,
    cos_sin: Vec<(T, T)>,
    qd: Vec<T>,
    G: Vec<T>,
    g: Vec<T>,
}

impl<T: Scalar> State<T> {
    fn new(cluster: &Cluster<T>, zero: &[T]) -> State<T> {
        State {
            start: zero.to_vec(),
            q: zero.to_vec(),
            cos_sin: vec![(T::ONE, T::ZERO); cluster.n],
            qd: vec![T::ZERO; cluster.n_v],
            G: vec![T::ZERO; cluster.n_v * cluster.n_vy],
            g: vec![T::ZERO; cluster.n_v],
        }
    }

    fn local<'a>(&'a mut self, scratch: &'a mut Scratch<T>) -> Local<'a, T> {
        Local {
            start: &self.start,
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
fn sample(cluster: &Cluster<f64>, bodies: &[Body<f64>], k: usize) -> Sample {
    let (n, rows) = (cluster.n_v, cluster.rows.len());
    let mut cos_sin = vec![(1.0, 0.0); cluster.n];
    let mut pose = vec![Pose::identity(); cluster.n + 1];
    let (mut phi, mut K) = (vec![0.0; rows], vec![0.0; rows * n]);
    let mut q = vec![0.0; cluster.n_q];
    for at in cluster.dofs.iter().filter(|at| at.motion.n_q() > 1 && at.k == 0) {
        q[at.q + at.motion.n_q() - 1] = 1.0;
    }
    let mut closed = q.clone();
    const SUBSTEPS: usize = 8;
    for _ in 0..SUBSTEPS {
        for (i, &j) in cluster.independent.iter().enumerate() {
            let (at, unit) =
                (&cluster.dofs[j], if cluster.dofs[j].slides() { cluster.length } else { 1.0 });
            at.advance(&mut q, REACH * unit * noise(31 * k + i) / SUBSTEPS as f64);
        }
        let mut done = false;
        for _ in 0..30 {
            local_poses(cluster, bodies, &q, &mut cos_sin, &mut pose);
            constraint_residual(cluster, &pose, &q, &mut phi);
            constraint_jacobian(cluster, &pose, &mut K);
            if phi.iter().all(|x| x.abs() < 1e-9 * cluster.length) {
                done = true;
                break;
            }
            let K_d = matrix(&K, rows, n, &cluster.dependent);
            let Ok(svd) = K_d.thin_svd() else { break };
            let (U, S, V) = (svd.U(), svd.S().column_vector(), svd.V());
            for a in 0..S.nrows() {
                if S[a] > 1e-6 * S[0] {
                    let along: f64 = (0..rows).map(|r| U[(r, a)] * phi[r]).sum::<f64>() / S[a];
                    for (i, &j) in cluster.dependent.iter().enumerate() {
                        cluster.dofs[j].advance(&mut q, -V[(i, a)] * along);
                    }
                }
            }
        }
        if !done {
            break;
        }
        closed.copy_from_slice(&q);
    }
    local_poses(cluster, bodies, &closed, &mut cos_sin, &mut pose);
    constraint_jacobian(cluster, &pose, &mut K);
    let mut scaled_K = vec![0.0; rows * n];
    scaled(cluster, &K, 0..rows, &(0..n).collect::<Vec<_>>(), |r, v, x| scaled_K[r * n + v] = x);
    Sample { K: scaled_K, pose }
}

/// How much a dropped row would move along the true motion, relative to its size.
fn off_by(samples: &[Sample], cluster: &Cluster<f64>, r: usize, n: usize) -> f64 {
    let rows = cluster.rows.len();
    let mut worst: f64 = 0.0;
    for sample in samples {
        let K = matrix(&sample.K, rows, n, &(0..n).collect::<Vec<_>>());
        let Ok(svd) = K.svd() else { continue };
        // null space of K up to the gap: what moves
        let (S, V) = (svd.S().column_vector(), svd.V());
        let size = (0..n).map(|j| K[(r, j)] * K[(r, j)]).sum::<f64>().sqrt();
        for a in 0..n {
            if a >= S.nrows() || S[a] <= RANK_GAP * S[0] {
                let along: f64 = (0..n).map(|j| K[(r, j)] * V[(j, a)]).sum();
                worst = worst.max(along.abs() / size);
            }
        }
    }
    worst
}

/// The fault of a mobility that does not fit: redundant rows and idle joints by name.
fn wrong_mobility(
    cluster: &Cluster<f64>,
    K_d: &Mat<f64>,
    rank: usize,
    names: &[String],
    row_names: &[String],
    site: Site,
) -> Diagnostic {
    let mobility = cluster.n_v - rank;
    let mut found = format!(
        "mobility {mobility} ({} joints less rank {rank} of {} rows)",
        cluster.n_v,
        cluster.rows.len()
    );
    if rank < cluster.rows.len() {
        let kept = independent_rows(K_d, crate::compile::rank::rank(K_d).min(K_d.nrows()));
        let redundant = (0..cluster.rows.len())
            .filter(|r| !kept.contains(r))
            .map(|r| row_names[r].as_str())
            .collect::<Vec<_>>();
        found += &format!("; redundant rows: {}", redundant.join(", "));
    }
    // joints that can still move when all independents stand still
    let drift = null_space(K_d);
    let moving = cluster
        .dependent
        .iter()
        .enumerate()
        .filter(|(i, _)| drift.iter().any(|motion| motion[*i].abs() > 1e-3));
    let moving = moving.map(|(_, v)| names[*v].as_str()).collect::<Vec<_>>();
    if !moving.is_empty() {
        found += &format!("; joints that the independents do not determine: {}", moving.join(", "));
    }
    Diagnostic {
        site,
        found,
        expected: format!("mobility {} as declared by jointnames_independent", cluster.n_vy),
        help: "change jointnames_independent or loop_constraints".into(),
    }
}
