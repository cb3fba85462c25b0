//! Assembles a model before its closures are chosen, in double-double: bodies, cuts, orders and
//! names.

use std::sync::Arc;

use nalgebra::Matrix3;
use sarrus_proto::{ModelInfo, Sizes};

use crate::closure::Closure;
use crate::compile::canonical;
use crate::compile::couplings::{characteristic_length, couplings, units};
use crate::compile::curves::curve_fault;
use crate::compile::geometry::{norm, onto_z, unit, vector};
use crate::compile::owners::owners;
use crate::compile::spanning_tree::{Partition, Skeleton};
use crate::description::{Description, Friction, JointKind, Loop};
use crate::diagnostic::{Diagnostic, Site};
use crate::linalg::TreeSparsity;
use crate::mechanism::{Body, JointTerms, Motion};
use crate::model::{Model, Order};
use crate::scalar::{Dd, Real};
use crate::spatial::{Pose, zero};

/// Part of the size of G_u from which down the roundings of G count against it.
const LOW: f64 = 1e-3;
/// Lengths of a cluster from which on its loops are measured from their own place.
const FAR: f64 = 16.0;

/// A model before its closures are chosen, and the owners of its joints and rows.
pub(crate) struct Assembly {
    pub(crate) model: Model<Dd>,
    pub(crate) meta: ModelInfo,
    pub(super) skeleton: Skeleton,
    /// Loops of each submechanism: those given, or those of its type.
    pub(super) loops: Vec<Vec<Loop>>,
    /// Submechanism of each external row of K.
    pub(super) row_owner: Vec<usize>,
    /// First submechanism that owns a joint of each cluster.
    pub(super) owner: Vec<usize>,
    /// Joints of each cluster in body order.
    pub(super) members: Vec<Vec<usize>>,
    submechanism_of: Vec<usize>,
}

/// Names of one cluster for messages.
pub(super) struct Labels {
    /// Of its local velocities.
    pub(super) names: Vec<String>,
    /// Of its rows.
    pub(super) row_names: Vec<String>,
    /// Of each of its bodies.
    pub(super) has_child_cluster: Vec<bool>,
    pub(super) site: Site,
}

impl Assembly {
    pub(crate) fn new(description: &Description, errors: &mut Vec<Diagnostic>) -> Option<Assembly> {
        let skeleton = Skeleton::new(description).map_err(|fault| errors.push(fault)).ok()?;
        let submechanism_of = owners(description, errors)?;
        let loops: Vec<Vec<Loop>> = (0..description.submechanisms.len())
            .map(|s| canonical::loops(description, s, errors))
            .collect();
        let ties = ties(description, &skeleton, &loops, errors);
        if !errors.is_empty() {
            return None;
        }
        let partition = Partition::new(&skeleton, &ties);
        let mut builder =
            Builder::new(description, &skeleton, &partition, &submechanism_of, errors)?;
        builder.bodies();
        builder.frames();
        let row_owner = builder.rows(&loops);
        builder.orders();
        builder.terms(errors);
        builder.child_clusters();
        builder.described_zero(errors);
        builder.couplings(errors);
        if !errors.is_empty() {
            return None;
        }
        let (model, meta) = builder.finish();
        let joints = |joints: &Vec<usize>| joints.iter().map(|m| skeleton.moving[*m]).collect();
        let members: Vec<Vec<usize>> = partition.members.iter().map(joints).collect();
        let owner = members.iter().map(|joints| submechanism_of[joints[0]]).collect();
        Some(Assembly { model, meta, skeleton, loops, row_owner, owner, members, submechanism_of })
    }

    pub(super) fn labels(&self, c: usize) -> Labels {
        let clusters = &self.model.clusters;
        let cluster = &clusters[c];
        let name = |v: usize| self.meta.tree[self.model.order.v_external[v]].clone();
        let has_child = |body: usize| clusters.iter().any(|child| child.parent == body);
        Labels {
            names: cluster.velocities().map(name).collect(),
            row_names: cluster.rows.iter().map(|row| self.meta.loops[*row].clone()).collect(),
            has_child_cluster: cluster.bodies().map(has_child).collect(),
            site: Site::Submechanism(self.owner[c]),
        }
    }

    /// The submechanisms that own joints of a cluster, each with the number of these joints.
    pub(super) fn owners(&self, c: usize) -> Vec<(usize, usize)> {
        let mut owners: Vec<(usize, usize)> = Vec::new();
        for j in &self.members[c] {
            let s = self.submechanism_of[*j];
            match owners.iter_mut().find(|owner| owner.0 == s) {
                Some(owner) => owner.1 += 1,
                None => owners.push((s, 1)),
            }
        }
        owners
    }

