//! Bodies, clusters, cuts and orders of a description, in double-double.

use std::sync::Arc;

use nalgebra::Matrix3;
use sarrus_proto::{ModelInfo, Sizes};

use crate::closure::{Closure, Cut, CutRow};
use crate::compile::couplings::{characteristic_length, couplings};
use crate::compile::geometry::{inertia, onto_z, pose, unit, vector};
use crate::compile::orders::Names;
use crate::compile::spanning_tree::{Partition, Skeleton};
use crate::description as written;
use crate::description::{Description, JointKind, Limits, Loop, SubmechanismKind};
use crate::diagnostic::{Diagnostic, Site};
use crate::linalg::Branches;
use crate::mechanism::{Freedom, JointTerms, Motion};
use crate::model::{Body, Cluster, Frame, Model, Order};
use crate::scalar::{Dd, Real};
use crate::spatial::{Pose, mul, zero};

/// A model before its closures are chosen, and who owns what.
pub(super) struct Assembly {
    pub(super) model: Model<Dd>,
    pub(super) meta: ModelInfo,
    /// Submechanism, loop and row of each external row of K; couplings have no loop.
    pub(super) row_owner: Vec<(usize, Option<(usize, usize)>)>,
    /// For each cluster the first submechanism that owns a joint of it, and its joints in body
    /// order.
    pub(super) owner: Vec<usize>,
    members: Vec<Vec<usize>>,
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
        for of in loops.iter().flatten() {
            let (a, b) = skeleton.between(of.predecessor, of.successor);
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
        builder.carriers();
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
        (cluster.v..cluster.v + cluster.n_v)
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

/// The submechanism of each joint.
fn owners(description: &Description, errors: &mut Vec<Diagnostic>) -> Option<Vec<usize>> {
    let mut owner = vec![usize::MAX; description.joints.len()];
    let mut fault = |site, found: String, expected: &str| {
        errors.push(Diagnostic {
            site,
            found,
            expected: expected.into(),
            help: "correct the lists of the submechanisms".into(),
        });
    };
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        for &j in &submechanism.spanning_tree {
            match owner.get(j) {
                Some(&usize::MAX) => owner[j] = s,
                _ => fault(
                    Site::Submechanism(s),
                    "a joint that is in two submechanisms or does not exist".into(),
                    "each joint once",
                ),
            }
        }
        for &j in submechanism.independent.iter().chain(&submechanism.active) {
            if !submechanism.spanning_tree.contains(&j) {
                fault(
                    Site::Submechanism(s),
                    "an independent or active joint outside the spanning tree".into(),
                    "joints of jointnames_spanningtree",
                );
            }
        }
    }
    for (s, submechanism) in description.submechanisms.iter().enumerate() {
        for j in submechanism.active.iter().filter(|j| {
            description.joints.get(**j).is_some_and(|joint| {
                matches!(joint.kind, JointKind::Floating | JointKind::Spherical)
            })
        }) {
            fault(
                Site::Submechanism(s),
                format!(
                    "the joint {} of several freedoms as an actuator",
                    description.joints[*j].name
                ),
                "actuators of one freedom",
            );
        }
    }
    for (j, joint) in description.joints.iter().enumerate() {
        if joint.kind != JointKind::Fixed && owner[j] == usize::MAX {
            fault(
                Site::Joint(j),
                format!("joint {} in no submechanism", joint.name),
                "each moving joint in one",
            );
        }
    }
    errors.is_empty().then_some(owner)
}

/// Independent and dependent velocities and coordinates of a cluster, and its actuators as (place
/// in u, velocity).
struct Roles {
    independent: Vec<usize>,
    dependent: Vec<usize>,
    independent_q: Vec<usize>,
    dependent_q: Vec<usize>,
    active: Vec<(usize, usize)>,
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
    /// Turn from each body's frame to its child link's frame.
    turn: Vec<Matrix3<Dd>>,
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
        let mut turn = Vec::with_capacity(n);
        for &j in &skeleton.moving {
            let joint = &description.joints[j];
            turn.push(match (joint.kind, unit(&vector(joint.axis))) {
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
            E: Pose::<Dd>::identity().R,
            r: zero(),
            mass: Dd::ZERO,
            h: zero(),
            inertia: [Dd::ZERO; 6],
        };
        let model = Model {
            meta: Arc::new(ModelInfo::default()),
            gravity: vector(description.gravity),
            bodies: vec![world],
            clusters: Vec::new(),
            tied: Vec::new(),
            free: Vec::new(),
            cluster_of: vec![usize::MAX],
            cluster_of_v: Vec::new(),
            frames: Vec::new(),
            n_g: 0,
            branches: Branches::default(),
            carries: Vec::new(),
            inertia: Vec::new(),
            terms: JointTerms::none(),
            order: Order::default(),
            zero: Vec::new(),
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
            turn,
            names: Names::default(),
        })
    }

