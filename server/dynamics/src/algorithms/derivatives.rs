//! First derivatives of inverse dynamics over clusters, in O(n d) [SRW22, in root axes; the columns
//! of a cluster are joined by its G, as in constraint embedding].
//!
//! A unit of y_j displaces the bodies that it carries by D; seen from a displaced body, velocity
//! and acceleration change by Ḋ and D̈ + Ḋ × V, where D, Ḋ and D̈ at the root's origin are the
//! same for all bodies below the cluster. With one tree joint, D = s and
//!
//! ```text
//!   Ḋ = V_p × s    D̈ = A_p × s + V_p × Ḋ    Υ = V × s + Ḋ       A_0 = −gravity
//!   δf = D ×* f + I D̈ + B Ḋ                  by y
//!   δf = I Υ + B D                           by ẏ
//! ```
//! B turns momentum: B D = (2 Σ m x × (ω × ẋ), 2 ω × Σ m ẋ), so that it depends on the angular part
//! ω of D alone. D ×* f cancels in the forces of descendants, whose motions D displaces too. For a
//! cluster, with r of its tree joints and H1 = ∂q̇/∂y, H2 = ∂q̈/∂y:
//!
//! ```text
//!   ∂τ/∂y = Gᵀ (r_q G + r_v H1 + M H2) + W      ∂τ/∂ẏ = Gᵀ (r_v G + M (Ġ + H1))
//! ```

use crate::mechanism::{Cluster, Motion};
use crate::model::Model;
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::{Columns, Matrix, Pose, Spatial, total};
use crate::workspace::{BodyState, Column, Composite, Derivatives, Moving, Seen, Supported};

/// Motions of all bodies, their columns, and the forces on them, from the poses in the root.
pub(crate) fn moving_bodies<T: Real>(
    model: &Model<T>,
    (qd, qdd): (&[T], &[T]),
    world: &[Pose<T>],
    d: &mut Derivatives<T>,
) {
    d.bodies[0].V = Spatial::zero();
    d.bodies[0].A = Spatial { a: T::Triple::zero(), l: -T::Triple::of(&model.gravity) };
    for (i, body) in model.bodies.iter().enumerate().skip(1) {
        let Moving { V: V_p, A: A_p, .. } = d.bodies[body.parent];
        let R: Columns<T> = T::Triple::columns_of(&world[i].R);
        let p = T::Triple::of(&world[i].p);
        let n = body.motion.n_v();
        let columns = &mut d.columns[body.v..body.v + n];
        let mut V = V_p;
        for (k, column) in columns.iter_mut().enumerate() {
            let axis = if n == 1 { R[2] } else { R[k % 3] };
            let slides = body.motion == Motion::Prismatic || k >= 3;
            let s = Spatial::joint(axis, p, slides);
            let rate = V_p.cross(s);
            let second = A_p.cross(s).plus(V_p.cross(rate));
            column.of = Seen { moved: s, rate, second, by_rate: rate.plus(rate) };
            V = V.add_scaled(s, qd[body.v + k]);
        }
        let mut A = A_p;
        for (k, Column { of, .. }) in columns.iter_mut().enumerate() {
            let turned = if n == 1 { of.rate } else { V.cross(of.moved) };
            of.by_rate = turned.plus(of.rate);
            A = A.add_scaled(of.moved, qdd[body.v + k]).add_scaled(turned, qd[body.v + k]);
        }
        let at = BodyState { R, p, ..BodyState::at_rest() };
        d.bodies[i] = Moving::of(Composite::of(body).transformed(&at), V, A);
    }
}

