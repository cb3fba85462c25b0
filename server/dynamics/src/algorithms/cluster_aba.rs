//! Articulated bodies over clusters: M_y ÿ = b in O(n) by constraint embedding [J12; K21, eq. 5.4
//! to 5.8; a single joint is F08, 7.3].
//!
//! The velocity and gravity terms are taken out first by Newton-Euler at q̈ = g, so that only M_y ÿ
//! = b is left. Each cluster is one joint with the independents ÿ, the columns U and the matrix D
//! of [`super::cluster_columns`], where the inertias that its bodies carry are articulated:
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

use nalgebra::{Matrix3, Vector3};

use crate::algorithms::cluster_columns::{Force, carry_force, component, join};
use crate::algorithms::terms::add_rotors;
use crate::linalg::factorise_full;
use crate::mechanism::{Motion, Rotor};
use crate::model::{Cluster, Model};
use crate::scalar::{Mask, Real, Scalar};
use crate::spatial::{cross, cross_add, dot, mul, mul_mat, scale_add, t_mul, zero};
use crate::workspace::{BodyState, Composite, Workspace};

/// Articulated inertia, bias force and acceleration of a body that carries clusters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Articulated<T> {
    /// xx xy xz yy yz zz of J and M.
    J: [T; 6],
    H: Matrix3<T>,
    M: [T; 6],
    /// Bias force p.
    n: Vector3<T>,
    f: Vector3<T>,
    /// Acceleration: angular, linear.
    alpha: Vector3<T>,
    a: Vector3<T>,
}

/// Scratch of the recursion.
#[derive(Clone, Debug)]
pub(crate) struct Embedding<T> {
    bodies: Vec<Articulated<T>>,
    /// Y, a column for each independent: of one joint at its body, else at the cluster's parent.
    Y: Vec<Force<T>>,
    /// L and 1/Δ of each cluster, in the place of its G block.
    factor: Vec<T>,
}

impl<T: Real> Embedding<T> {
    pub(crate) fn new(model: &Model<T::Const>) -> Embedding<T> {
        let bodies = vec![Articulated::none(); model.bodies.len()];
        Embedding {
            bodies,
            Y: vec![(zero(), zero()); model.meta.sizes.n_vy],
            factor: vec![T::ZERO; model.n_g],
        }
    }

    /// 1/Δ of each independent after [`embedded_solve`], in internal order.
    pub(crate) fn inverses<'a, C>(&'a self, model: &'a Model<C>) -> impl Iterator<Item = T> + 'a {
        model.clusters.iter().flat_map(|cluster| {
            (0..cluster.n_vy).map(|k| self.factor[cluster.g + k * cluster.n_vy + k])
        })
    }
}