    /// The local joints of a cluster in the order in which its submechanism lists them.
    pub(super) fn local_order(&self, description: &Description, c: usize) -> Vec<usize> {
        let listed = &description.submechanisms[self.owner[c]].spanning_tree;
        listed
            .iter()
            .filter_map(|j| self.members[c].iter().position(|member| member == j))
            .collect()
    }
}

/// The sets of moving joints that one loop or one coupling ties together.
fn ties(
    description: &Description,
    skeleton: &Skeleton,
    loops: &[Vec<Loop>],
    errors: &mut Vec<Diagnostic>,
) -> Vec<Vec<usize>> {
    let mut ties = Vec::new();
    for cycle in loops.iter().flatten() {
        let (a, b) = skeleton.path_between(cycle.predecessor, cycle.successor);
        ties.push(a.into_iter().chain(b).collect::<Vec<_>>());
    }
    for &j in &skeleton.moving {
        if let Some(coupling) = &description.joints[j].coupling {
            errors.extend(coupling.curves.iter().filter_map(|(_, curve)| {
                let found = format!("the curve that {} follows", description.joints[j].name);
                let fault = curve_fault(curve)?;
                Some(Diagnostic::new(Site::Joint(j), found, fault, "correct its numbers"))
            }));
            let linear = coupling.terms.iter().map(|(master, _)| *master);
            let joints = linear.chain(coupling.curves.iter().map(|(of, _)| *of)).chain([j]);
            ties.push(joints.map(|j| skeleton.moving_of[j]).collect());
        }
    }
    if ties.iter().flatten().any(|m| *m == usize::MAX) {
        errors.push(Diagnostic::new(
            Site::Robot,
            "a coupling to a fixed joint",
            "masters that move",
            "name a moving joint",
        ));
    }
    ties
}

/// A model under construction.
pub(super) struct Builder<'a> {
    pub(super) description: &'a Description,
    pub(super) skeleton: &'a Skeleton,
    pub(super) partition: &'a Partition,
    pub(super) submechanism_of: &'a [usize],
    pub(super) model: Model<Dd>,
    /// Body of each moving joint.
    pub(super) body_of: Vec<usize>,
    /// Orientation of each body's frame in its child link's.
    pub(super) R_link_body: Vec<Matrix3<Dd>>,
    pub(super) meta: ModelInfo,
}

