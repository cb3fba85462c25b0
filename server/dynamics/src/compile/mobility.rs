//! Explains a mobility that contradicts the declared independents, and suggests a correction.

use nalgebra::Vector6;
use sarrus_factorisations::Mat;

use crate::closure::column_unit;
use crate::compile::analysis::{Sample, Subject, closed_near, generic_of, idle_motions, joined};
use crate::compile::idle::floats;
use crate::compile::rank::{RANK_GAP, independent_rows, null_space, rank};
use crate::compile::redundant::fitting_cuts;
use crate::diagnostic::Diagnostic;
use crate::scalar::noise;

/// Sampled poses off the zero pose, and their distance from it in radians or cluster lengths.
const TRIALS: usize = 6;
const REACH: f64 = 0.3;
/// Least motion of a preferred independent, relative to the largest.
const ENOUGH: f64 = 0.05;
/// Least share of a joint in a motion of unit size.
const MOVES: f64 = 1e-3;

/// The fault of a mobility that differs from the declared one: dead points, redundant rows and
/// undetermined joints by name.
pub(super) fn fault(subject: &Subject<'_>, generic: &Sample, rank_of_K: usize) -> Diagnostic {
    let &Subject { cluster, names, site, .. } = subject;
    let mobility = cluster.n_v - rank_of_K;
    let K_d = generic.columns(&cluster.dependent, cluster);
    let drift = null_space(&K_d);
    let moves = |i: &usize| drift.iter().any(|motion| motion[*i].abs() > MOVES);
    let moving: Vec<usize> = (0..K_d.ncols()).filter(moves).map(|i| cluster.dependent[i]).collect();
    if is_dead_point(subject) {
        return dead_point(subject, &moving);
    }
    let good = || {
        let good = good_independents(subject, generic, mobility, &preferred(subject).concat());
        whole_joints(subject, &good).join(", ")
    };
    let mut found = format!(
        "mobility {mobility} ({} joints less rank {rank_of_K} of {} rows)",
        cluster.n_v,
        cluster.rows.len()
    );
    if mobility == cluster.n_vy {
        found += &format!(
            ", but the independents {} do not determine {}",
            joined(names, &cluster.independent),
            joined(names, &moving)
        );
        return Diagnostic::new(
            site,
            found,
            "independents that determine every joint",
            format!("write jointnames_independent: [{}], or correct loop_constraints", good()),
        );
    }
    let mut fitting = String::new();
    if rank_of_K < cluster.rows.len() {
        let kept = independent_rows(&K_d, rank(&K_d).min(K_d.nrows()));
        let redundant: Vec<usize> = (0..cluster.rows.len()).filter(|r| !kept.contains(r)).collect();
        found += &format!("; redundant rows: {}", joined(subject.row_names, &redundant));
        found += &rounded_rows(subject, &redundant);
        fitting = fitting_cuts(subject, generic, &redundant);
    }
    if !moving.is_empty() {
        found +=
            &format!("; joints that the independents do not determine: {}", joined(names, &moving));
    }
    let such_as = if mobility > 0 { format!(" (such as [{}])", good()) } else { String::new() };
    let separator = if fitting.is_empty() { "" } else { "; " };
    Diagnostic::new(
        site,
        found,
        format!("mobility {} as declared by jointnames_independent", cluster.n_vy),
        format!("change jointnames_independent{such_as} or loop_constraints{separator}{fitting}"),
    )
}

/// Names redundant rows that the rows before them in their cut imply up to a small angle, which
/// counts as rounding.
fn rounded_rows(subject: &Subject<'_>, redundant: &[usize]) -> String {
    let mut words = String::new();
    let mut names = subject.row_names.iter();
    let mut first = 0;
    for cut in &subject.cluster.cuts {
        let mut axes: Vec<Vector6<f64>> = Vec::new();
        let is_redundant = (first..first + cut.rows.len()).any(|r| redundant.contains(&r));
        first += cut.rows.len();
        for (row, name) in cut.rows.iter().zip(&mut names) {
            if !row.terms.is_empty() || row.against.is_some() {
                continue;
            }
            let [a, l] = [row.angular, row.linear / subject.cluster.length];
            let whole = Vector6::new(a.x, a.y, a.z, l.x, l.y, l.z).normalize();
            let rest = axes.iter().fold(whole, |rest, axis| rest - axis * axis.dot(&rest));
            let sine = rest.norm();
            if sine > RANK_GAP {
                axes.push(rest / sine);
            } else if is_redundant && sine > 1e-12 {
                words += &format!(
                    " ({name} leaves the span of the rows before it by {sine:.1e} rad, and up to \
                     {RANK_GAP:.0e} rad count as rounding)"
                );
            }
        }
    }
    words
}

/// True if the declared independents determine every joint away from the zero pose, where every
/// joint may move.
fn is_dead_point(subject: &Subject<'_>) -> bool {
    let elsewhere: Vec<Sample> = (0..TRIALS).filter_map(|k| off_zero(subject, k)).collect();
    let generic = generic_of(subject.cluster, &elsewhere);
    generic.is_some_and(|(rank, at)| idle_motions(subject, at, rank).is_some())
}