/// sᵀ H and ṡᵀ H of each column s, with H the momentum of all that it moves: the momentum along
/// a tree velocity, with that of its rotor, and the part of its rate by the turning of its axis.
/// After [`moving_bodies`], into `tau_q` and `held_q`; the forces on the bodies are lost.
pub(crate) fn momenta<T: Real>(model: &Model<T>, qd: &[T], d: &mut Derivatives<T>) {
    for body in &mut d.bodies {
        body.force = body.inertia.times(body.V);
    }
    for (i, body) in model.bodies.iter().enumerate().skip(1).rev() {
        let Moving { V, force: H, .. } = d.bodies[i];
        for v in body.v..body.v + body.motion.n_v() {
            let s = d.columns[v].of.moved;
            d.tau_q[v] = s.dot(H);
            d.held_q[v] = V.cross(s).dot(H);
        }
        let parent = &mut d.bodies[body.parent];
        parent.force = parent.force.plus(H);
    }
    for rotor in &model.terms.rotors {
        d.tau_q[rotor.v] = rotor.inertia.mul_add(qd[rotor.v], d.tau_q[rotor.v]);
    }
}

impl<T: Real> Moving<T> {
    /// A body alone, without external forces.
    #[inline(always)]
    fn of(inertia: Composite<T>, V: Spatial<T>, A: Spatial<T>) -> Moving<T> {
        let momentum = inertia.times(V);
        let h = inertia.h;
        // Σ m ẋ xᵀ = v hᵀ + ω × Σ m x xᵀ,  Σ m x xᵀ = ½ tr I 1 − I
        let columns = [0, 1, 2].map(|k| inertia.inertia.column(k));
        let half_trace = (columns[0][0] + columns[1][1] + columns[2][2]) * T::from_f64(0.5);
        let minus_two = T::from_f64(-2.0);
        let mut turning = [0, 1, 2].map(|k| {
            let mut of_x = -columns[k];
            of_x[k] += half_trace;
            let outer = V.l.times(T::Triple::splat(h[k])).add_cross(V.a, of_x);
            outer.times(T::Triple::splat(minus_two))
        });
        let trace = turning[0][0] + turning[1][1] + turning[2][2];
        (0..3).for_each(|k| turning[k][k] -= trace);
        let zero = T::Triple::zero();
        Moving {
            V,
            A,
            inertia,
            momentum: momentum.l,
            turning,
            force: inertia.times(A).plus(V.cross_force(momentum)),
            external: zero,
            follows: [zero; 3],
        }
    }

    /// A wrench [n; f] in root axes at a point that moves with the body.
    pub(crate) fn push(&mut self, point: T::Triple, n: T::Triple, f: T::Triple) {
        let wrench = Spatial { a: n.add_cross(point, f), l: f };
        self.force = self.force.minus(wrench);
        self.external += f;
        // x × (ω × F) + ω × n = ω (x·F) − F (x·ω) + ω × n
        let along = point.dot(f);
        for k in 0..3 {
            let mut e = T::Triple::zero();
            e[k] = T::ONE;
            let column = e.times(T::Triple::splat(along)).add_scaled(f, -point[k]);
            self.follows[k] += column.add_cross(e, n);
        }
    }

    /// Adds the composite of a child.
    #[inline(always)]
    fn carry(&mut self, child: &Moving<T>, pushed: bool) {
        self.inertia.add(&child.inertia);
        self.momentum += child.momentum;
        self.force = self.force.plus(child.force);
        (0..3).for_each(|k| self.turning[k] += child.turning[k]);
        if pushed {
            self.external += child.external;
            (0..3).for_each(|k| self.follows[k] += child.follows[k]);
        }
    }

    /// B D from the angular part of D.
    #[inline(always)]
    fn turned(&self, w: T::Triple) -> Spatial<T> {
        Spatial { a: self.turning.apply(w), l: w.cross(self.momentum + self.momentum) }
    }

    /// The composite along a column.
    #[inline(always)]
    fn supported(&self, of: &Seen<T>, pushed: bool) -> Supported<T> {
        let s = of.moved;
        let twice = self.momentum + self.momentum;
        let momentum = self.inertia.times(s);
        let mut force = self.inertia.times(of.second).plus(self.turned(of.rate.a));
        force = force.plus(s.cross_force(self.force));
        let mut by_moving = T::Triple::zero();
        if pushed {
            let follows = Spatial { a: self.follows.apply(s.a), l: s.a.cross(self.external) };
            force = force.plus(follows);
            by_moving = self.follows.apply_transposed(s.a).add_cross(self.external, s.l);
        }
        Supported {
            momentum,
            by_turning: self.turning.apply_transposed(s.a).add_cross(twice, s.l),
            by_moving,
            force,
            by_rate: self.inertia.times(of.by_rate).plus(self.turned(s.a)),
        }
    }
}

