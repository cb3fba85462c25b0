//! The part of a robot that a computation needs, as runs and lists for the hot path.

use crate::mechanism::{Cluster, Motion};
use crate::model::{Model, Runs};

/// Bodies and clusters that a computation needs, each ascending, so that parents come before
/// children. Other bodies and clusters are not read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scope {
    /// Clusters with loops or couplings.
    pub(crate) closed: Vec<usize>,
    /// Revolute joints whose cosine and sine no closure computes, as (body, tree coordinate).
    pub(crate) free: Vec<(usize, usize)>,
    /// Bodies whose poses in their parents are needed: the union of the next two, and those on the
    /// paths to frames.
    pub(crate) posed: Runs,
    /// Ancestors of the next ones, of which only the motion is needed.
    pub(crate) ancestors: Runs,
    /// Bodies whose forces are needed, with all descendants.
    pub(crate) affected: Runs,
    /// The clusters of these, whole.
    pub(crate) clusters: Runs,
    /// The independent velocities whose forces are answered, in internal order: those of free
    /// joints, and the clusters of the others, which loops join.
    pub(crate) independents: Runs,
    pub(crate) direct: Vec<Direct>,
    pub(crate) joined: Vec<usize>,
    /// Springs, dampers and rotors in the joints of the affected bodies, by their index in the
    /// model.
    pub(crate) springs: Runs,
    pub(crate) dampers: Runs,
    pub(crate) rotors: Runs,
}

/// A degree of freedom of a free joint: its tree velocity, its independent velocity, and the
/// actuator that moves it, if there is one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Direct {
    pub(crate) v: usize,
    pub(crate) vy: usize,
    pub(crate) u: Option<usize>,
}

/// Direct dependencies of a computation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roots {
    /// Clusters to close in any case.
    pub(crate) closed: Vec<usize>,
    /// Clusters whose forces are computed from motion or turned into motion.
    pub(crate) forces: Vec<usize>,
    /// Clusters whose forces are answered.
    pub(crate) answered: Vec<usize>,
    /// Bodies on the paths to frames.
    pub(crate) frames: Vec<usize>,
    /// A cluster that bodies on a path belong to stays open where these are all independent, and
    /// their coordinates are given.
    pub(crate) open_paths: bool,
}

impl Scope {
    /// All of a robot.
    pub(crate) fn whole<C>(model: &Model<C>) -> Scope {
        Scope::of(
            model,
            &Roots {
                closed: model.closed_clusters.clone(),
                forces: (0..model.clusters.len()).collect(),
                answered: (0..model.clusters.len()).collect(),
                ..Roots::default()
            },
        )
    }

    /// All dependencies, from the direct ones.
    pub(crate) fn of<C>(model: &Model<C>, roots: &Roots) -> Scope {
        let n = model.bodies.len();
        let mut affected = vec![false; n];
        let mut posed = vec![false; n];
        let forces = marked(model.clusters.len(), &roots.forces);

        // the force of a cluster sums those of all its descendants
        for i in 1..n {
            affected[i] = affected[model.bodies[i].parent] || forces[model.cluster_of[i]];
            posed[i] = affected[i];
        }
        roots.frames.iter().for_each(|i| posed[*i] = true);
        let mut ancestors = vec![false; n];
        for i in (1..n).rev() {
            let parent = model.bodies[i].parent;
            if parent != 0 && posed[i] {
                posed[parent] = true;
                ancestors[parent] |= (affected[i] || ancestors[i]) && !affected[parent];
            }
        }

        // clusters to close for these poses
        let mut closed = marked(model.clusters.len(), &roots.closed);
        for i in (1..n).filter(|i| posed[*i]) {
            let cluster = &model.clusters[model.cluster_of[i]];
            let is_given = roots.open_paths
                && !affected[i]
                && cluster.independent.contains(&(model.bodies[i].v - cluster.v));
            closed[model.cluster_of[i]] |= !is_given;
        }
        let is_revolute = |i: &usize| model.bodies[*i].motion == Motion::Revolute;
        let is_free = |i: &usize| {
            let c = model.cluster_of[*i];
            model.clusters[c].is_serial() || !closed[c]
        };
        let mut moves = vec![false; model.cluster_of_v.len()];
        for body in (1..n).filter(|i| affected[*i]).map(|i| &model.bodies[i]) {
            moves[body.v..body.v + body.motion.n_v()].fill(true);
        }
        let places = |velocities: Vec<usize>| {
            let all = velocities.into_iter().enumerate();
            all.filter(|(_, v)| moves[*v]).map(|(k, _)| k).collect::<Runs>()
        };
        let terms = &model.terms;
        let clusters_of = |of: &[bool]| {
            let is_in = |cluster: &Cluster<C>| cluster.bodies().any(|i| of[i]);
            let all = model.clusters.iter().enumerate();
            all.filter(|(_, cluster)| is_in(cluster)).map(|(c, _)| c).collect::<Runs>()
        };
        let answered = || roots.answered.iter().map(|c| (*c, &model.clusters[*c]));
        Scope {
            closed: model.closed_clusters.iter().copied().filter(|c| closed[*c]).collect(),
            free: (1..n)
                .filter(|i| posed[*i] && is_revolute(i) && is_free(i))
                .map(|i| (i, model.bodies[i].q))
                .collect(),
            posed: Runs::marked(&posed),
            ancestors: Runs::marked(&ancestors),
            clusters: clusters_of(&affected),
            affected: Runs::marked(&affected),
            independents: answered().flat_map(|(_, cluster)| cluster.independents()).collect(),
            direct: answered()
                .filter(|(_, cluster)| cluster.is_serial())
                .flat_map(|(_, cluster)| direct(cluster))
                .collect(),
            joined: answered()
                .filter(|(_, cluster)| !cluster.is_serial())
                .map(|(c, _)| c)
                .collect(),
            springs: places(terms.springs.iter().map(|spring| spring.v).collect()),
            dampers: places(terms.dampers.iter().map(|damper| damper.v).collect()),
            rotors: places(terms.rotors.iter().map(|rotor| rotor.v).collect()),
        }
    }
}

/// The degrees of freedom of a free joint.
fn direct<C>(cluster: &Cluster<C>) -> impl Iterator<Item = Direct> {
    (0..cluster.n_vy).map(|k| {
        let u = cluster.active.iter().find(|(_, j)| *j == k).map(|(u, _)| *u);
        Direct { v: cluster.v + k, vy: cluster.vy + k, u }
    })
}

fn marked(n: usize, which: &[usize]) -> Vec<bool> {
    let mut marks = vec![false; n];
    which.iter().for_each(|i| marks[*i] = true);
    marks
}
