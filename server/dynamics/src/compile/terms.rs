//! Reads what acts in joints besides their actuators off the description.

use crate::compile::assemble::Builder;
use crate::description::Terms;
use crate::diagnostic::{Diagnostic, Site};
use crate::mechanism::{Damper, Rotor, Spring};
use crate::scalar::{Dd, Real};

impl Builder<'_> {
    /// Reads the terms off the joints; those of a joint of several freedoms are a fault.
    pub(super) fn terms(&mut self, moving_of: &[usize], errors: &mut Vec<Diagnostic>) {
        let joints = self
            .description
            .joints
            .iter()
            .enumerate()
            .filter(|(_, joint)| joint.terms != Terms::default());
        for (j, joint) in joints.filter(|(j, _)| moving_of[*j] != usize::MAX) {
            let body = &self.model.bodies[self.body_of[moving_of[j]]];
            let Terms { damping, stiffness, rest, rotor_inertia, gear_ratio } = joint.terms;
            if body.motion.n_v() > 1 {
                errors.push(Diagnostic {
                    site: Site::Joint(j),
                    found: format!(
                        "damping, a spring or a rotor in the joint {} of several freedoms",
                        joint.name
                    ),
                    expected: "these in joints of one freedom".into(),
                    help: "take them out, or write the freedoms as joints of their own".into(),
                });
                continue;
            }
            let (q, v, number) = (body.q, body.v, Dd::from_f64);
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
                terms.dampers.push(Damper { v, damping: number(damping) });
            }
            if inertia != Dd::ZERO {
                terms.rotors.push(Rotor { v, inertia });
            }
        }
        self.model.terms.springs.sort_by_key(|x| x.v);
        self.model.terms.dampers.sort_by_key(|x| x.v);
        self.model.terms.rotors.sort_by_key(|x| x.v);
    }

    /// Which bodies have another cluster hanging from them or from what they carry in their own.
    pub(super) fn carriers(&mut self) {
        let model = &mut self.model;
        model.carries = vec![false; model.bodies.len()];
        for cluster in &model.clusters {
            let mut i = cluster.parent;
            while i != 0 && !model.carries[i] {
                model.carries[i] = true;
                i = model.bodies[i].parent;
            }
        }
    }
}
