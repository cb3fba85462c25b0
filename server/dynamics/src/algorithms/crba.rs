//! The reduced mass matrix M_y = Gᵀ M G by composite rigid bodies over clusters [F08, 6.2, with the
//! columns of a cluster joined by its G before they are transformed to the root, so that ancestors
//! process n_vy columns instead of n_v].

use crate::algorithms::cluster_columns::{ClusterJoint, component, transform_force};
use crate::algorithms::terms::add_rotors;
use crate::linalg::{factorise_tree, solve_tree};
use crate::mechanism::{Cluster, Rotor};
use crate::model::{Model, Scope};
use crate::scalar::Real;
use crate::workspace::{BodyState, Composite, Force, Workspace};

/// Writes the rows of M_y of the scope's clusters and all clusters that they carry to the
/// workspace, packed by `model.sparsity`; zero elsewhere. Needs the joint poses and G.
pub(crate) fn reduced_mass_matrix<T: Real>(model: &Model<T>, scope: &Scope, ws: &mut Workspace<T>) {
    let Workspace { motion, G, composite, columns, inside, block, M_y, uncoupled_diagonal, .. } =
        ws;
    M_y[..model.sparsity.len].fill(T::ZERO);

    // I_i ← I_i + Σ_children X I_j Xᵀ, towards the root
    composite_inertias(model, scope, motion, composite);

    let rotors = model.terms.rotors.as_slice();
    let mut pass = Pass { model, motion, G, composite, columns, inside, rotors };
    for run in scope.clusters.runs().rev() {
        for cluster in model.clusters[run].iter().rev() {
            let m = cluster.n_vy;
            pass.own_block(cluster, block, &mut uncoupled_diagonal[cluster.independents()]);
            for k in 0..m {
                let last = model.sparsity.diagonal_at(cluster.vy + k);
                M_y[last - k..=last].copy_from_slice(&block[k * m..=k * m + k]);
            }
            // M_y of the cluster and its ancestors: G_aᵀ S_aᵀ X F
            pass.meet_ancestors(cluster, M_y);
        }
    }
}

/// Solves M_y ÿ = b with the M_y of the workspace; `ws.ydd` holds b and becomes ÿ. The scope has
/// the needed clusters and all others between them and the world. True if every pivot is positive.
pub(crate) fn projected_solve<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
) -> bool {
    ws.factor.copy_from_slice(&ws.M_y);
    // unneeded rows become identity rows
    if scope.clusters.count() < model.clusters.len() {
        let mut needed = scope.independents.indices().peekable();
        for (k, at) in model.sparsity.diagonal().enumerate() {
            if needed.next_if(|next| *next == k).is_none() {
                (ws.factor[at], ws.ydd[k]) = (T::ONE, T::ZERO);
            }
        }
    }
    // M_y = Lᵀ D L,  ÿ = L⁻¹ D⁻¹ L⁻ᵀ b
    let positive = factorise_tree(&model.sparsity, &mut ws.factor);
    solve_tree(&model.sparsity, &ws.factor, &mut ws.ydd);
    positive
}

/// The diagonal of M_y, in internal order, at a cost linear in the number of bodies. Needs the
/// joint poses and G. Allocates.
pub(crate) fn own_inertias<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    ws: &mut Workspace<T>,
) -> Vec<T> {
    let Workspace { motion, G, composite, columns, inside, uncoupled_diagonal, .. } = ws;
    composite_inertias(model, scope, motion, composite);
    let rotors = model.terms.rotors.as_slice();
    let mut pass = Pass { model, motion, G, composite, columns, inside, rotors };
    let mut diagonal = vec![T::ZERO; model.meta.sizes.n_vy];
    let mut block = Vec::new();
    for cluster in model.clusters.iter().rev() {
        let m = cluster.n_vy;
        block.resize(m * m, T::ZERO);
        pass.own_block(cluster, &mut block, &mut uncoupled_diagonal[cluster.independents()]);
        (0..m).for_each(|k| diagonal[cluster.vy + k] = block[k * m + k]);
    }
    diagonal
}

