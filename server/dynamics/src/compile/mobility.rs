//! A mobility that does not fit the declared independents: what is wrong, and what would be right.

use faer::Mat;

use crate::closure::column_unit;
use crate::compile::analysis::{Sample, Subject, closed_near, generic_of, idle_motions};
use crate::compile::rank::{independent_rows, null_space, rank};
use crate::compile::redundant::fitting_cuts;
use crate::diagnostic::Diagnostic;
use crate::mechanism::Cluster;
use crate::scalar::noise;

/// Poses off the zero pose that are tried, and how far they lie, in radians or cluster lengths.
const TRIALS: usize = 6;
const REACH: f64 = 0.3;
/// Share of the largest that a preferred independent must still move on its own.
const ENOUGH: f64 = 0.05;

/// The fault of a mobility that does not fit: dead points, redundant rows and idle joints by name.
pub(super) fn fault(subject: &Subject<'_>, generic: &Sample, rank_of_K: usize) -> Diagnostic {
    let &Subject { cluster, names, row_names, site, .. } = subject;
    let mobility = cluster.n_v - rank_of_K;
    let name = |v: &usize| names[*v].as_str();
    let list = |of: &[usize]| of.iter().map(name).collect::<Vec<_>>().join(", ");
    let K_d = generic.columns(&cluster.dependent, cluster);
    let drift = null_space(&K_d);
    let moving: Vec<usize> = cluster
        .dependent
        .iter()
        .enumerate()
        .filter(|(i, _)| drift.iter().any(|motion| motion[*i].abs() > 1e-3))
        .map(|(_, v)| *v)
        .collect();

    // away from zero, with every joint free to move: perhaps nothing is wrong there
    let elsewhere: Vec<Sample> = (0..TRIALS).filter_map(|k| off_zero(subject, k)).collect();
    let off = generic_of(cluster, &elsewhere);
    if let Some((rank, off)) = off
        && idle_motions(subject, off, rank).is_some()
    {
        return Diagnostic {
            site,
            found: format!(
                "the zero pose is a dead point of loop {}: the independents do not determine {} \
                there",
                loop_name(subject),
                list(&moving)
            ),
            expected: "a zero pose off the dead point".into(),
            help: format!(
                "use `sarrus check --assemble --near {}=0.1 --write OUT.urdf` to write one",
                moving.first().map(name).unwrap_or_default()
            ),
        };
    }

    let counts =
        format!("{} joints less rank {rank_of_K} of {} rows", cluster.n_v, cluster.rows.len());
    let mut found = format!("mobility {mobility} ({counts})");
    let (mut help, mut fitting) = (String::new(), String::new());
    // as many as declared, but not these
    if mobility == cluster.n_vy {
        found += &format!(
            ", but the independents {} do not determine {}",
            list(&cluster.independent),
            list(&moving)
        );
        return Diagnostic {
            site,
            found,
            expected: "independents that determine every joint".into(),
            help: format!(
                "write jointnames_independent: [{}], or correct loop_constraints",
                list(&good_independents(subject, generic, mobility, &preferred(cluster).concat()))
            ),
        };
    }
    if rank_of_K < cluster.rows.len() {
        let kept = independent_rows(&K_d, rank(&K_d).min(K_d.nrows()));
        let redundant: Vec<usize> = (0..cluster.rows.len()).filter(|r| !kept.contains(r)).collect();
        let named = redundant.iter().map(|r| row_names[*r].as_str()).collect::<Vec<_>>();
        found += &format!("; redundant rows: {}", named.join(", "));
        fitting = fitting_cuts(subject, generic, &redundant);
    }
    // joints that can still move when all independents stand still
    if !moving.is_empty() {
        found += &format!("; joints that the independents do not determine: {}", list(&moving));
    }
    if mobility > 0 {
        let good =
            list(&good_independents(subject, generic, mobility, &preferred(cluster).concat()));
        help = format!(" (such as [{good}])");
    }
    if !fitting.is_empty() {
        fitting = format!("; {fitting}");
    }
    Diagnostic {
        site,
        found,
        expected: format!("mobility {} as declared by jointnames_independent", cluster.n_vy),
        help: format!("change jointnames_independent{help} or loop_constraints{fitting}"),
    }
}

/// The cut of a cluster by its name; its submechanism stands at the diagnostic.
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

/// Velocities that people would take as independents: those that are declared, those that have an
/// actuator, those on the base.
pub(super) fn preferred(cluster: &Cluster<f64>) -> [Vec<usize>; 3] {
    let on_base = |v: &usize| cluster.local_parent[cluster.dofs[*v].body] == 0;
    [
        cluster.independent.clone(),
        cluster.active.iter().map(|(_, v)| *v).collect(),
        (0..cluster.n_v).filter(on_base).collect(),
    ]
}

/// As many velocities as a loop has degrees of freedom that determine all others: the preferred
/// ones as far as they do.
pub(super) fn good_independents(
    subject: &Subject<'_>,
    at: &Sample,
    mobility: usize,
    preferred: &[usize],
) -> Vec<usize> {
    let cluster = subject.cluster;
    let all: Vec<usize> = (0..cluster.n_v).collect();
    let free = null_space(&at.columns(&all, cluster));
    // what each velocity does along the directions that are free, less what those chosen do
    let mut left = Mat::from_fn(cluster.n_v, free.len(), |v, a| free[a][v]);
    let size = |left: &Mat<f64>, v: usize| {
        (0..left.ncols()).map(|a| left[(v, a)] * left[(v, a)]).sum::<f64>().sqrt()
    };
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < mobility.min(free.len()) {
        let rest: Vec<usize> = all.iter().copied().filter(|v| !chosen.contains(v)).collect();
        let largest =
            rest.iter().copied().max_by(|a, b| size(&left, *a).total_cmp(&size(&left, *b)));
        let Some(largest) = largest else { break };
        let enough = ENOUGH * size(&left, largest);
        let next = preferred
            .iter()
            .copied()
            .find(|v| !chosen.contains(v) && size(&left, *v) > enough)
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