    /// Bodies and clusters in depth-first order, without inertia.
    fn bodies(&mut self) {
        let (mut q, mut v, mut vy) = (0, 0, 0);
        for (c, joints) in self.partition.members.iter().enumerate() {
            let parent = self.partition.hangs_from[c].map_or(0, |m| self.body_of[m]);
            let body = self.model.bodies.len();
            let (first_q, first_v) = (q, v);
            let (mut local_parent, mut freedoms) = (Vec::new(), Vec::new());
            for &m in joints {
                let joint = &self.description.joints[self.skeleton.moving[m]];
                let x_parent_link = self.skeleton.x_parent_joint[m];
                // both ends of the joint in frames with the axis on z
                let in_parent = match self.skeleton.parent[m] {
                    Some(p) => Pose { R: self.turn[p].transpose(), p: zero() }.then(&x_parent_link),
                    None => x_parent_link,
                };
                let placed = in_parent.then(&Pose { R: self.turn[m], p: zero() });
                let motion = match joint.kind {
                    JointKind::Prismatic => Motion::Prismatic,
                    JointKind::Spherical => Motion::Spherical,
                    JointKind::Floating => Motion::Floating,
                    _ => Motion::Revolute,
                };
                let (n_q, n_v) = (motion.n_q(), motion.n_v());
                let local = self.model.bodies.len() - body;
                freedoms.extend((0..n_v).map(|k| Freedom {
                    v: v - first_v + k,
                    q: q - first_q,
                    body: local,
                    k,
                    motion,
                    single: n_v == 1,
                }));
                let parent_body = self.skeleton.parent[m].map_or(0, |p| self.body_of[p]);
                local_parent.push(if parent_body >= body { parent_body - body + 1 } else { 0 });
                self.body_of[m] = self.model.bodies.len();
                if motion == Motion::Revolute && joints.len() == 1 && joint.coupling.is_none() {
                    self.model.free.push((self.model.bodies.len(), q));
                }
                self.model.bodies.push(Body {
                    parent: parent_body,
                    motion,
                    q,
                    v,
                    E: placed.R,
                    r: placed.p,
                    mass: Dd::ZERO,
                    h: zero(),
                    inertia: [Dd::ZERO; 6],
                });
                self.model.cluster_of.push(c);
                self.model.cluster_of_v.extend(std::iter::repeat_n(c, n_v));
                (q, v) = (q + n_q, v + n_v);
            }
            let Roles { independent, dependent, independent_q, dependent_q, active } =
                self.roles(joints, first_q, first_v);
            let n_vy = independent.len();
            let (n_v, g) = (v - first_v, self.model.n_g);
            self.model.n_g += n_v * n_vy;
            // the nearest independent that carries each independent
            let carrier = self.last_independent(parent);
            for k in 0..n_vy {
                self.model.branches.push(if k == 0 { carrier } else { vy + k - 1 });
            }
            self.model.clusters.push(Cluster {
                parent,
                body,
                n: joints.len(),
                v: first_v,
                q: first_q,
                n_v,
                n_q: q - first_q,
                freedoms,
                vy,
                n_vy,
                g,
                independent,
                dependent,
                locked: Vec::new(),
                independent_q,
                dependent_q,
                local_parent,
                active,
                cuts: Vec::new(),
                rows: Vec::new(),
                used: Vec::new(),
                closure: Closure::Serial,
                length: 1.0,
            });
            vy += n_vy;
        }
    }

    /// The last independent velocity of the nearest cluster on the way to the root that has one.
    fn last_independent(&self, mut body: usize) -> usize {
        while body != 0 {
            let cluster = &self.model.clusters[self.model.cluster_of[body]];
            if cluster.n_vy > 0 {
                return cluster.vy + cluster.n_vy - 1;
            }
            body = cluster.parent;
        }
        usize::MAX
    }