impl<T: Real> Composite<T> {
    /// I m.
    #[inline(always)]
    fn times(&self, m: Spatial<T>) -> Spatial<T> {
        let I = [0, 1, 2].map(|k| self.inertia.column(k));
        let mass = T::Triple::splat(self.mass);
        Spatial {
            a: I.apply(m.a).add_cross(self.h, m.l),
            l: m.l.times(mass).add_cross(m.a, self.h),
        }
    }
}

impl<T: Real> Supported<T> {
    /// The force on this column by a displacement of, or above, the body that it moves.
    #[inline(always)]
    fn by(&self, above: &Seen<T>) -> T {
        let sum = self.by_moving.mul_add(above.moved.a, self.by_turning.times(above.rate.a));
        total(self.momentum.along(above.second, sum))
    }

    /// The same by the rate.
    #[inline(always)]
    fn by_rate_of(&self, above: &Seen<T>) -> T {
        total(self.momentum.along(above.by_rate, self.by_turning.times(above.moved.a)))
    }
}

/// ∂τ_y/∂y, ∂τ_y/∂ẏ and M_y of all clusters, without W, from [`moving_bodies`], G, Ġ, H1 and H2.
/// `pushed`: there are external forces.
pub(crate) fn force_derivatives<T: Real>(
    model: &Model<T>,
    G: &[T],
    pushed: bool,
    rubbed: Option<&[T]>,
    d: &mut Derivatives<T>,
) {
    let n = model.sizes().n_vy;
    d.tau_y.iter_mut().for_each(|x| x.fill(T::ZERO));
    see(model, G, d);
    for cluster in model.clusters.iter().rev() {
        for i in cluster.bodies().rev() {
            let body = &model.bodies[i];
            let (before, of_body) = d.bodies.split_at_mut(i);
            let of_body = &of_body[0];
            for column in &mut d.columns[body.v..body.v + body.motion.n_v()] {
                column.supported = of_body.supported(&column.of, pushed);
            }
            if body.parent != 0 {
                before[body.parent].carry(of_body, pushed);
            }
        }
        if cluster.is_serial() {
            of_joint(model, cluster, rubbed, d);
        } else {
            of_cluster(model, cluster, G, rubbed, d);
            if cluster.parent != 0 {
                join(cluster, G, d);
            }
        }
        // the clusters that carry this one
        let [by_y, by_yd] = &mut d.tau_y;
        let mut b = cluster.parent;
        while b != 0 {
            let carrier = &model.clusters[model.cluster_of[b]];
            let seen = &d.seen[d.seen_at[b]..][..carrier.n_vy];
            for (j, of) in d.joined[..cluster.n_vy].iter().enumerate() {
                let j = cluster.vy + j;
                for (k, above) in seen.iter().enumerate() {
                    let k = carrier.vy + k;
                    by_y[k * n + j] = of.by(above);
                    by_yd[k * n + j] = of.by_rate_of(above);
                    by_y[j * n + k] = above.moved.dot(of.force);
                    by_yd[j * n + k] = above.moved.dot(of.by_rate);
                    d.M_y[model.sparsity.start[j] + model.sparsity.depth[k]] =
                        above.moved.dot(of.momentum);
                }
            }
            b = carrier.parent;
        }
    }
}