fn dead_point(subject: &Subject<'_>, moving: &[usize]) -> Diagnostic {
    let first = moving.first().map(|v| subject.names[*v].as_str());
    Diagnostic::new(
        subject.site,
        format!(
            "the zero pose is a dead point of loop {}: the independents do not determine {} there",
            loop_name(subject),
            joined(subject.names, moving)
        ),
        "a zero pose off the dead point",
        format!(
            "use `sarrus check --assemble --near {}=0.1 --write OUT.urdf` to write one",
            first.unwrap_or_default()
        ),
    )
}

/// Names of the cluster's cuts.
fn loop_name(subject: &Subject<'_>) -> String {
    let mut names: Vec<&str> = subject
        .row_names
        .iter()
        .map(|row| row.rsplit_once('/').map_or(row.as_str(), |(cut, _)| cut))
        .collect();
    names.dedup();
    names.join(", ")
}

/// A closed pose off the zero pose, to which every joint may contribute.
pub(super) fn off_zero(subject: &Subject<'_>, k: usize) -> Option<Sample> {
    let cluster = subject.cluster;
    let mut q = subject.zero.to_vec();
    for (v, at) in cluster.dofs.iter().enumerate() {
        at.advance(&mut q, REACH * column_unit(cluster, v) * noise(577 * k + 13 * v + 5));
    }
    let all: Vec<usize> = (0..cluster.n_v).collect();
    closed_near(cluster, subject.bodies, &mut q, &all)
        .then(|| Sample::at(cluster, subject.bodies, &q))
}

/// Usual independents: declared ones, actuated ones, those on the base and of free bodies.
pub(super) fn preferred(subject: &Subject<'_>) -> [Vec<usize>; 3] {
    let &Subject { cluster, bodies, .. } = subject;
    let floats = |v: &usize| floats(cluster, bodies, cluster.dofs[*v].body);
    let on_base = |v: &usize| cluster.local_parent[cluster.dofs[*v].body] == 0;
    [
        cluster.independent.clone(),
        cluster.active.iter().map(|(_, v)| *v).collect(),
        (0..cluster.n_v).filter(floats).chain((0..cluster.n_v).filter(on_base)).collect(),
    ]
}

/// The joints of which all of these velocities are: a file names whole joints.
fn whole_joints<'a>(subject: &Subject<'a>, velocities: &[usize]) -> Vec<&'a str> {
    let dofs = &subject.cluster.dofs;
    let of_joint = |v: usize, body: usize| dofs[v].body == body;
    let mut joints: Vec<&str> = Vec::new();
    for v in velocities.iter().copied() {
        let name = subject.names[v].as_str();
        let body = dofs[v].body;
        let is_whole = (0..dofs.len()).all(|w| !of_joint(w, body) || velocities.contains(&w));
        match name.rsplit_once('/') {
            _ if dofs[v].single => joints.push(name),
            Some((joint, _)) if is_whole && !joints.contains(&joint) => joints.push(joint),
            _ => {}
        }
    }
    joints
}

/// As many velocities as a loop has degrees of freedom that determine all others, preferred ones
/// first; those of a joint of several only together, as far as that is possible.
pub(super) fn good_independents(
    subject: &Subject<'_>,
    at: &Sample,
    mobility: usize,
    preferred: &[usize],
) -> Vec<usize> {
    let cluster = subject.cluster;
    let all: Vec<usize> = (0..cluster.n_v).collect();
    let free = null_space(&at.columns(&all, cluster));
    // rows of the free motions, orthogonalised against the chosen ones
    let mut left = Mat::from_fn(cluster.n_v, free.len(), |v, a| free[a][v]);
    let size = |left: &Mat<f64>, v: usize| {
        (0..left.ncols()).map(|a| left[(v, a)] * left[(v, a)]).sum::<f64>().sqrt()
    };
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < mobility.min(free.len()) {
        let mut rest: Vec<usize> = all.iter().copied().filter(|v| !chosen.contains(v)).collect();
        let is_whole = |v: &usize| {
            let own = |w: &usize| cluster.dofs[*w].body == cluster.dofs[*v].body;
            let rows: Vec<usize> = all.iter().copied().filter(own).collect();
            let motions = Mat::from_fn(rows.len(), left.ncols(), |k, a| left[(rows[k], a)]);
            rows.len() == 1 || chosen.iter().any(own) || rank(&motions) == rows.len()
        };
        if rest.iter().any(|v| size(&left, *v) > MOVES && is_whole(v)) {
            rest.retain(is_whole);
        }
        let largest =
            rest.iter().copied().max_by(|a, b| size(&left, *a).total_cmp(&size(&left, *b)));
        let Some(largest) = largest else { break };
        let enough = ENOUGH * size(&left, largest);
        let next = preferred
            .iter()
            .copied()
            .find(|v| rest.contains(v) && size(&left, *v) > enough)
            .unwrap_or(largest);
        let length = size(&left, next);
        let along: Vec<f64> = (0..left.ncols()).map(|a| left[(next, a)] / length).collect();
        for v in 0..cluster.n_v {
            let share: f64 = along.iter().enumerate().map(|(a, x)| x * left[(v, a)]).sum();
            along.iter().enumerate().for_each(|(a, x)| left[(v, a)] -= share * x);
        }
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}