/// Solves M_y ÿ = b; `b` becomes ÿ. Needs the joint poses and G; `inside` is scratch for n_vy
/// columns of each body of a cluster. The mask tells where every D was positive.
pub(crate) fn embedded_solve<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    composite: &mut [Composite<T>],
    inside: &mut [Force<T>],
    scratch: &mut Embedding<T>,
    b: &mut [T],
) -> T::Mask {
    let Embedding { bodies, Y, factor } = scratch;
    let mut positive = T::Mask::splat(true);

    // each body alone
    for (i, body) in model.bodies.iter().enumerate().skip(1) {
        composite[i] = Composite::of(body);
        if model.carries[i] {
            bodies[i] = Articulated::none();
        }
    }

    // inertias and bias forces, towards the root
    let mut rotors = model.terms.rotors.as_slice();
    for cluster in model.clusters.iter().rev() {
        let (vy, g, m) = (cluster.vy, cluster.g, cluster.n_vy);
        let (Y, b) = (&mut Y[vy..vy + m], &mut b[vy..vy + m]);
        let sound = if cluster.n_v == 1 && m == 1 {
            single_joint(
                model,
                cluster,
                motion,
                &mut rotors,
                composite,
                bodies,
                &mut Y[0],
                &mut factor[g],
                &mut b[0],
            )
        } else {
            let of_cluster = &G[g..g + cluster.n_v * m];
            several_joints(
                model,
                cluster,
                motion,
                of_cluster,
                &mut rotors,
                composite,
                bodies,
                inside,
                Y,
                &mut factor[g..],
                b,
            )
        };
        positive = positive & sound;
    }

    // accelerations, from the root outwards
    (bodies[0].alpha, bodies[0].a) = (zero(), zero());
    for cluster in &model.clusters {
        let (vy, g, m) = (cluster.vy, cluster.g, cluster.n_vy);
        let (Y, b) = (&Y[vy..vy + m], &mut b[vy..vy + m]);
        if cluster.n_v == 1 && m == 1 {
            let i = cluster.body;
            let (mut alpha, mut a) = bodies[cluster.parent].acceleration_in(&motion[i]);
            b[0] = (b[0] - dot(&Y[0].0, &alpha) - dot(&Y[0].1, &a)) * factor[g];
            accelerate(model.bodies[i].motion, b, &mut alpha, &mut a);
            (bodies[i].alpha, bodies[i].a) = (alpha, a);
            continue;
        }
        // ÿ = L⁻ᵀ Δ⁻¹ (L⁻¹ r − Y a_p)
        let p = &bodies[cluster.parent];
        let L = &factor[g..g + m * m];
        for k in (0..m).rev() {
            let mut ydd = (b[k] - dot(&Y[k].0, &p.alpha) - dot(&Y[k].1, &p.a)) * L[k * m + k];
            for l in k + 1..m {
                ydd = (-L[l * m + k]).mul_add(b[l], ydd);
            }
            b[k] = ydd;
        }
        for i in cluster.body..cluster.body + cluster.n {
            if !model.carries[i] {
                continue;
            }
            let body = &model.bodies[i];
            let (mut alpha, mut a) = bodies[body.parent].acceleration_in(&motion[i]);
            let mut qdd = [T::ZERO; 6];
            for k in 0..body.motion.n_v() {
                let G_i = &G[g + (body.v - cluster.v + k) * m..][..m];
                qdd[k] =
                    G_i.iter().zip(b.iter()).fold(T::ZERO, |sum, (g, ydd)| g.mul_add(*ydd, sum));
            }
            accelerate(body.motion, &qdd, &mut alpha, &mut a);
            (bodies[i].alpha, bodies[i].a) = (alpha, a);
        }
    }
    positive
}

/// What the recursion divides by at each independent, in internal order: the inertia that is left
/// of it where everything behind it is free. Needs the joint poses and G. Allocates.
pub(crate) fn pivots<T: Scalar>(model: &Model<T>, ws: &mut Workspace<T>) -> Vec<T> {
    let mut b = vec![T::ZERO; model.meta.sizes.n_vy];
    let Workspace { motion, G, composite, inside, embedding, .. } = ws;
    embedded_solve(model, motion, G, composite, inside, embedding, &mut b);
    embedding.inverses(model).map(|inverse| T::ONE / inverse).collect()
}

/// One freedom that nothing ties: I − U Uᵀ / D goes to the parent, U stays at the body.
#[inline]
fn single_joint<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    rotors: &mut &[Rotor<T::Const>],
    composite: &[Composite<T>],
    bodies: &mut [Articulated<T>],
    Y: &mut Force<T>,
    inverse: &mut T,
    b: &mut T,
) -> T::Mask {
    let i = cluster.body;
    let joint = model.bodies[i].motion;
    let (before, carried) = bodies.split_at_mut(i);
    let carried = &mut carried[0];
    if !model.carries[i] {
        *carried = Articulated::none();
    }
    carried.add_rigid(&composite[i]);
    let U = carried.column(joint, 0);
    let mut d = [component(joint, 0, &U)];
    add_rotors::<T>(rotors, cluster.v, &[T::ONE], &mut d, 1);
    *inverse = T::ONE / d[0];
    *b -= component(joint, 0, &(carried.n, carried.f));
    if cluster.parent != 0 {
        carried.take_out(&U, *inverse, *b);
        carried.carry(&motion[i], &mut before[cluster.parent]);
    }
    *Y = U;
    T::ZERO.lt(d[0])
}