/// Displacements of the bodies that carry clusters.
fn see<T: Real>(model: &Model<T>, G: &[T], d: &mut Derivatives<T>) {
    for cluster in &model.clusters {
        let m = cluster.n_vy;
        for i in cluster.bodies().filter(|i| model.has_child_cluster[*i]) {
            let body = &model.bodies[i];
            let columns = &d.columns[body.v..body.v + body.motion.n_v()];
            let at = d.seen_at[i];
            if cluster.is_serial() {
                d.seen[at..at + m].iter_mut().zip(columns).for_each(|(to, x)| *to = x.of);
                continue;
            }
            let parent = d.seen_at[body.parent];
            for k in 0..m {
                let mut sum =
                    if body.parent == cluster.parent { Seen::none() } else { d.seen[parent + k] };
                for (column, v) in columns.iter().zip(body.v - cluster.v..) {
                    let entry = cluster.g_offset + v * m + k;
                    let [g, gd, h1, h2] = [G, &d.Gd, &d.H1, &d.H2].map(|x| x[entry]);
                    let Seen { moved, rate, second, by_rate } = column.of;
                    sum = Seen {
                        moved: sum.moved.add_scaled(moved, g),
                        rate: sum.rate.add_scaled(rate, g).add_scaled(moved, h1),
                        second: sum
                            .second
                            .add_scaled(second, g)
                            .add_scaled(by_rate, h1)
                            .add_scaled(moved, h2),
                        by_rate: sum.by_rate.add_scaled(by_rate, g).add_scaled(moved, gd + h1),
                    };
                }
                d.seen[at + k] = sum;
            }
        }
    }
}

/// The block of one joint.
fn of_joint<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    rubbed: Option<&[T]>,
    d: &mut Derivatives<T>,
) {
    let n = model.sizes().n_vy;
    let columns = &d.columns[cluster.velocities()];
    for (j, column) in columns.iter().enumerate() {
        d.joined[j] = column.supported;
        let row = cluster.vy + j;
        for (k, above) in columns.iter().enumerate() {
            let at = (cluster.vy + k) * n + row;
            d.tau_y[0][at] = column.supported.by(&above.of);
            d.tau_y[1][at] = column.supported.by_rate_of(&above.of);
            if k <= j {
                d.M_y[model.sparsity.diagonal_at(row) + k - j] =
                    above.of.moved.dot(column.supported.momentum);
            }
        }
    }
    let diagonal = |v: usize| (cluster.vy + v - cluster.v) * (n + 1);
    for spring in own(&model.terms.springs, cluster, |spring| spring.v) {
        d.tau_y[0][diagonal(spring.v)] += spring.stiffness;
    }
    for (v, slope) in slopes(model, cluster, rubbed) {
        d.tau_y[1][diagonal(v)] += slope;
    }
    for rotor in own(&model.terms.rotors, cluster, |rotor| rotor.v) {
        let row = cluster.vy + rotor.v - cluster.v;
        d.M_y[model.sparsity.diagonal_at(row)] += rotor.inertia;
    }
}

/// The terms of a cluster among those in the order of the velocities.
fn own<'a, X, T>(terms: &'a [X], cluster: &Cluster<T>, v: impl Fn(&X) -> usize) -> &'a [X] {
    let end = cluster.v + cluster.n_v;
    let first = terms.partition_point(|term| v(term) < cluster.v);
    &terms[first..terms.partition_point(|term| v(term) < end)]
}

/// Derivatives of a cluster's dampers by the velocities of their joints, and of friction, for which
/// these are given where it counts: d + F (1 − tanh²(q̇ / v₀)) / v₀.
fn slopes<'a, T: Real>(
    model: &'a Model<T>,
    cluster: &Cluster<T>,
    qd: Option<&'a [T]>,
) -> impl Iterator<Item = (usize, T)> + 'a {
    let dampers = own(&model.terms.dampers, cluster, |damper| damper.v).iter();
    let frictions = own(&model.terms.frictions, cluster, |friction| friction.v).iter();
    dampers.map(|of| (of.v, of.damping)).chain(frictions.filter_map(move |of| {
        let dry = (*qd?.get(of.v)? * of.per_speed).tanh();
        Some((of.v, (of.coulomb * of.per_speed).mul_add(T::ONE - dry * dry, of.viscous)))
    }))
}

