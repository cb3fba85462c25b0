//! The reduced mass matrix M_y = Gᵀ M G by composite rigid bodies over clusters (Featherstone 2008, section 6.2, with the columns of a
//! cluster joined by its G before they are carried to the root, so that ancestors meet n_vy columns and not n_v).

use nalgebra::Vector3;

use super::rnea::turn_by;
use crate::model::{Cluster, Model, Motion};
use crate::scalar::Real;
use crate::spatial::{cross_add, dot, lift, mul, zero};
use crate::workspace::{BodyState, Composite};

/// A moment and a force, in body axes at the body's origin.
type Force<T> = (Vector3<T>, Vector3<T>);

/// Lower triangle of M_y (n_vy × n_vy, row-major, internal order). Needs the joint poses and G. Entries between independents of which
/// neither carries the other are zero.
pub(crate) fn reduced_mass_matrix<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    composite: &mut [Composite<T>],
    columns: &mut [Force<T>],
    cluster_mass: &mut [T],
    M_y: &mut [T],
) {
    let n_vy = model.meta.sizes.n_vy;
    M_y[..n_vy * n_vy].fill(T::ZERO);

    // composite inertias, towards the root
    for (i, body) in model.bodies.iter().enumerate() {
        composite[i] = Composite { mass: T::lift(body.mass), h: lift(&body.h), inertia: body.inertia.map(T::lift) };
    }
    for i in (1..model.bodies.len()).rev() {
        let parent = model.bodies[i].parent;
        if parent != 0 {
            let moved = carry_inertia(&composite[i], &motion[i]);
            let of_parent = &mut composite[parent];
            of_parent.mass += moved.mass;
            of_parent.h += moved.h;
            for (a, b) in of_parent.inertia.iter_mut().zip(moved.inertia) {
                *a += b;
            }
        }
    }

    for cluster in model.clusters.iter().rev() {
        let of_cluster = &G[cluster.g..cluster.g + cluster.n_v * cluster.n_vy];
        // block of the cluster itself; its columns leave at the parent body
        if cluster.n == 1 {
            single_body(model, cluster, motion, &composite[cluster.body], columns, M_y);
        } else {
            several_bodies(model, cluster, of_cluster, motion, composite, columns, cluster_mass, M_y);
        }
        // blocks with the clusters that carry it
        let columns = &mut columns[..cluster.n_vy];
        let mut at = cluster.parent;
        while at != 0 {
            let carrier = &model.clusters[model.cluster_of[at]];
            let of_carrier = &G[carrier.g..carrier.g + carrier.n_v * carrier.n_vy];
            while at != carrier.parent {
                let body = &model.bodies[at];
                let dof = body.motion.n_v();
                for (k, column) in columns.iter_mut().enumerate() {
                    let row = &mut M_y[(cluster.vy + k) * n_vy + carrier.vy..][..carrier.n_vy];
                    for d in 0..dof {
                        let force = component(body.motion, d, column);
                        let of_joint = &of_carrier[(body.v - carrier.v + d) * carrier.n_vy..][..carrier.n_vy];
                        for (entry, g) in row.iter_mut().zip(of_joint) {
                            *entry = force.mul_add(*g, *entry);
                        }
                    }
                    if body.parent != 0 {
                        *column = carry_force(column, &motion[at]);
                    }
                }
                at = body.parent;
            }
        }
    }
}

/// One joint of one or six freedoms: G is the identity.
#[inline]
fn single_body<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    composite: &Composite<T>,
    columns: &mut [Force<T>],
    M_y: &mut [T],
) {
    let n_vy = model.meta.sizes.n_vy;
    let kind = model.bodies[cluster.body].motion;
    for k in 0..cluster.n_v {
        let force = unit_force(kind, k, composite);
        for j in 0..=k {
            M_y[(cluster.vy + k) * n_vy + cluster.vy + j] = component(kind, j, &force);
        }
        columns[k] = if cluster.parent == 0 { force } else { carry_force(&force, &motion[cluster.body]) };
    }
}

