//! A model before its closures are chosen, in double-double: who owns what, and the order in which
//! bodies, cuts, orders and names come about.

use std::sync::Arc;

use nalgebra::Matrix3;
use sarrus_proto::{ModelInfo, Sizes};

use crate::closure::Closure;
use crate::compile::couplings::{characteristic_length, couplings};
use crate::compile::geometry::{onto_z, unit, vector};
use crate::compile::orders::Names;
use crate::compile::owners::owners;
use crate::compile::spanning_tree::{Partition, Skeleton};
use crate::description::{Description, JointKind, Limits, Loop, SubmechanismKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::linalg::TreeSparsity;
use crate::mechanism::{Body, JointTerms, Motion};
use crate::model::{Model, Order};
use crate::scalar::{Dd, Real};
use crate::spatial::{Pose, zero};

/// A model before its closures are chosen, and who owns what.
pub(super) struct Assembly {
    pub(super) model: Model<Dd>,
    pub(super) meta: ModelInfo,
    /// Submechanism, loop and row of each external row of K; couplings have no loop.
    pub(super) row_owner: Vec<(usize, Option<(usize, usize)>)>,
    /// For each cluster the first submechanism that owns a joint of it, and its joints in body
    /// order.
    pub(super) owner: Vec<usize>,
    pub(super) members: Vec<Vec<usize>>,
    submechanism_of: Vec<usize>,
}

impl Assembly {
    /// Builds everything that needs no numbers beyond the description's.
    pub(super) fn new(description: &Description, errors: &mut Vec<Diagnostic>) -> Option<Assembly> {
        let skeleton = Skeleton::new(description).map_err(|fault| errors.push(fault)).ok()?;
        let n_joints = description.joints.len();
        let mut moving_of = vec![usize::MAX; n_joints];
        skeleton.moving.iter().enumerate().for_each(|(m, j)| moving_of[*j] = m);
        let submechanism_of = owners(description, errors)?;

        // loops as given or as the type defines them, and the ties that they and the couplings make
        let loops: Vec<Vec<Loop>> = (0..description.submechanisms.len())
            .map(|s| crate::compile::canonical::loops(description, s, errors))
            .collect();
        let mut ties = Vec::new();
        for cycle in loops.iter().flatten() {
            let (a, b) = skeleton.path_between(cycle.predecessor, cycle.successor);
            ties.push(a.into_iter().chain(b).collect::<Vec<_>>());
        }
        for (j, joint) in description
            .joints
            .iter()
            .enumerate()
            .filter(|(_, joint)| joint.kind != JointKind::Fixed)
        {
            if let Some(coupling) = &joint.coupling {
                ties.push(
                    coupling
                        .terms
                        .iter()
                        .map(|(master, _)| moving_of[*master])
                        .chain([moving_of[j]])
                        .collect(),
                );
            }
        }
        if ties.iter().flatten().any(|m| *m == usize::MAX) {
            errors.push(Diagnostic {
                site: Site::Robot,
                found: "a coupling to a fixed joint".into(),
                expected: "masters that move".into(),
                help: "name a moving joint".into(),
            });
        }
        if !errors.is_empty() {
            return None;
        }
        let partition = Partition::new(&skeleton, &ties);
        let mut builder =
            Builder::new(description, &skeleton, &partition, &submechanism_of, errors)?;
        builder.bodies();
        builder.frames();
        let row_owner = builder.rows(&loops, &moving_of);
        builder.orders(&moving_of);
        builder.terms(&moving_of, errors);
        builder.child_clusters();
        let (model, meta) = builder.finish(&row_owner, &loops, errors)?;
        let owner = partition
            .members
            .iter()
            .map(|joints| submechanism_of[skeleton.moving[joints[0]]])
            .collect();
        let members = partition
            .members
            .iter()
            .map(|joints| joints.iter().map(|m| skeleton.moving[*m]).collect())
            .collect();
        Some(Assembly { model, meta, row_owner, owner, members, submechanism_of })
    }

    /// Names of a cluster's local velocities.
    pub(super) fn names(&self, c: usize) -> Vec<String> {
        let cluster = &self.model.clusters[c];
        (cluster.velocities())
            .map(|v| self.meta.tree[self.model.order.v_external[v]].clone())
            .collect()
    }

    /// The submechanisms that own joints of a cluster, with how many.
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

    /// How a cluster is to be closed: as its submechanism says when it is all of one, else
    /// numerically.
    pub(super) fn kind(&self, description: &Description, c: usize) -> SubmechanismKind {
        match self.owners(c).as_slice() {
            [(s, n)] if *n == description.submechanisms[*s].spanning_tree.len() => {
                description.submechanisms[*s].kind
            }
            _ => SubmechanismKind::Numerical,
        }
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
    pub(super) names: Names,
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
                    errors.push(Diagnostic {
                        site: Site::Joint(j),
                        found: format!("joint {} with an axis without direction", joint.name),
                        expected: "a vector of some length".into(),
                        help: "give the axis".into(),
                    });
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
            terms: JointTerms::none(),
            order: Order::default(),
            zero: Vec::new(),
            described_zero: Vec::new(),
            growth: [0.0; 2],
            limits: Vec::new(),
            effort: Vec::new(),
        };
        Some(Builder {
            description,
            skeleton,
            partition,
            submechanism_of,
            model,
            body_of: vec![0; n],
            R_link_body,
            names: Names::default(),
        })
    }

    /// The zero pose as described, in internal order.
    fn described_zero(&mut self, errors: &mut Vec<Diagnostic>) {
        let mut zero = vec![0.0; self.model.order.q.len()];
        for body in self.model.bodies.iter().filter(|body| body.motion.n_q() > 1) {
            zero[body.q + body.motion.n_q() - 1] = 1.0;
        }
        for (j, coordinates) in &self.description.zero_pose {
            let place = self.skeleton.moving.iter().position(|moving| moving == j);
            let body = place.map(|m| &self.model.bodies[self.body_of[m]]);
            match body.filter(|body| body.motion.n_q() == coordinates.len()) {
                Some(body) => {
                    zero[body.q..body.q + coordinates.len()].copy_from_slice(coordinates);
                }
                None => errors.push(Diagnostic {
                    site: Site::Joint(*j),
                    found: format!("{} coordinates at the zero pose", coordinates.len()),
                    expected: "a joint that moves, and as many as it has".into(),
                    help: "correct the description".into(),
                }),
            }
        }
        self.model.described_zero = zero;
    }

    /// Closures that need no analysis, lengths, zero pose; sizes and names.
    fn finish(
        mut self,
        row_owner: &[(usize, Option<(usize, usize)>)],
        loops: &[Vec<Loop>],
        errors: &mut Vec<Diagnostic>,
    ) -> Option<(Model<Dd>, ModelInfo)> {
        self.described_zero(errors);
        self.model.zero = self.model.described_zero.iter().map(|x| Dd::from_f64(*x)).collect();
        for (c, joints) in self.partition.members.iter().enumerate() {
            let cluster = &self.model.clusters[c];
            let s = self.submechanism_of[self.skeleton.moving[joints[0]]];
            if cluster.rows.is_empty() {
                if !cluster.dependent.is_empty() {
                    errors.push(Diagnostic {
                        site: Site::Submechanism(s),
                        found: format!(
                            "joint {} that is not independent and in no loop",
                            self.description.joints[self.skeleton.moving[joints[0]]].name
                        ),
                        expected: "every joint independent, in a loop or coupled".into(),
                        help: "list it in jointnames_independent or give the loop".into(),
                    });
                }
                continue;
            }
            let zero = &self.model.zero[cluster.coordinates()];
            let length = characteristic_length(cluster, self.model.bodies_of(cluster), zero);
            let coupling = couplings(cluster);
            let cluster = &mut self.model.clusters[c];
            cluster.length = length;
            self.model.closed_clusters.push(c);
            if let Some(coupling) = coupling {
                for &j in &cluster.dependent {
                    self.model.zero[cluster.q + cluster.dofs[j].q] = coupling.b[j];
                }
                cluster.used = (0..cluster.rows.len()).collect();
                self.model.closures[c] = Closure::Coupling(coupling);
            }
        }
        if !errors.is_empty() {
            return None;
        }
        let branches = self.branches();
        let names = self.names;
        let loop_names = row_owner.iter().scan(0usize, |_, (s, owner)| {
            Some(match owner {
                Some((l, r)) => format!("{}/{}", loops[*s][*l].name, loops[*s][*l].rows[*r].name),
                None => String::new(),
            })
        });
        let mut loop_names: Vec<String> = loop_names.collect();
        let mut coupled = self
            .description
            .submechanisms
            .iter()
            .flat_map(|s| &s.spanning_tree)
            .filter(|j| self.description.joints[**j].coupling.is_some());
        for name in loop_names.iter_mut().filter(|name| name.is_empty()) {
            *name = coupled
                .next()
                .map(|j| format!("{}/coupling", self.description.joints[*j].name))
                .unwrap_or_default();
        }
        let sizes = Sizes {
            n_q: names.tree_q.len(),
            n_v: names.tree.len(),
            n_qy: names.independent_q.len(),
            n_vy: names.independent.len(),
            n_u: names.active.len(),
            n_c: row_owner.len(),
            n_branches: branches.len(),
        };
        let meta = ModelInfo {
            robot: self.description.name.clone(),
            fingerprint: self.description.fingerprint(),
            sizes,
            tree: names.tree,
            tree_q: names.tree_q,
            independent: names.independent,
            independent_q: names.independent_q,
            active: names.active,
            loops: loop_names,
            branches,
            links: self.description.links.iter().map(|link| link.name.clone()).collect(),
            limits: names.limits.iter().map(|limits| limits.map(Limits::finite)).collect(),
            closures: Vec::new(),
            warnings: Vec::new(),
        };
        Some((self.model, meta))
    }
}