/// The block of joints that loops tie.
fn of_cluster<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    G: &[T],
    rubbed: Option<&[T]>,
    d: &mut Derivatives<T>,
) {
    let m = cluster.n_vy;
    let n = model.sizes().n_vy;
    let [X, Y, Z] = &mut d.products;
    let len = cluster.n_v * m;
    [&mut *X, &mut *Y, &mut *Z].into_iter().for_each(|x| x[..len].fill(T::ZERO));
    let block = cluster.block();
    let [G, Gd, H1, H2] = [G, &d.Gd, &d.H1, &d.H2].map(|x| &x[block.clone()]);
    // row a += (r_q G + r_v H1 + M H2) of column b, and so on
    let mut add = |a: usize, b: usize, (r_q, r_v, M): (T, T, T)| {
        for k in 0..m {
            let to = a * m + k;
            let from = b * m + k;
            X[to] = r_q.mul_add(G[from], r_v.mul_add(H1[from], M.mul_add(H2[from], X[to])));
            Y[to] = r_v.mul_add(G[from], M.mul_add(Gd[from] + H1[from], Y[to]));
            Z[to] = M.mul_add(G[from], Z[to]);
        }
    };
    let columns = &d.columns[cluster.velocities()];
    for (b, below) in columns.iter().enumerate() {
        let of = &below.supported;
        let carried = cluster.dofs[b].body + 1;
        let mut body = carried;
        while body != 0 {
            let first = model.bodies[cluster.body + body - 1].v - cluster.v;
            let count = model.bodies[cluster.body + body - 1].motion.n_v();
            for a in first..first + count {
                let above = &columns[a].of;
                let M = of.momentum.dot(above.moved);
                add(b, a, (of.by(above), of.by_rate_of(above), M));
                if body != carried {
                    add(a, b, (above.moved.dot(of.force), above.moved.dot(of.by_rate), M));
                }
            }
            body = cluster.local_parent[body - 1];
        }
    }
    for spring in own(&model.terms.springs, cluster, |spring| spring.v) {
        let v = spring.v - cluster.v;
        add(v, v, (spring.stiffness, T::ZERO, T::ZERO));
    }
    for (v, slope) in slopes(model, cluster, rubbed) {
        let v = v - cluster.v;
        add(v, v, (T::ZERO, slope, T::ZERO));
    }
    for rotor in own(&model.terms.rotors, cluster, |rotor| rotor.v) {
        let v = rotor.v - cluster.v;
        add(v, v, (T::ZERO, T::ZERO, rotor.inertia));
    }

    // Gᵀ
    for j in 0..m {
        let row = cluster.vy + j;
        for k in 0..m {
            let at = (cluster.vy + k) * n + row;
            let mut sums = [T::ZERO; 3];
            for v in 0..cluster.n_v {
                let g = G[v * m + j];
                let from = v * m + k;
                sums = [
                    g.mul_add(X[from], sums[0]),
                    g.mul_add(Y[from], sums[1]),
                    g.mul_add(Z[from], sums[2]),
                ];
            }
            (d.tau_y[0][at], d.tau_y[1][at]) = (sums[0], sums[1]);
            if k <= j {
                d.M_y[model.sparsity.diagonal_at(row) + k - j] = sums[2];
            }
        }
    }
}

/// The columns of a cluster, joined by G.
fn join<T: Real>(cluster: &Cluster<T>, G: &[T], d: &mut Derivatives<T>) {
    let m = cluster.n_vy;
    let block = cluster.block();
    let [G, Gd, H1, H2] = [G, &d.Gd, &d.H1, &d.H2].map(|x| &x[block.clone()]);
    let columns = &d.columns[cluster.velocities()];
    for (k, joined) in d.joined[..m].iter_mut().enumerate() {
        let mut sum = Supported::none();
        for (v, Column { supported: of, .. }) in columns.iter().enumerate() {
            let entry = v * m + k;
            let [g, h1, h2] = [G, H1, H2].map(|x| x[entry]);
            let both = Gd[entry] + h1;
            sum = Supported {
                momentum: sum.momentum.add_scaled(of.momentum, g),
                by_turning: sum.by_turning.add_scaled(of.by_turning, g),
                by_moving: sum.by_moving.add_scaled(of.by_moving, g),
                force: sum
                    .force
                    .add_scaled(of.force, g)
                    .add_scaled(of.by_rate, h1)
                    .add_scaled(of.momentum, h2),
                by_rate: sum.by_rate.add_scaled(of.by_rate, g).add_scaled(of.momentum, both),
            };
        }
        *joined = sum;
    }
}