/// Joints tied by loops: Gᵀ M G of the cluster, and its force columns Σ F_j G_jk at the parent body.
#[inline]
fn several_bodies<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    G: &[T],
    motion: &[BodyState<T>],
    composite: &[Composite<T>],
    columns: &mut [Force<T>],
    mass: &mut [T],
    M_y: &mut [T],
) {
    let (n, m, n_vy) = (cluster.n_v, cluster.n_vy, model.meta.sizes.n_vy);
    mass[..n * n].fill(T::ZERO);
    columns[..m].fill((zero(), zero()));
    for j in (0..n).rev() {
        // column j of the tree's mass matrix, up to the parent body
        let at = &cluster.freedoms[j];
        let mut force = unit_force(at.motion, at.k, &composite[cluster.body + at.body]);
        let mut i = at.body;
        loop {
            let body = &model.bodies[cluster.body + i];
            for k in 0..body.motion.n_v() {
                let (x, v) = (component(body.motion, k, &force), body.v - cluster.v + k);
                mass[j * n + v] = x;
                mass[v * n + j] = x;
            }
            if cluster.parent != 0 || cluster.local_parent[i] != 0 {
                force = carry_force(&force, &motion[cluster.body + i]);
            }
            match cluster.local_parent[i] {
                0 => break,
                next => i = next - 1,
            }
        }
        for (k, column) in columns[..m].iter_mut().enumerate() {
            let g = G[j * m + k];
            for a in 0..3 {
                column.0[a] = force.0[a].mul_add(g, column.0[a]);
                column.1[a] = force.1[a].mul_add(g, column.1[a]);
            }
        }
    }
    for j in 0..n {
        for k in 0..m {
            let mut x = T::ZERO;
            for i in 0..n {
                x = mass[j * n + i].mul_add(G[i * m + k], x);
            }
            for l in k..m {
                let entry = &mut M_y[(cluster.vy + l) * n_vy + cluster.vy + k];
                *entry = x.mul_add(G[j * m + l], *entry);
            }
        }
    }
}

/// Force that a unit acceleration of freedom k of a joint takes.
#[inline(always)]
fn unit_force<T: Real>(motion: Motion, k: usize, composite: &Composite<T>) -> Force<T> {
    let Composite { mass, h, inertia } = composite;
    match (motion, k) {
        (Motion::Revolute, _) => (Vector3::new(inertia[2], inertia[4], inertia[5]), Vector3::new(-h[1], h[0], T::ZERO)),
        (Motion::Prismatic, _) => (Vector3::new(h[1], -h[0], T::ZERO), Vector3::new(T::ZERO, T::ZERO, *mass)),
        (Motion::Spherical | Motion::Floating, _) => {
            let axis = |i: usize| if k % 3 == i { T::ONE } else { T::ZERO };
            let e = Vector3::new(axis(0), axis(1), axis(2));
            if k < 3 { (turn_by(inertia, &e), cross_add(&e, h, &zero())) } else { (cross_add(h, &e, &zero()), e * *mass) }
        }
    }
}

/// Component of a force along freedom k of a joint.
#[inline(always)]
fn component<T: Real>(motion: Motion, k: usize, force: &Force<T>) -> T {
    match (motion, k) {
        (Motion::Revolute, _) => force.0[2],
        (Motion::Prismatic, _) => force.1[2],
        (Motion::Spherical, _) | (Motion::Floating, 0..3) => force.0[k],
        (Motion::Floating, _) => force.1[k - 3],
    }
}

/// The same force at the parent's origin in the parent's axes.
#[inline(always)]
fn carry_force<T: Real>(force: &Force<T>, state: &BodyState<T>) -> Force<T> {
    let f = mul(&state.R, &force.1);
    (cross_add(&state.p, &f, &mul(&state.R, &force.0)), f)
}

/// The same inertia about the parent's origin in the parent's axes:
/// I' = R I Rᵀ + 2 (h'·p) 1 − h' pᵀ − p h'ᵀ + m (p·p 1 − p pᵀ) with h' = R h.
#[inline(always)]
fn carry_inertia<T: Real>(composite: &Composite<T>, state: &BodyState<T>) -> Composite<T> {
    let (R, p) = (&state.R, &state.p);
    let [xx, xy, xz, yy, yz, zz] = composite.inertia;
    let rows = [Vector3::new(xx, xy, xz), Vector3::new(xy, yy, yz), Vector3::new(xz, yz, zz)];
    // A = R I, then entries of A Rᵀ
    let A = rows.map(|row| mul(R, &row));
    let entry = |i: usize, j: usize| A[0][i].mul_add(R[(j, 0)], A[1][i].mul_add(R[(j, 1)], A[2][i] * R[(j, 2)]));
    let h = mul(R, &composite.h);
    // b = h + m p / 2: the shift is 2 (b·p) 1 − b pᵀ − p bᵀ
    let b = Vector3::new(
        (composite.mass * p[0]).mul_add(T::from_f64(0.5), h[0]),
        (composite.mass * p[1]).mul_add(T::from_f64(0.5), h[1]),
        (composite.mass * p[2]).mul_add(T::from_f64(0.5), h[2]),
    );
    let trace = dot(&b, p) * T::from_f64(2.0);
    let shift = |i: usize, j: usize| -(b[i].mul_add(p[j], p[i] * b[j]));
    Composite {
        mass: composite.mass,
        h: Vector3::new(composite.mass.mul_add(p[0], h[0]), composite.mass.mul_add(p[1], h[1]), composite.mass.mul_add(p[2], h[2])),
        inertia: [
            entry(0, 0) + (trace + shift(0, 0)),
            entry(0, 1) + shift(0, 1),
            entry(0, 2) + shift(0, 2),
            entry(1, 1) + (trace + shift(1, 1)),
            entry(1, 2) + shift(1, 2),
            entry(2, 2) + (trace + shift(2, 2)),
        ],
    }
}
