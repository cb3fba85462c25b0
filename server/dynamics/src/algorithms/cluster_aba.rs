//! Articulated bodies over clusters: M_y ÿ = b in O(n) by constraint embedding [J12; K21, eq. 5.4
//! to 5.8; a single joint is F08, 7.3].
//!
//! The velocity and gravity terms are subtracted first by Newton-Euler at q̈ = g, which leaves M_y
//! ÿ = b. Each cluster is one joint with the independents ÿ, the columns U and the matrix D of
//! [`super::cluster_columns`], where the inertias that its bodies support are articulated:
//!
//! ```text
//! r   = b − Σ_i G_iᵀ S_iᵀ p_i                         D = L Δ Lᵀ,  Y = L⁻¹ Uᵀ
//! I_p += Σ_i X I_i Xᵀ − Yᵀ Δ⁻¹ Y                      p_p += Σ_i X p_i + Yᵀ Δ⁻¹ L⁻¹ r
//! ÿ   = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p)                       a_i = Xᵀ a_parent + S_i G_i ÿ
//! ```
//!
//! The factorised matrix is m×m for m independents and any number of bodies. A body that carries no
//! other cluster stays rigid. An articulated inertia is kept as the blocks of n = J α + H a, f =
//! Hᵀ α + M a.

use crate::algorithms::cluster_columns::{ClusterJoint, component, transform_force};
use crate::algorithms::terms::add_rotors;
use crate::linalg::factorise_full;
use crate::mechanism::{Cluster, GBlock, Motion, Rotor};
use crate::model::{Model, Scope};
use crate::scalar::{Real, Symmetric, Triple};
use crate::spatial::{Matrix, cross_rows};
use crate::workspace::{Articulated, BodyState, Composite, Embedding, Force, Workspace};

/// Solves M_y ÿ = b; `ws.ydd` holds b and becomes ÿ. The scope has the needed clusters
/// and all others between them and the world. Needs the joint poses and G. True if every D is
/// positive.
pub(crate) fn embedded_solve<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
) -> bool {
    let Workspace { motion, G, composite, inside, embedding, ydd: b, uncoupled_diagonal, .. } = ws;
    let Embedding { bodies, Y, factor } = embedding;
    let mut positive = true;

    // I_i of each body, p_i = 0
    for run in scope.affected.runs() {
        let of_bodies = composite[run.clone()].iter_mut().zip(&mut bodies[run.clone()]);
        let has_child = &model.has_child_cluster[run.clone()];
        for ((rigid, articulated), (body, has_child)) in
            of_bodies.zip(model.bodies[run].iter().zip(has_child))
        {
            *rigid = Composite::of(body);
            if *has_child {
                *articulated = Articulated::none();
            }
        }
    }

    // I_p += Σ_i X I_i Xᵀ − Yᵀ Δ⁻¹ Y,  p_p += Σ_i X p_i + Yᵀ Δ⁻¹ L⁻¹ r, towards the root
    let rotors = model.terms.rotors.as_slice();
    let mut pass = Pass { model, motion, G, composite, bodies, inside, rotors };
    for run in scope.clusters.runs().rev() {
        for cluster in model.clusters[run].iter().rev() {
            let D = cluster.g_offset;
            let independents = cluster.independents();
            let uncoupled_diagonal = &mut uncoupled_diagonal[independents.clone()];
            let Y = &mut Y[independents.clone()];
            let b = &mut b[independents];
            let D = &mut factor[D..];
            let sound = match cluster.n_vy {
                1 if cluster.n_v == 1 => {
                    pass.single_joint(cluster, &mut Y[0], &mut D[0], &mut b[0])
                }
                1 if T::UNROLLED => pass.several_joints::<1>(cluster, Y, D, b, uncoupled_diagonal),
                2 if T::UNROLLED => pass.several_joints::<2>(cluster, Y, D, b, uncoupled_diagonal),
                3 if T::UNROLLED => pass.several_joints::<3>(cluster, Y, D, b, uncoupled_diagonal),
                _ => pass.several_joints::<0>(cluster, Y, D, b, uncoupled_diagonal),
            };
            positive &= sound;
        }
    }

    // ÿ = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p),  a_i = Xᵀ a_parent + S_i G_i ÿ, from the root outwards; a_0 = 0
    (bodies[0].alpha, bodies[0].a) = (T::Triple::zero(), T::Triple::zero());
    for run in scope.clusters.runs() {
        for cluster in &model.clusters[run] {
            let Y = &Y[cluster.independents()];
            let b = &mut b[cluster.independents()];
            let factor = &factor[cluster.g_offset..];
            if cluster.n_v == 1 && cluster.n_vy == 1 {
                accelerate_joint(model, cluster, (motion, bodies), (&Y[0], factor[0]), b);
            } else {
                accelerate_joints(model, cluster, G, (motion, bodies), (Y, factor), b);
            }
        }
    }
    positive
}