    /// What each joint of a cluster is, by local velocity and coordinate.
    fn roles(&self, joints: &[usize], first_q: usize, first_v: usize) -> Roles {
        let written = |m: &usize| self.skeleton.moving[*m];
        let body = |m: &usize| &self.model.bodies[self.body_of[*m]];
        let velocities = |m: &usize| {
            (body(m).v - first_v..body(m).v - first_v + body(m).motion.n_v()).collect::<Vec<_>>()
        };
        let coordinates = |m: &usize| {
            (body(m).q - first_q..body(m).q - first_q + body(m).motion.n_q()).collect::<Vec<_>>()
        };
        let local = |j: &usize| joints.iter().find(|m| written(m) == *j);
        let independent: Vec<&usize> = self
            .description
            .submechanisms
            .iter()
            .flat_map(|s| &s.independent)
            .filter_map(local)
            .collect();
        let dependent = || joints.iter().filter(|m| !independent.contains(m));
        let active = self.description.submechanisms.iter().flat_map(|s| &s.active).enumerate();
        Roles {
            active: active
                .filter_map(|(u, j)| local(j).map(|m| (u, body(m).v - first_v)))
                .collect(),
            dependent: dependent().flat_map(velocities).collect(),
            dependent_q: dependent().flat_map(coordinates).collect(),
            independent: independent.iter().copied().flat_map(velocities).collect(),
            independent_q: independent.iter().copied().flat_map(coordinates).collect(),
        }
    }

    /// Link frames, and the inertia of each body from the links that it carries.
    fn frames(&mut self) {
        for (link, written) in self.description.links.iter().enumerate() {
            let x = self.skeleton.x_carrier_link[link];
            let (body, x_body_frame) = match self.skeleton.carrier[link] {
                Some(m) => {
                    (self.body_of[m], Pose { R: self.turn[m].transpose(), p: zero() }.then(&x))
                }
                None => (0, x),
            };
            self.model.frames.push(Frame { body, x_body_frame });
            if let (Some(inertial), true) = (&written.inertial, body != 0) {
                let (mass, h, I) = inertia(inertial, &x_body_frame);
                let to = &mut self.model.bodies[body];
                to.mass += mass;
                to.h += h;
                for (entry, x) in to.inertia.iter_mut().zip([
                    I[(0, 0)],
                    I[(0, 1)],
                    I[(0, 2)],
                    I[(1, 1)],
                    I[(1, 2)],
                    I[(2, 2)],
                ]) {
                    *entry += x;
                }
            }
        }
    }

    /// Cuts and couplings on their clusters; returns who owns each external row.
    fn rows(
        &mut self,
        loops: &[Vec<Loop>],
        moving_of: &[usize],
    ) -> Vec<(usize, Option<(usize, usize)>)> {
        let mut owner = Vec::new();
        let world = self.zero_poses();
        for (s, submechanism) in self.description.submechanisms.iter().enumerate() {
            for (l, of) in loops[s].iter().enumerate() {
                let (a, b) = self.skeleton.between(of.predecessor, of.successor);
                let Some(&m) = a.first().or(b.first()) else { continue };
                let c = self.model.cluster_of[self.body_of[m]];
                let cut = self.cut(of, c, &a, &b, &world);
                let cluster = &mut self.model.clusters[c];
                for r in 0..of.rows.len() {
                    cluster.rows.push(owner.len());
                    owner.push((s, Some((l, r))));
                }
                cluster.cuts.push(cut);
            }
            for &j in &submechanism.spanning_tree {
                if let Some(coupling) = &self.description.joints[j].coupling {
                    let body = self.body_of[moving_of[j]];
                    let c = self.model.cluster_of[body];
                    let first = self.model.clusters[c].v;
                    let local = |j: usize| self.model.bodies[self.body_of[moving_of[j]]].v - first;
                    let mut terms = vec![(local(j), Dd::ONE)];
                    for (master, multiplier) in &coupling.terms {
                        terms.push((local(*master), -Dd::from_f64(*multiplier)));
                    }
                    let offset = -Dd::from_f64(coupling.offset);
                    let row = CutRow {
                        angular: zero(),
                        linear: zero(),
                        linear_p: zero(),
                        against: None,
                        terms,
                        offset,
                    };
                    let identity = Pose::identity();
                    let cluster = &mut self.model.clusters[c];
                    let path = row.terms.iter().map(|(j, _)| (*j, true)).collect();
                    let cut = Cut {
                        predecessor: 0,
                        successor: 0,
                        x_p_cut: identity,
                        x_s_cut: identity,
                        rows: vec![row],
                        path,
                        angular: false,
                    };
                    cluster.cuts.push(cut);
                    cluster.rows.push(owner.len());
                    owner.push((s, None));
                }
            }
        }
        owner
    }