/// Joints tied by loops, or one of several freedoms: U and Y at the parent body.
#[inline]
fn several_joints<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    rotors: &mut &[Rotor<T::Const>],
    composite: &mut [Composite<T>],
    bodies: &mut [Articulated<T>],
    inside: &mut [Force<T>],
    Y: &mut [Force<T>],
    D: &mut [T],
    b: &mut [T],
) -> T::Mask {
    let m = cluster.n_vy;
    // what each body carries, and r
    for i in (cluster.body..cluster.body + cluster.n).rev() {
        let body = &model.bodies[i];
        if !model.carries[i] {
            if body.parent != 0 {
                let moved = composite[i].carried(&motion[i]);
                composite[body.parent].add(&moved);
            }
            continue;
        }
        let (before, carried) = bodies.split_at_mut(i);
        let carried = &mut carried[0];
        carried.add_rigid(&composite[i]);
        for k in 0..body.motion.n_v() {
            let p = component(body.motion, k, &(carried.n, carried.f));
            for (r, g) in b.iter_mut().zip(&G[(body.v - cluster.v + k) * m..]) {
                *r = (-*g).mul_add(p, *r);
            }
        }
        if body.parent != 0 {
            carried.carry(&motion[i], &mut before[body.parent]);
        }
    }

    // D and U
    let (of_bodies, rigid) = (&bodies[cluster.body..], &composite[cluster.body..]);
    let column = |i: usize, joint, k| {
        if model.carries[cluster.body + i] {
            of_bodies[i].column(joint, k)
        } else {
            rigid[i].column(joint, k)
        }
    };
    join(model, cluster, G, motion, column, inside, Y, D);
    add_rotors::<T>(rotors, cluster.v, G, D, m);

    // L and Δ, L⁻¹ r, Y = L⁻¹ Uᵀ, and what the parent feels of them
    let positive = factorise_full(D, m);
    for k in 0..m {
        for l in 0..k {
            let x = -D[k * m + l];
            b[k] = x.mul_add(b[l], b[k]);
            let (n, f) = Y[l];
            Y[k] = (scale_add(&n, x, &Y[k].0), scale_add(&f, x, &Y[k].1));
        }
        if cluster.parent != 0 {
            bodies[cluster.parent].take_out(&Y[k], D[k * m + k], b[k]);
        }
    }
    positive
}

/// Adds the joint's own acceleration.
#[inline(always)]
fn accelerate<T: Real>(joint: Motion, qdd: &[T], alpha: &mut Vector3<T>, a: &mut Vector3<T>) {
    match joint {
        Motion::Revolute => alpha[2] += qdd[0],
        Motion::Prismatic => a[2] += qdd[0],
        Motion::Spherical => *alpha += Vector3::new(qdd[0], qdd[1], qdd[2]),
        Motion::Floating => {
            *alpha += Vector3::new(qdd[0], qdd[1], qdd[2]);
            *a += Vector3::new(qdd[3], qdd[4], qdd[5]);
        }
    }
}

impl<T: Real> Articulated<T> {
    #[inline(always)]
    fn none() -> Articulated<T> {
        let none = [T::ZERO; 6];
        Articulated {
            J: none,
            H: Matrix3::from_element(T::ZERO),
            M: none,
            n: zero(),
            f: zero(),
            alpha: zero(),
            a: zero(),
        }
    }

    /// Adds a rigid inertia.
    #[inline(always)]
    fn add_rigid(&mut self, of: &Composite<T>) {
        for (entry, x) in self.J.iter_mut().zip(of.inertia) {
            *entry += x;
        }
        let (h, o) = (of.h, T::ZERO);
        self.H += Matrix3::new(o, -h[2], h[1], h[2], o, -h[0], -h[1], h[0], o);
        for k in [0, 3, 5] {
            self.M[k] += of.mass;
        }
    }

    /// I s for freedom k of a joint.
    #[inline(always)]
    fn column(&self, joint: Motion, k: usize) -> Force<T> {
        let H = &self.H;
        let turn = |k: usize| {
            (symmetric_column(&self.J, k), Vector3::new(H[(k, 0)], H[(k, 1)], H[(k, 2)]))
        };
        let slide = |k: usize| {
            (Vector3::new(H[(0, k)], H[(1, k)], H[(2, k)]), symmetric_column(&self.M, k))
        };
        match joint {
            Motion::Revolute => turn(2),
            Motion::Prismatic => slide(2),
            Motion::Spherical | Motion::Floating if k < 3 => turn(k),
            Motion::Spherical | Motion::Floating => slide(k - 3),
        }
    }