/// ÿ and the acceleration of the body of one free degree of freedom; `b` holds r.
#[inline(always)]
fn accelerate_joint<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    (motion, bodies): (&[BodyState<T>], &mut [Articulated<T>]),
    (Y, inverse): (&Force<T>, T),
    b: &mut [T],
) {
    // ÿ = (r − U a_p) / D
    let i = cluster.body;
    let (mut alpha, mut a) = bodies[cluster.parent].acceleration_in(&motion[i]);
    b[0] = (b[0] - Y.0.dot(alpha) - Y.1.dot(a)) * inverse;
    accelerate::<T>(model.bodies[i].motion, b, &mut alpha, &mut a);
    (bodies[i].alpha, bodies[i].a) = (alpha, a);
}

/// ÿ = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p) of joints closed by loops, or of one of several degrees of freedom,
/// and a_i of the bodies that carry others.
#[inline(always)]
fn accelerate_joints<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    G: &[T],
    (motion, bodies): (&[BodyState<T>], &mut [Articulated<T>]),
    (Y, factor): (&[Force<T>], &[T]),
    b: &mut [T],
) {
    let m = cluster.n_vy;
    let p = &bodies[cluster.parent];
    let L = &factor[..m * m];
    for k in (0..m).rev() {
        let (n, f) = &Y[k];
        let mut ydd = (b[k] - (*n).dot(p.alpha) - (*f).dot(p.a)) * L[k * m + k];
        for l in k + 1..m {
            ydd = (-L[l * m + k]).mul_add(b[l], ydd);
        }
        b[k] = ydd;
    }
    // a_i = Xᵀ a_parent + S_i G_i ÿ
    let G = cluster.G(G);
    for i in cluster.bodies() {
        if !model.has_child_cluster[i] {
            continue;
        }
        let body = &model.bodies[i];
        let (mut alpha, mut a) = bodies[body.parent].acceleration_in(&motion[i]);
        let mut qdd = [T::ZERO; 6];
        for k in 0..body.motion.n_v() {
            let G_i = G.row(body.v - cluster.v + k);
            qdd[k] = G_i.iter().zip(b.iter()).fold(T::ZERO, |sum, (g, ydd)| g.mul_add(*ydd, sum));
        }
        accelerate::<T>(body.motion, &qdd, &mut alpha, &mut a);
        (bodies[i].alpha, bodies[i].a) = (alpha, a);
    }
}

/// The pass from the leaves to the root, with the numbers of the workspace.
struct Pass<'a, T: Real> {
    model: &'a Model<T>,
    motion: &'a [BodyState<T>],
    G: &'a [T],
    composite: &'a mut [Composite<T>],
    bodies: &'a mut [Articulated<T>],
    /// Scratch for n_vy columns of each body of a cluster.
    inside: &'a mut [Force<T>],
    /// Rotors of the clusters that are still to come.
    rotors: &'a [Rotor<T>],
}

