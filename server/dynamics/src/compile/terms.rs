//! Reads springs, dampers and rotors of joints off the description.

use crate::compile::assemble::Builder;
use crate::description::{self, Terms};
use crate::diagnostic::{Diagnostic, Site};
use crate::mechanism::{Damper, Friction, Motion, Rotor, Spring};
use crate::scalar::{Dd, Real};

impl Builder<'_> {
    /// Reads the terms off the joints; a ball joint can have damping d, the moment −d ω, and those
    /// of another joint of several degrees of freedom are a fault.
    pub(super) fn terms(&mut self, errors: &mut Vec<Diagnostic>) {
        for &j in &self.skeleton.moving {
            let joint = &self.description.joints[j];
            if joint.terms == Terms::default() {
                continue;
            }
            let body = self.body(j);
            let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio, friction } =
                joint.terms;
            let n_v = body.motion.n_v();
            let is_damped_ball = body.motion == Motion::Spherical
                && stiffness == 0.0
                && rotor_inertia == 0.0
                && friction == description::Friction::default();
            if n_v > 1 && !is_damped_ball {
                errors.push(Diagnostic::new(
                    Site::Joint(j),
                    format!(
                        "damping, a spring or a rotor in the joint {} of several freedoms",
                        joint.name
                    ),
                    "these in joints of one freedom, or damping in a ball joint",
                    "take them out, or write the freedoms as separate joints",
                ));
                continue;
            }
            let q = body.q;
            let v = body.v;
            let number = Dd::from_f64;
            let inertia = number(gear_ratio) * number(gear_ratio) * number(rotor_inertia);
            let terms = &mut self.model.terms;
            if stiffness != 0.0 {
                terms.springs.push(Spring {
                    q,
                    v,
                    stiffness: number(stiffness),
                    rest: number(rest),
                });
            }
            if damping != 0.0 {
                let damping = number(damping);
                terms.dampers.extend((v..v + n_v).map(|v| Damper { v, damping }));
            }
            if friction != description::Friction::default() {
                terms.frictions.push(Friction {
                    v,
                    coulomb: number(friction.coulomb),
                    viscous: number(friction.viscous),
                    per_speed: Dd::ONE / number(friction.speed),
                });
            }
            if inertia != Dd::ZERO {
                terms.rotors.push(Rotor { v, inertia });
            }
        }
        self.model.terms.springs.sort_by_key(|x| x.v);
        self.model.terms.dampers.sort_by_key(|x| x.v);
        self.model.terms.rotors.sort_by_key(|x| x.v);
        self.model.terms.frictions.sort_by_key(|x| x.v);
    }

    /// Bodies that have a child cluster, or support a body of their own cluster that has.
    pub(super) fn child_clusters(&mut self) {
        let model = &mut self.model;
        model.has_child_cluster = vec![false; model.bodies.len()];
        for cluster in &model.clusters {
            let mut i = cluster.parent;
            while i != 0 && !model.has_child_cluster[i] {
                model.has_child_cluster[i] = true;
                i = model.bodies[i].parent;
            }
        }
    }
}