/// Composite inertia of each affected body: its own and those of all bodies that it carries.
#[inline]
pub(super) fn composite_inertias<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    motion: &[BodyState<T>],
    composite: &mut [Composite<T>],
) {
    for run in scope.ancestors.runs().chain(scope.affected.runs()) {
        for (of_body, body) in composite[run.clone()].iter_mut().zip(&model.bodies[run]) {
            *of_body = Composite::of(body);
        }
    }
    for run in scope.affected.runs().rev() {
        let mut composite = &mut composite[..run.end];
        for (body, state) in model.bodies[run.clone()].iter().zip(&motion[run]).rev() {
            let Some((of_body, before)) = composite.split_last_mut() else { return };
            if body.parent != 0 {
                before[body.parent].add(&of_body.transformed(state));
            }
            composite = before;
        }
    }
}

/// One pass over the clusters from the leaves to the root, with the numbers of the workspace.
struct Pass<'a, T: Real> {
    model: &'a Model<T>,
    motion: &'a [BodyState<T>],
    G: &'a [T],
    composite: &'a [Composite<T>],
    /// Force columns of the cluster in hand, and those of each of its bodies.
    columns: &'a mut [Force<T>],
    inside: &'a mut [Force<T>],
    /// Rotors of the clusters that are still to come.
    rotors: &'a [Rotor<T>],
}

impl<T: Real> Pass<'_, T> {
    /// Block of a cluster with itself; its columns leave at the parent body.
    #[inline]
    fn own_block(&mut self, cluster: &Cluster<T>, block: &mut [T], uncoupled_diagonal: &mut [T]) {
        let m = cluster.n_vy;
        let G = cluster.G(self.G);
        if cluster.n == 1 && m == cluster.n_v {
            uncoupled_diagonal.fill(T::ZERO);
            self.single_body(cluster, block);
        } else {
            let composite = &self.composite[cluster.body..];
            let joint = ClusterJoint { model: self.model, cluster, G, motion: self.motion };
            let column = |i: usize, motion, k| composite[i].column(motion, k);
            let inside = &mut *self.inside;
            let columns = &mut *self.columns;
            match m {
                1 => joint.columns::<1>(column, inside, columns, block, uncoupled_diagonal),
                2 => joint.columns::<2>(column, inside, columns, block, uncoupled_diagonal),
                3 => joint.columns::<3>(column, inside, columns, block, uncoupled_diagonal),
                _ => joint.columns::<0>(column, inside, columns, block, uncoupled_diagonal),
            }
        }
        add_rotors::<T>(&mut self.rotors, (cluster.v, cluster.n_v), G, block, m);
    }

    /// One joint of one, three or six degrees of freedom: G is the identity.
    #[inline]
    fn single_body(&mut self, cluster: &Cluster<T>, block: &mut [T]) {
        let joint = self.model.bodies[cluster.body].motion;
        let m = cluster.n_v;
        for k in 0..m {
            let force = self.composite[cluster.body].column(joint, k);
            for j in 0..=k {
                block[k * m + j] = component(joint, j, &force);
            }
            self.columns[k] = if cluster.parent == 0 {
                force
            } else {
                transform_force(&force, &self.motion[cluster.body])
            };
        }
    }

    /// Meets the columns of a cluster with the joints towards the root.
    #[inline]
    fn meet_ancestors(&mut self, cluster: &Cluster<T>, M_y: &mut [T]) {
        let model = self.model;
        let motion = self.motion;
        let sparsity = &self.model.sparsity;
        let blocks = self.G;
        let columns = &mut self.columns[..cluster.n_vy];
        let mut at = cluster.parent;
        while at != 0 {
            let ancestor = &model.clusters[model.cluster_of[at]];
            let m = ancestor.n_vy;
            let G = ancestor.G(blocks);
            let first = sparsity.depth.get(ancestor.vy).copied().unwrap_or(0);
            while at != ancestor.parent {
                let body = &model.bodies[at];
                let G_i = G.rows(body.v - ancestor.v, body.motion.n_v());
                for (k, column) in columns.iter_mut().enumerate() {
                    let row = &mut M_y[sparsity.start[cluster.vy + k] + first..][..m];
                    for d in 0..body.motion.n_v() {
                        let force: T = component(body.motion, d, column);
                        for (entry, g) in row.iter_mut().zip(&G_i[d * m..][..m]) {
                            *entry = force.mul_add(*g, *entry);
                        }
                    }
                    if body.parent != 0 {
                        *column = transform_force(column, &motion[at]);
                    }
                }
                at = body.parent;
            }
        }
    }
}