impl<T: Real> Pass<'_, T> {
    /// One free degree of freedom: I − U Uᵀ / D goes to the parent, U stays at the body.
    #[inline]
    fn single_joint(
        &mut self,
        cluster: &Cluster<T>,
        Y: &mut Force<T>,
        inverse: &mut T,
        b: &mut T,
    ) -> bool {
        let i = cluster.body;
        let joint = self.model.bodies[i].motion;
        let (before, articulated) = self.bodies.split_at_mut(i);
        let articulated = &mut articulated[0];
        if !self.model.has_child_cluster[i] {
            *articulated = Articulated::none();
        }
        // U = I s,  D = s·U,  r = b − s·p
        articulated.add_rigid(&self.composite[i]);
        let U = articulated.column(joint, 0);
        let mut d = [component(joint, 0, &U)];
        let own = (cluster.v, 1);
        add_rotors::<T>(&mut self.rotors, own, GBlock::new(&[T::ONE], 1), &mut d, 1);
        *inverse = T::ONE / d[0];
        *b -= component(joint, 0, &(articulated.n, articulated.f));
        if cluster.parent != 0 {
            articulated.project_out(&U, *inverse, *b);
            articulated.add_to_parent(&self.motion[i], &mut before[cluster.parent]);
        }
        *Y = U;
        T::ZERO.lt(d[0])
    }

    /// Joints closed by loops, or one of several degrees of freedom: U and Y at the parent body. M
    /// as for [`ClusterJoint::columns`].
    #[inline]
    fn several_joints<const M: usize>(
        &mut self,
        cluster: &Cluster<T>,
        Y: &mut [Force<T>],
        D: &mut [T],
        b: &mut [T],
        uncoupled_diagonal: &mut [T],
    ) -> bool {
        let m = if M > 0 { M } else { cluster.n_vy };
        let model = self.model;
        let motion = self.motion;
        let G = GBlock::new(&self.G[cluster.block()], m);
        let Y = &mut Y[..m];
        let D = &mut D[..m * m];
        let b = &mut b[..m];
        let composite = &mut *self.composite;
        let bodies = &mut *self.bodies;
        // I_i, p_i of the bodies with all that they carry;  r = b − Σ_i G_iᵀ S_iᵀ p_i
        for i in cluster.bodies().rev() {
            let body = &model.bodies[i];
            if !model.has_child_cluster[i] {
                if body.parent != 0 {
                    let moved = composite[i].transformed(&motion[i]);
                    composite[body.parent].add(&moved);
                }
                continue;
            }
            let (before, articulated) = bodies.split_at_mut(i);
            let articulated = &mut articulated[0];
            articulated.add_rigid(&composite[i]);
            for k in 0..body.motion.n_v() {
                let p = component(body.motion, k, &(articulated.n, articulated.f));
                for (r, g) in b.iter_mut().zip(G.row(body.v - cluster.v + k)) {
                    *r = (-*g).mul_add(p, *r);
                }
            }
            if body.parent != 0 {
                articulated.add_to_parent(&motion[i], &mut before[body.parent]);
            }
        }

        // D and U
        let of_bodies = &bodies[cluster.body..];
        let rigid = &composite[cluster.body..];
        let column = |i: usize, joint, k| {
            if model.has_child_cluster[cluster.body + i] {
                of_bodies[i].column(joint, k)
            } else {
                rigid[i].column(joint, k)
            }
        };
        ClusterJoint { model, cluster, G, motion }.columns::<M>(
            column,
            self.inside,
            Y,
            D,
            uncoupled_diagonal,
        );
        add_rotors::<T>(&mut self.rotors, (cluster.v, cluster.n_v), G, D, m);

        // D = L Δ Lᵀ,  L⁻¹ r,  Y = L⁻¹ Uᵀ;  I_p −= Yᵀ Δ⁻¹ Y,  p_p += Yᵀ Δ⁻¹ L⁻¹ r
        let positive = factorise_full(D, m);
        for k in 0..m {
            for l in 0..k {
                let x = -D[k * m + l];
                b[k] = x.mul_add(b[l], b[k]);
                let (n, f) = Y[l];
                Y[k] = (Y[k].0.add_scaled(n, x), Y[k].1.add_scaled(f, x));
            }
            if cluster.parent != 0 {
                bodies[cluster.parent].project_out(&Y[k], D[k * m + k], b[k]);
            }
        }
        positive
    }
}