    /// Pose of every body at zero {root}.
    fn zero_poses(&self) -> Vec<Pose<Dd>> {
        let mut world = vec![Pose::identity()];
        for body in &self.model.bodies[1..] {
            world.push(world[body.parent].then(&Pose { R: body.E, p: body.r }));
        }
        world
    }

    /// A loop as a cut of a cluster; `a` and `b` are the joints on the predecessor's and the
    /// successor's side.
    fn cut(&self, of: &Loop, c: usize, a: &[usize], b: &[usize], world: &[Pose<Dd>]) -> Cut<Dd> {
        let cluster = &self.model.clusters[c];
        let local = |link: usize| {
            let body = self.model.frames[link].body;
            if body >= cluster.body && body < cluster.body + cluster.n {
                body - cluster.body + 1
            } else {
                0
            }
        };
        let (p, s) = (local(of.predecessor), local(of.successor));
        let global =
            |local: usize| if local == 0 { cluster.parent } else { cluster.body + local - 1 };
        let in_root = |link: usize| {
            world[self.model.frames[link].body].then(&self.model.frames[link].x_body_frame)
        };
        let (P, S) = match &of.cut {
            written::Cut::AtJoint(j) => {
                let frame = in_root(self.description.joints[*j].child);
                (frame, frame)
            }
            written::Cut::AtLink(link) => (in_root(*link), in_root(*link)),
            written::Cut::Placed { predecessor, successor } => (
                in_root(of.predecessor).then(&pose(predecessor)),
                in_root(of.successor).then(&pose(successor)),
            ),
        };
        let x_p_cut = world[global(p)].inverse().then(&P);
        let rows = of.rows.iter().map(|row| {
            let [wx, wy, wz, vx, vy, vz] = row.axis;
            let against = row.against.map(vector);
            let linear = if against.is_some() { zero() } else { vector([vx, vy, vz]) };
            CutRow {
                angular: vector([wx, wy, wz]),
                linear,
                linear_p: mul(&x_p_cut.R, &linear),
                against,
                terms: Vec::new(),
                offset: Dd::ZERO,
            }
        });
        let path = a.iter().map(|m| (m, false)).chain(b.iter().map(|m| (m, true))).flat_map(
            |(m, side)| {
                let body = &self.model.bodies[self.body_of[*m]];
                (0..body.motion.n_v()).map(move |k| (body.v - cluster.v + k, side))
            },
        );
        Cut {
            predecessor: p,
            successor: s,
            x_p_cut,
            x_s_cut: world[global(s)].inverse().then(&S),
            rows: rows.collect(),
            path: path.collect(),
            angular: of.rows.iter().any(|row| row.axis[..3].iter().any(|x| *x != 0.0)),
        }
    }

    /// Closures that need no analysis, lengths, zero pose; sizes and names.
    fn finish(
        mut self,
        row_owner: &[(usize, Option<(usize, usize)>)],
        loops: &[Vec<Loop>],
        errors: &mut Vec<Diagnostic>,
    ) -> Option<(Model<Dd>, ModelInfo)> {
        self.model.zero = vec![Dd::ZERO; self.model.order.q.len()];
        for body in self.model.bodies.iter().filter(|body| body.motion.n_q() > 1) {
            self.model.zero[body.q + body.motion.n_q() - 1] = Dd::ONE;
        }
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
            let length = characteristic_length(cluster, &self.model.bodies);
            let coupling = couplings(cluster);
            let cluster = &mut self.model.clusters[c];
            cluster.length = length;
            self.model.tied.push(c);
            if let Some(coupling) = coupling {
                for &j in &cluster.dependent {
                    self.model.zero[cluster.q + cluster.freedoms[j].q] = coupling.b[j];
                }
                cluster.closure = Closure::Coupling(coupling);
                cluster.used = (0..cluster.rows.len()).collect();
            }
        }
        if !errors.is_empty() {
            return None;
        }
        let branches = self.branches();
        let names = self.names;
        let loop_names = row_owner.iter().scan(0usize, |_, (s, of)| {
            Some(match of {
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
