//! Articulated bodies over clusters: M_y ÿ = b in O(n) by constraint embedding [J12; K21, eq. 5.4
//! to 5.8; a single joint is F08, 7.3].
//!
//! The velocity and gravity terms are subtracted first by Newton-Euler at q̈ = g, so that only M_y
//! ÿ = b is left. Each cluster is one joint with the independents ÿ, the columns U and the matrix D
//! of [`super::cluster_columns`], where the inertias that its bodies support are articulated:
//!
//! ```text
//! r   = b − Σ_i G_iᵀ S_iᵀ p_i                         D = L Δ Lᵀ,  Y = L⁻¹ Uᵀ
//! I_p += Σ_i X I_i Xᵀ − Yᵀ Δ⁻¹ Y                      p_p += Σ_i X p_i + Yᵀ Δ⁻¹ L⁻¹ r
//! ÿ   = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p)                       a_i = Xᵀ a_parent + S_i G_i ÿ
//! ```
//!
//! What is factorised is m×m for m independents, whatever the number of bodies. A body that carries
//! no other cluster stays rigid. An articulated inertia is kept as the blocks of n = J α + H a, f =
//! Hᵀ α + M a.

use crate::algorithms::cluster_columns::{ClusterJoint, component, transform_force};
use crate::algorithms::terms::add_rotors;
use crate::linalg::factorise_full;
use crate::mechanism::{Cluster, GBlock, Motion, Rotor};
use crate::model::{Model, Scope};
use crate::scalar::{Mask, Real, Symmetric, Triple};
use crate::spatial::triples::{cross, cross_add, cross_rows, dot, mul, mul_mat, scale_add, zero};
use crate::workspace::{Articulated, BodyState, Composite, Embedding, Force, Workspace};

