//! The part of a robot that a computation needs, as runs and lists that the hot path walks.

use crate::mechanism::{Cluster, Motion};
use crate::model::{Model, Runs};

/// Bodies and clusters that a computation needs, each ascending, so that parents come before
/// children. Whatever is left out is not read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scope {
    /// Clusters with something to close.
    pub(crate) closed: Vec<usize>,
    /// Revolute joints that no closure gives cosine and sine of, as (body, tree coordinate).
    pub(crate) free: Vec<(usize, usize)>,
    /// Bodies whose poses in their parents are needed: the next two together, and those on the
    /// paths to frames.
    pub(crate) posed: Runs,
    /// Ancestors of the next ones, of which only the motion is needed.
    pub(crate) carriers: Runs,
    /// Bodies whose forces are needed, with all descendants.
    pub(crate) driven: Runs,
    /// The clusters of these, whole.
    pub(crate) clusters: Runs,
    /// The independent velocities whose forces are answered, in internal order: those of free
    /// joints, and the clusters of the others, which loops join.
    pub(crate) independents: Runs,
    pub(crate) direct: Vec<Direct>,
    pub(crate) joined: Vec<usize>,
    /// Springs, dampers and rotors in the joints of the driven bodies, by their place in the model.
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

/// What a computation depends on, before everything that follows from it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roots {
    /// Clusters to close whatever else is needed.
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

    /// Everything that follows from what is needed.
    pub(crate) fn of<C>(model: &Model<C>, roots: &Roots) -> Scope {
        let n = model.bodies.len();
        let (mut driven, mut posed) = (vec![false; n], vec![false; n]);
        let forces = marked(model.clusters.len(), &roots.forces);

        // the force of a cluster sums those of all its descendants
        for i in 1..n {
            driven[i] = driven[model.bodies[i].parent] || forces[model.cluster_of[i]];
            posed[i] = driven[i];
        }
        roots.frames.iter().for_each(|i| posed[*i] = true);
        let mut carriers = vec![false; n];
        for i in (1..n).rev() {
            let parent = model.bodies[i].parent;
            if parent != 0 && posed[i] {
                posed[parent] = true;
                carriers[parent] |= (driven[i] || carriers[i]) && !driven[parent];
            }
        }

        // what has to be closed for it
        let mut closed = marked(model.clusters.len(), &roots.closed);
        for i in (1..n).filter(|i| posed[*i]) {
            let cluster = &model.clusters[model.cluster_of[i]];
            let is_given = roots.open_paths
                && !driven[i]
                && cluster.independent.contains(&(model.bodies[i].v - cluster.v));
            closed[model.cluster_of[i]] |= !is_given;
        }
        let is_revolute = |i: &usize| model.bodies[*i].motion == Motion::Revolute;
        let is_free = |i: &usize| {
            let c = model.cluster_of[*i];
            model.clusters[c].is_serial() || !closed[c]
        };
        let mut moves = vec![false; model.cluster_of_v.len()];
        for body in (1..n).filter(|i| driven[*i]).map(|i| &model.bodies[i]) {
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
        let direct = |cluster: &Cluster<C>| {
            let (v, vy, active) = (cluster.v, cluster.vy, cluster.active.clone());
            (0..cluster.n_vy).map(move |k| {
                let u = active.iter().find(|(_, j)| *j == k).map(|(u, _)| *u);
                Direct { v: v + k, vy: vy + k, u }
            })
        };
        Scope {
            closed: model.closed_clusters.iter().copied().filter(|c| closed[*c]).collect(),
            free: (1..n)
                .filter(|i| posed[*i] && is_revolute(i) && is_free(i))
                .map(|i| (i, model.bodies[i].q))
                .collect(),
            posed: Runs::marked(&posed),
            carriers: Runs::marked(&carriers),
            clusters: clusters_of(&driven),
            driven: Runs::marked(&driven),
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

fn marked(n: usize, which: &[usize]) -> Vec<bool> {
    let mut marks = vec![false; n];
    which.iter().for_each(|i| marks[*i] = true);
    marks
}
