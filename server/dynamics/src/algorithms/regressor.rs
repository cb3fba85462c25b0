//! Forces on the tree as a matrix times the parameters of its bodies and joints [KD02, 12.2; in
//! classical accelerations].
//!
//! A body with the parameters m, h = m c, I about the origin of its link's frame needs
//!
//! ```text
//!   f = m a + (α× + ω× ω×) h        n = −a× h + I α + ω × I ω
//! ```
//! which are linear in them: ten columns. Each goes to the root like a force, and every joint on
//! the way takes its part of it.

use nalgebra::{Matrix3, Vector3};

use crate::algorithms::cluster_columns::{component, transform_force};
use crate::algorithms::frames::accelerate_all;
use crate::mechanism::Friction;
use crate::model::Model;
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, zero};
use crate::workspace::BodyState;

/// A wrench [n; f] in body axes at the body's origin.
type Wrench<T> = (Vector3<T>, Vector3<T>);

/// Calls `each(internal velocity, first column, numbers)` for all numbers of Y_t. Needs
/// [`super::joint_poses`].
pub(crate) fn tree_regressor<T: Real>(
    model: &Model<T>,
    (qd, qdd): (&[T], &[T]),
    motion: &mut [BodyState<T>],
    mut each: impl FnMut(usize, usize, &[T]),
) {
    // the world accelerates against gravity
    let root = -T::Triple::of(&model.gravity);
    accelerate_all(model, root, 1..model.bodies.len(), (qd, qdd), motion);
    for (block, &(i, link)) in model.order.bodies.iter().enumerate() {
        let R = &model.frames[link].x_body_frame.R;
        let BodyState { w, alpha, a, .. } = motion[i];
        let seen = [w, alpha, a].map(|x| R.apply_transposed(x.vector()));
        let in_body = |x: Vector3<T>| T::Triple::of(&R.apply(x));
        let mut columns = body_regressor(seen).map(|(n, f)| (in_body(n), in_body(f)));
        let mut at = i;
        while at != 0 {
            let body = &model.bodies[at];
            for k in 0..body.motion.n_v() {
                let parts = columns.map(|column| component(body.motion, k, &column));
                each(body.v + k, 10 * block, &parts);
            }
            columns = columns.map(|column| transform_force(&column, &motion[at]));
            at = body.parent;
        }
    }
    let n_v = model.sizes().n_v;
    let rotors = 10 * model.order.bodies.len();
    for (v, external) in model.order.v_external.iter().enumerate() {
        let friction = model.terms.frictions.iter().find(|friction| friction.v == v);
        let per_speed = friction.map_or(model.terms.per_speed, |x| x.per_speed);
        let dry = (qd[v] * per_speed).tanh();
        for (k, x) in [qdd[v], dry, qd[v]].into_iter().enumerate() {
            each(v, rotors + k * n_v + external, &[x]);
        }
    }
}

/// Columns of m, h and Ixx, Ixy, Iyy, Ixz, Iyz, Izz, from ω, α and a in the axes of the link.
fn body_regressor<T: Real>([w, alpha, a]: [Vector3<T>; 3]) -> [Wrench<T>; 10] {
    let unit = |k: usize| {
        let mut e: Vector3<T> = zero();
        e[k] = T::ONE;
        e
    };
    let moment = |k: usize| {
        let e = unit(k);
        (e.cross(a), alpha.cross(e).add_cross(w, w.cross(e)))
    };
    // I = e_i e_jᵀ + e_j e_iᵀ, or half of it
    let inertia = |i: usize, j: usize| {
        let of = |x: Vector3<T>| {
            let mut y = unit(i) * x[j];
            if i != j {
                y += unit(j) * x[i];
            }
            y
        };
        (of(alpha).add_cross(w, of(w)), zero())
    };
    [
        (zero(), a),
        moment(0),
        moment(1),
        moment(2),
        inertia(0, 0),
        inertia(0, 1),
        inertia(1, 1),
        inertia(0, 2),
        inertia(1, 2),
        inertia(2, 2),
    ]
}

impl<C: Real> Model<C> {
    /// The parameters π of the model, in the order of [`sarrus_proto::ModelInfo::parameters`];
    /// those of links that are fixed to a moving one are in its own. Allocates.
    pub fn parameters(&self) -> Vec<C> {
        let n_v = self.sizes().n_v;
        let mut all = Vec::with_capacity(self.sizes().n_parameters());
        for &(i, link) in &self.order.bodies {
            let body = &self.bodies[i];
            let R = &self.frames[link].x_body_frame.R;
            let [xx, xy, xz, yy, yz, zz] = body.inertia;
            let inertia = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
            let h = R.apply_transposed(body.h);
            let I = R.transpose().times(inertia).times(*R);
            let of = |i: usize, j: usize| I[(i, j)];
            all.extend([body.mass, h[0], h[1], h[2]]);
            all.extend([of(0, 0), of(0, 1), of(1, 1), of(0, 2), of(1, 2), of(2, 2)]);
        }
        let joints = all.len();
        all.resize(joints + 3 * n_v, C::ZERO);
        let mut add = |kind: usize, v: usize, x: C| {
            all[joints + kind * n_v + self.order.v_external[v]] += x;
        };
        self.terms.rotors.iter().for_each(|rotor| add(0, rotor.v, rotor.inertia));
        self.terms.dampers.iter().for_each(|damper| add(2, damper.v, damper.damping));
        for Friction { v, coulomb, viscous, .. } in &self.terms.frictions {
            add(1, *v, *coulomb);
            add(2, *v, *viscous);
        }
        all
    }
}
