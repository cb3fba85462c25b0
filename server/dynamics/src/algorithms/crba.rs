//! The reduced mass matrix M_y = Gᵀ M G by composite rigid bodies over clusters [F08, 6.2, with
//! the columns of a cluster joined by its G before they are carried to the root, so that ancestors
//! meet n_vy columns and not n_v].

use crate::algorithms::cluster_columns::{Force, carry_force, component, join};
use crate::algorithms::terms::add_rotors;
use crate::mechanism::Rotor;
use crate::model::{Cluster, Model};
use crate::scalar::Real;
use crate::workspace::{BodyState, Composite};

/// M_y, packed by `model.branches`. Needs the joint poses and G. `columns` is scratch for the
/// widest cluster, `inside` for n_vy columns of each body of a cluster, `block` for a block n_vy ×
/// n_vy.
pub(crate) fn reduced_mass_matrix<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    composite: &mut [Composite<T>],
    columns: &mut [Force<T>],
    inside: &mut [Force<T>],
    block: &mut [T],
    M_y: &mut [T],
) {
    M_y[..model.branches.len].fill(T::ZERO);

    // composite inertias, towards the root
    composite_inertias(model, motion, composite);

    let mut rotors = model.terms.rotors.as_slice();
    for cluster in model.clusters.iter().rev() {
        let m = cluster.n_vy;
        let of_cluster = &G[cluster.g..cluster.g + cluster.n_v * m];
        own_block(
            model,
            cluster,
            motion,
            of_cluster,
            composite,
            inside,
            columns,
            &mut rotors,
            block,
        );
        for k in 0..m {
            let last = model.branches.start[cluster.vy + k] + model.branches.depth[cluster.vy + k];
            M_y[last - k..=last].copy_from_slice(&block[k * m..=k * m + k]);
        }
        // blocks with the clusters that carry it
        carry_to_root(model, cluster, motion, G, &mut columns[..m], M_y);
    }
}

/// The diagonal of M_y, in internal order, at a cost linear in the number of bodies. Needs the
/// joint poses and G. Allocates.
pub(crate) fn own_inertias<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    composite: &mut [Composite<T>],
    inside: &mut [Force<T>],
    columns: &mut [Force<T>],
) -> Vec<T> {
    composite_inertias(model, motion, composite);
    let mut rotors = model.terms.rotors.as_slice();
    let mut diagonal = vec![T::ZERO; model.meta.sizes.n_vy];
    let mut block = Vec::new();
    for cluster in model.clusters.iter().rev() {
        let m = cluster.n_vy;
        block.resize(m * m, T::ZERO);
        let of_cluster = &G[cluster.g..cluster.g + cluster.n_v * m];
        own_block(
            model,
            cluster,
            motion,
            of_cluster,
            composite,
            inside,
            columns,
            &mut rotors,
            &mut block,
        );
        (0..m).for_each(|k| diagonal[cluster.vy + k] = block[k * m + k]);
    }
    diagonal
}

/// Block of a cluster with itself; its columns leave at the parent body.
#[inline]
fn own_block<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    composite: &[Composite<T>],
    inside: &mut [Force<T>],
    columns: &mut [Force<T>],
    rotors: &mut &[Rotor<T::Const>],
    block: &mut [T],
) {
    let m = cluster.n_vy;
    if cluster.n == 1 && m == cluster.n_v {
        single_body(model, cluster, motion, &composite[cluster.body], columns, block);
    } else {
        let carried = &composite[cluster.body..];
        join(
            model,
            cluster,
            G,
            motion,
            |i, joint, k| carried[i].column(joint, k),
            inside,
            columns,
            block,
        );
    }
    add_rotors::<T>(rotors, cluster.v, G, block, m);
}

/// What each body carries, as if rigid.
#[inline]
pub(super) fn composite_inertias<T: Real>(
    model: &Model<T::Const>,
    motion: &[BodyState<T>],
    composite: &mut [Composite<T>],
) {
    for (of_body, body) in composite.iter_mut().zip(&model.bodies).skip(1) {
        *of_body = Composite::of(body);
    }
    for i in (1..model.bodies.len()).rev() {
        let parent = model.bodies[i].parent;
        if parent != 0 {
            let moved = composite[i].carried(&motion[i]);
            composite[parent].add(&moved);
        }
    }
}

/// One joint of one, three or six freedoms: G is the identity.
#[inline]
fn single_body<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    composite: &Composite<T>,
    columns: &mut [Force<T>],
    block: &mut [T],
) {
    let (joint, m) = (model.bodies[cluster.body].motion, cluster.n_v);
    for k in 0..m {
        let force = composite.column(joint, k);
        for j in 0..=k {
            block[k * m + j] = component(joint, j, &force);
        }
        columns[k] =
            if cluster.parent == 0 { force } else { carry_force(&force, &motion[cluster.body]) };
    }
}

/// Meets the columns of a cluster with the joints on the way to the root.
#[inline]
fn carry_to_root<T: Real>(
    model: &Model<T::Const>,
    cluster: &Cluster<T::Const>,
    motion: &[BodyState<T>],
    G: &[T],
    columns: &mut [Force<T>],
    M_y: &mut [T],
) {
    let branches = &model.branches;
    let mut at = cluster.parent;
    while at != 0 {
        let carrier = &model.clusters[model.cluster_of[at]];
        let m = carrier.n_vy;
        let first = branches.depth.get(carrier.vy).copied().unwrap_or(0);
        while at != carrier.parent {
            let body = &model.bodies[at];
            let G_i = &G[carrier.g + (body.v - carrier.v) * m..][..body.motion.n_v() * m];
            for (k, column) in columns.iter_mut().enumerate() {
                let row = &mut M_y[branches.start[cluster.vy + k] + first..][..m];
                for d in 0..body.motion.n_v() {
                    let force = component(body.motion, d, column);
                    for (entry, g) in row.iter_mut().zip(&G_i[d * m..][..m]) {
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