    /// I − y yᵀ / d and p + y r / d.
    #[inline(always)]
    fn take_out(&mut self, (n, f): &Force<T>, inverse: T, r: T) {
        let (n_d, f_d) = (n * -inverse, f * -inverse);
        for (k, (i, j)) in SYMMETRIC.into_iter().enumerate() {
            self.J[k] = n[i].mul_add(n_d[j], self.J[k]);
            self.M[k] = f[i].mul_add(f_d[j], self.M[k]);
        }
        for j in 0..3 {
            for i in 0..3 {
                self.H[(i, j)] = n[i].mul_add(f_d[j], self.H[(i, j)]);
            }
        }
        (self.n, self.f) = (scale_add(&n_d, -r, &self.n), scale_add(&f_d, -r, &self.f));
    }

    /// Adds inertia and bias force to the parent's: M' = R M Rᵀ, H' = R H Rᵀ + [p]× M', J' = R J Rᵀ
    /// + [p]× H'ᵀ + ([p]× (R H Rᵀ)ᵀ)ᵀ.
    #[inline(always)]
    fn carry(&self, x: &BodyState<T>, parent: &mut Articulated<T>) {
        let (R, p) = (&x.R, &x.p);
        let (J, M) = (turned(R, &self.J), turned(R, &self.M));
        let H = mul_mat(&mul_mat(R, &self.H), &R.transpose());
        let row = |A: &Matrix3<T>, i: usize| Vector3::new(A[(i, 0)], A[(i, 1)], A[(i, 2)]);
        let across = |k: usize| cross(p, &symmetric_column(&M, k));
        let shifted = H + Matrix3::from_columns(&[across(0), across(1), across(2)]);
        // columns of the two products
        let (a0, a1, a2) =
            (cross(p, &row(&shifted, 0)), cross(p, &row(&shifted, 1)), cross(p, &row(&shifted, 2)));
        let (b0, b1, b2) = (cross(p, &row(&H, 0)), cross(p, &row(&H, 1)), cross(p, &row(&H, 2)));
        let both = [
            a0[0] + b0[0],
            a1[0] + b0[1],
            a2[0] + b0[2],
            a1[1] + b1[1],
            a2[1] + b1[2],
            a2[2] + b2[2],
        ];
        for k in 0..6 {
            parent.J[k] += J[k] + both[k];
            parent.M[k] += M[k];
        }
        parent.H += shifted;
        let (n, f) = carry_force(&(self.n, self.f), x);
        parent.n += n;
        parent.f += f;
    }

    /// The acceleration of this body where a child's origin is, in the child's axes.
    #[inline(always)]
    fn acceleration_in(&self, x: &BodyState<T>) -> (Vector3<T>, Vector3<T>) {
        (t_mul(&x.R, &self.alpha), t_mul(&x.R, &cross_add(&self.alpha, &x.p, &self.a)))
    }
}

/// Where xx xy xz yy yz zz stand.
const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Column k of xx xy xz yy yz zz.
#[inline(always)]
fn symmetric_column<T: Real>(A: &[T; 6], k: usize) -> Vector3<T> {
    let [xx, xy, xz, yy, yz, zz] = *A;
    match k {
        0 => Vector3::new(xx, xy, xz),
        1 => Vector3::new(xy, yy, yz),
        _ => Vector3::new(xz, yz, zz),
    }
}

/// R A Rᵀ of a symmetric matrix.
#[inline(always)]
fn turned<T: Real>(R: &Matrix3<T>, A: &[T; 6]) -> [T; 6] {
    let column = |k: usize| mul(R, &symmetric_column(A, k));
    let (x, y, z) = (column(0), column(1), column(2));
    let entry =
        |i: usize, j: usize| x[i].mul_add(R[(j, 0)], y[i].mul_add(R[(j, 1)], z[i] * R[(j, 2)]));
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}