/// Adds the joint's own acceleration.
#[inline(always)]
fn accelerate<T: Real>(joint: Motion, qdd: &[T], alpha: &mut T::Triple, a: &mut T::Triple) {
    match joint {
        Motion::Revolute => alpha[2] += qdd[0],
        Motion::Prismatic => a[2] += qdd[0],
        Motion::Spherical => *alpha += T::Triple::new(qdd[0], qdd[1], qdd[2]),
        Motion::Floating => {
            *alpha += T::Triple::new(qdd[0], qdd[1], qdd[2]);
            *a += T::Triple::new(qdd[3], qdd[4], qdd[5]);
        }
    }
}

impl<T: Real> Articulated<T> {
    /// Adds a rigid inertia.
    #[inline(always)]
    fn add_rigid(&mut self, of: &Composite<T>) {
        self.J += of.inertia;
        let h = of.h;
        let o = T::ZERO;
        let h = T::Triple::columns_from([o, h[2], -h[1], -h[2], o, h[0], h[1], -h[0], o]);
        self.H.iter_mut().zip(h).for_each(|(x, h)| *x += h);
        self.M.add_to_diagonal(of.mass);
    }

    /// I s for dof k of a joint.
    #[inline(always)]
    fn column(&self, joint: Motion, k: usize) -> Force<T> {
        let H = &self.H;
        let turn = |k: usize| (self.J.column(k), T::Triple::new(H[0][k], H[1][k], H[2][k]));
        let slide = |k: usize| (H[k], self.M.column(k));
        match joint {
            Motion::Revolute => turn(2),
            Motion::Prismatic => slide(2),
            Motion::Spherical | Motion::Floating if k < 3 => turn(k),
            Motion::Spherical | Motion::Floating => slide(k - 3),
        }
    }

    /// I − y yᵀ / d and p + y r / d.
    #[inline(always)]
    fn project_out(&mut self, (n, f): &Force<T>, inverse: T, r: T) {
        let by = T::Triple::splat(-inverse);
        let n_d = n.times(by);
        let f_d = f.times(by);
        self.J.add_product(n, &n_d);
        self.M.add_product(f, &f_d);
        for (j, x) in self.H.iter_mut().enumerate() {
            *x = n.mul_add(T::Triple::splat(f_d[j]), *x);
        }
        self.n = self.n.add_scaled(n_d, -r);
        self.f = self.f.add_scaled(f_d, -r);
    }

    /// Adds inertia and bias force to the parent's: M' = R M Rᵀ, H' = R H Rᵀ + [p]× M', J' = R J Rᵀ
    /// + [p]× H'ᵀ + ([p]× (R H Rᵀ)ᵀ)ᵀ.
    #[inline(always)]
    fn add_to_parent(&self, x: &BodyState<T>, parent: &mut Articulated<T>) {
        let R = &x.R;
        let p = &x.p;
        let mut J = self.J.rotate(R);
        let M = self.M.rotate(R);
        let H = R.times(self.H).times(T::Triple::transposed(R));
        let mut shifted = H;
        for (k, x) in shifted.iter_mut().enumerate() {
            *x += (*p).cross(M.column(k));
        }
        // J' = R J Rᵀ + [p]× H'ᵀ + ([p]× (R H Rᵀ)ᵀ)ᵀ
        let a = T::Triple::transposed(&cross_rows(*p, &shifted));
        let b = cross_rows(*p, &H);
        J.add_upper(&[a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        parent.J += J;
        parent.M += M;
        parent.H.iter_mut().zip(shifted).for_each(|(x, of)| *x += of);
        let (n, f) = transform_force(&(self.n, self.f), x);
        parent.n += n;
        parent.f += f;
    }

    /// The acceleration of this body where a child's origin is, in the child's axes.
    #[inline(always)]
    fn acceleration_in(&self, x: &BodyState<T>) -> (T::Triple, T::Triple) {
        let rows = T::Triple::transposed(&x.R);
        let a = self.a.add_cross(self.alpha, x.p);
        (rows.apply(self.alpha), rows.apply(a))
    }
}