impl<'a> Builder<'a> {
    fn new(
        description: &'a Description,
        skeleton: &'a Skeleton,
        partition: &'a Partition,
        submechanism_of: &'a [usize],
        errors: &mut Vec<Diagnostic>,
    ) -> Option<Builder<'a>> {
        let n = skeleton.moving.len();
        let mut R_link_body = Vec::with_capacity(n);
        for &j in &skeleton.moving {
            let joint = &description.joints[j];
            R_link_body.push(match (joint.kind, unit(&vector(joint.axis))) {
                (JointKind::Floating | JointKind::Spherical, _) => {
                    Matrix3::identity().map(|x: f64| Dd::from_f64(x))
                }
                (_, Some(axis)) => onto_z(&axis),
                (_, None) => {
                    errors.push(Diagnostic::new(
                        Site::Joint(j),
                        format!("joint {} with an axis without direction", joint.name),
                        "a vector of some length",
                        "give the axis",
                    ));
                    return None;
                }
            });
        }
        let world = Body {
            parent: 0,
            motion: Motion::Revolute,
            q: 0,
            v: 0,
            R_parent_body: Pose::<Dd>::identity().R,
            p_parent_body: zero(),
            p_local: zero(),
            mass: Dd::ZERO,
            h: zero(),
            inertia: [Dd::ZERO; 6],
        };
        let model = Model {
            meta: Arc::new(ModelInfo::default()),
            gravity: vector(description.gravity),
            bodies: vec![world],
            clusters: Vec::new(),
            closures: Vec::new(),
            closed_clusters: Vec::new(),
            cluster_of: vec![usize::MAX],
            cluster_of_v: Vec::new(),
            frames: Vec::new(),
            n_g: 0,
            sparsity: TreeSparsity::default(),
            has_child_cluster: Vec::new(),
            inertia: Vec::new(),
            is_massless: false,
            terms: JointTerms::none(Dd::ONE / Dd::from_f64(Friction::default().speed)),
            order: Order::default(),
            zero: Vec::new(),
            described_zero: Vec::new(),
            growth: [0.0; 2],
            limits: Vec::new(),
            effort: Vec::new(),
            motors: Vec::new(),
        };
        Some(Builder {
            description,
            skeleton,
            partition,
            submechanism_of,
            model,
            body_of: vec![0; n],
            R_link_body,
            meta: ModelInfo::default(),
        })
    }

    /// Body of a moving joint of the description.
    pub(super) fn body(&self, joint: usize) -> &Body<Dd> {
        &self.model.bodies[self.body_of[self.skeleton.moving_of[joint]]]
    }

    /// The zero pose as described, in internal order.
    fn described_zero(&mut self, errors: &mut Vec<Diagnostic>) {
        let mut zero = vec![0.0; self.model.order.q.len()];
        for body in self.model.bodies.iter().filter(|body| body.motion.n_q() > 1) {
            zero[body.q + body.motion.n_q() - 1] = 1.0;
        }
        for (j, coordinates) in &self.description.zero_pose {
            let moves = self.skeleton.moving.contains(j);
            let body = moves.then(|| self.body(*j));
            match body.filter(|body| body.motion.n_q() == coordinates.len()) {
                Some(body) => {
                    zero[body.q..body.q + coordinates.len()].copy_from_slice(coordinates);
                }
                None => errors.push(Diagnostic::new(
                    Site::Joint(*j),
                    format!("{} coordinates at the zero pose", coordinates.len()),
                    "a joint that moves, and as many as it has",
                    "correct the description",
                )),
            }
        }
        self.model.zero = zero.iter().map(|x| Dd::from_f64(*x)).collect();
        self.model.described_zero = zero;
    }

    /// Lengths of the closed clusters, and the closures and zero poses of pure couplings.
    fn couplings(&mut self, errors: &mut Vec<Diagnostic>) {
        for (c, joints) in self.partition.members.iter().enumerate() {
            let cluster = &self.model.clusters[c];
            let first = self.skeleton.moving[joints[0]];
            if cluster.rows.is_empty() {
                if !cluster.dependent.is_empty() {
                    errors.push(Diagnostic::new(
                        Site::Submechanism(self.submechanism_of[first]),
                        format!(
                            "joint {} that is not independent and in no loop",
                            self.description.joints[first].name
                        ),
                        "every joint independent, in a loop or coupled",
                        "list it in jointnames_independent or give the loop",
                    ));
                }
                continue;
            }
            self.measure_from_loops(c);
            let cluster = &self.model.clusters[c];
            let zero = &self.model.zero[cluster.coordinates()];
            let length = characteristic_length(cluster, self.model.bodies_of(cluster), zero);
            let coupling = couplings(cluster);
            let cluster = &mut self.model.clusters[c];
            cluster.length = length;
            cluster.units = units(cluster);
            let actuators = cluster.active.iter().map(|(_, j)| cluster.units[*j]);
            let independents = cluster.independent.iter().map(|j| cluster.units[*j]);
            cluster.least_authority =
                LOW * actuators.fold(f64::INFINITY, f64::min) / independents.fold(0.0, f64::max);
            self.model.closed_clusters.push(c);
            if let Some(coupling) = coupling {
                coupling.at_zero(cluster, &mut self.model.zero[cluster.coordinates()]);
                cluster.used = (0..cluster.rows.len()).collect();
                self.model.closures[c] = Closure::Coupling(coupling);
            }
        }
    }

    /// Measures the places on a cluster's parent body from its first joint where that is far away,
    /// so that they keep their digits.
    fn measure_from_loops(&mut self, c: usize) {
        let cluster = &mut self.model.clusters[c];
        let bodies = &mut self.model.bodies[cluster.body..cluster.body + cluster.n];
        let zero = &self.model.zero[cluster.q..cluster.q + cluster.n_q];
        let origin = bodies[0].p_parent_body;
        if norm(&origin).to_f64() < FAR * characteristic_length(cluster, bodies, zero) {
            return;
        }
        let carried = bodies.iter_mut().zip(&cluster.local_parent).filter(|(_, p)| **p == 0);
        carried.for_each(|(body, _)| body.p_local -= origin);
        for cut in &mut cluster.cuts {
            let ends = [(cut.predecessor, &mut cut.x_p_cut), (cut.successor, &mut cut.x_s_cut)];
            ends.into_iter().filter(|(end, _)| *end == 0).for_each(|(_, x)| x.p -= origin);
        }
    }

    /// The model, and its names and sizes.
    fn finish(mut self) -> (Model<Dd>, ModelInfo) {
        self.meta.branches = self.branches();
        let meta = self.meta;
        let sizes = Sizes {
            n_q: meta.tree_q.len(),
            n_v: meta.tree.len(),
            n_qy: meta.independent_q.len(),
            n_vy: meta.independent.len(),
            n_u: meta.active.len(),
            n_c: meta.loops.len(),
            n_branches: meta.branches.len(),
            n_bodies: self.model.bodies.len() - 1,
            n_cuts: self.model.order.cuts.len(),
        };
        let meta = ModelInfo {
            robot: self.description.name.clone(),
            fingerprint: self.description.fingerprint(),
            sizes,
            links: self.description.links.iter().map(|link| link.name.clone()).collect(),
            ..meta
        };
        (self.model, meta)
    }
}
