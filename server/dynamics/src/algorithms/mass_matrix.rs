//! The mass matrix M of the tree by composite rigid bodies [F08, 6.2, table 6.2]: no loop, no
//! G.

use crate::algorithms::cluster_columns::{component, transform_force};
use crate::algorithms::crba::composite_inertias;
use crate::model::{Model, Scope};
use crate::scalar::Real;
use crate::workspace::{BodyState, Composite};

/// Writes M (n_v × n_v row-major, internal order, both triangles) to rows of length `stride`. Needs
/// the joint poses.
pub(crate) fn tree_mass_matrix<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    motion: &[BodyState<T>],
    composite: &mut [Composite<T>],
    M: &mut [T],
    stride: usize,
) {
    // composite inertias, towards the root
    composite_inertias(model, scope, motion, composite);

    // each column from its own body to the root
    for i in 1..model.bodies.len() {
        let body = &model.bodies[i];
        for k in 0..body.motion.n_v() {
            let v = body.v + k;
            let mut force = composite[i].column(body.motion, k);
            let mut at = i;
            while at != 0 {
                let ancestor = &model.bodies[at];
                for d in 0..ancestor.motion.n_v() {
                    let entry = component(ancestor.motion, d, &force);
                    M[v * stride + ancestor.v + d] = entry;
                    M[(ancestor.v + d) * stride + v] = entry;
                }
                force = transform_force(&force, &motion[at]);
                at = ancestor.parent;
            }
        }
    }

    // rotors turn with their joints alone
    for rotor in &model.terms.rotors {
        M[rotor.v * stride + rotor.v] += rotor.inertia;
    }
}