/// Solves M_y ÿ = b; `ws.ydd` holds b and becomes ÿ. The scope has whatever stands on the world
/// together with what it needs. Needs the joint poses and G. The mask tells where every D was
/// positive.
pub(crate) fn embedded_solve<T: Real>(
    model: &Model<T::Const>,
    scope: &Scope,
    ws: &mut Workspace<T>,
) -> T::Mask {
    let Workspace { motion, G, composite, inside, embedding, ydd: b, alone, .. } = ws;
    let Embedding { bodies, Y, factor } = embedding;
    let mut positive = T::Mask::splat(true);

    // each body alone
    for run in scope.driven.runs() {
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

    // inertias and bias forces, towards the root
    let rotors = model.terms.rotors.as_slice();
    let mut pass = Pass { model, motion, G, composite, bodies, inside, rotors };
    for run in scope.clusters.runs().rev() {
        for cluster in model.clusters[run].iter().rev() {
            let (D, independents) = (cluster.g_offset, cluster.independents());
            let alone = &mut alone[independents.clone()];
            let (Y, b) = (&mut Y[independents.clone()], &mut b[independents]);
            let D = &mut factor[D..];
            let sound = match cluster.n_vy {
                1 if cluster.n_v == 1 => {
                    pass.single_joint(cluster, &mut Y[0], &mut D[0], &mut b[0])
                }
                1 => pass.several_joints::<1>(cluster, Y, D, b, alone),
                2 => pass.several_joints::<2>(cluster, Y, D, b, alone),
                3 => pass.several_joints::<3>(cluster, Y, D, b, alone),
                _ => pass.several_joints::<0>(cluster, Y, D, b, alone),
            };
            positive = positive & sound;
        }
    }

    // accelerations, from the root outwards
    (bodies[0].alpha, bodies[0].a) = (zero::<T>(), zero::<T>());
    for run in scope.clusters.runs() {
        for cluster in &model.clusters[run] {
            let (Y, b) = (&Y[cluster.independents()], &mut b[cluster.independents()]);
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
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    (motion, bodies): (&[BodyState<T>], &mut [Articulated<T>]),
    (Y, inverse): (&Force<T>, T),
    b: &mut [T],
) {
    let i = cluster.body;
    let (mut alpha, mut a) = bodies[cluster.parent].acceleration_in(&motion[i]);
    b[0] = (b[0] - dot::<T>(&Y.0, &alpha) - dot::<T>(&Y.1, &a)) * inverse;
    accelerate::<T>(model.bodies[i].motion, b, &mut alpha, &mut a);
    (bodies[i].alpha, bodies[i].a) = (alpha, a);
}

/// The same of joints closed by loops, or one of several degrees of freedom:
/// ÿ = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p), and a_i of the bodies that carry others.
#[inline(always)]
fn accelerate_joints<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    G: &[T],
    (motion, bodies): (&[BodyState<T>], &mut [Articulated<T>]),
    (Y, factor): (&[Force<T>], &[T]),
    b: &mut [T],
) {
    let m = cluster.n_vy;
    let (p, L) = (&bodies[cluster.parent], &factor[..m * m]);
    for k in (0..m).rev() {
        let (n, f) = &Y[k];
        let felt = (dot::<T>(n, &p.alpha), dot::<T>(f, &p.a));
        let mut ydd = (b[k] - felt.0 - felt.1) * L[k * m + k];
        for l in k + 1..m {
            ydd = (-L[l * m + k]).mul_add(b[l], ydd);
        }
        b[k] = ydd;
    }
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
    model: &'a Model<T::Const>,
    motion: &'a [BodyState<T>],
    G: &'a [T],
    composite: &'a mut [Composite<T>],
    bodies: &'a mut [Articulated<T>],
    /// Scratch for n_vy columns of each body of a cluster.
    inside: &'a mut [Force<T>],
    /// Rotors of the clusters that are still to come.
    rotors: &'a [Rotor<T::Const>],
}

impl<T: Real> Pass<'_, T> {
    /// One free degree of freedom: I − U Uᵀ / D goes to the parent, U stays at the body.
    #[inline]
    fn single_joint(
        &mut self,
        cluster: &Cluster<T::Const>,
        Y: &mut Force<T>,
        inverse: &mut T,
        b: &mut T,
    ) -> T::Mask {
        let i = cluster.body;
        let joint = self.model.bodies[i].motion;
        let (before, articulated) = self.bodies.split_at_mut(i);
        let articulated = &mut articulated[0];
        if !self.model.has_child_cluster[i] {
            *articulated = Articulated::none();
        }
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
        cluster: &Cluster<T::Const>,
        Y: &mut [Force<T>],
        D: &mut [T],
        b: &mut [T],
        alone: &mut [T],
    ) -> T::Mask {
        let m = if M > 0 { M } else { cluster.n_vy };
        let (model, motion, G) =
            (self.model, self.motion, GBlock::new(&self.G[cluster.block()], m));
        let (Y, D, b) = (&mut Y[..m], &mut D[..m * m], &mut b[..m]);
        let (composite, bodies) = (&mut *self.composite, &mut *self.bodies);
        // what each body supports, and r
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
        let (of_bodies, rigid) = (&bodies[cluster.body..], &composite[cluster.body..]);
        let column = |i: usize, joint, k| {
            if model.has_child_cluster[cluster.body + i] {
                of_bodies[i].column(joint, k)
            } else {
                rigid[i].column(joint, k)
            }
        };
        ClusterJoint { model, cluster, G, motion }.columns::<M>(column, self.inside, Y, D, alone);
        add_rotors::<T>(&mut self.rotors, (cluster.v, cluster.n_v), G, D, m);

        // L and Δ, L⁻¹ r, Y = L⁻¹ Uᵀ, and what the parent feels of them
        let positive = factorise_full(D, m);
        for k in 0..m {
            for l in 0..k {
                let x = -D[k * m + l];
                b[k] = x.mul_add(b[l], b[k]);
                let (n, f) = Y[l];
                Y[k] = (scale_add::<T>(&n, x, &Y[k].0), scale_add::<T>(&f, x, &Y[k].1));
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
        let (h, o) = (of.h, T::ZERO);
        let h = T::Triple::columns([o, h[2], -h[1], -h[2], o, h[0], h[1], -h[0], o]);
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
        let (n_d, f_d) = (n.times(by), f.times(by));
        self.J.add_product(n, &n_d);
        self.M.add_product(f, &f_d);
        for (j, x) in self.H.iter_mut().enumerate() {
            *x = n.fused(T::Triple::splat(f_d[j]), *x);
        }
        self.n = scale_add::<T>(&n_d, -r, &self.n);
        self.f = scale_add::<T>(&f_d, -r, &self.f);
    }

    /// Adds inertia and bias force to the parent's: M' = R M Rᵀ, H' = R H Rᵀ + [p]× M', J' = R J Rᵀ
    /// + [p]× H'ᵀ + ([p]× (R H Rᵀ)ᵀ)ᵀ.
    #[inline(always)]
    fn add_to_parent(&self, x: &BodyState<T>, parent: &mut Articulated<T>) {
        let (R, p) = (&x.R, &x.p);
        let (mut J, M) = (self.J.turned(R), self.M.turned(R));
        let H = mul_mat::<T>(&mul_mat::<T>(R, &self.H), &T::Triple::transposed(R));
        let mut shifted = H;
        for (k, x) in shifted.iter_mut().enumerate() {
            *x += cross::<T>(p, &M.column(k));
        }
        // the two products
        let (a, b) = (T::Triple::transposed(&cross_rows::<T>(p, &shifted)), cross_rows::<T>(p, &H));
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
        let a = cross_add::<T>(&self.alpha, &x.p, &self.a);
        (mul::<T>(&rows, &self.alpha), mul::<T>(&rows, &a))
    }
}
