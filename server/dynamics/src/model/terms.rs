//! What acts in joints besides their actuators, as lists that are empty where nothing does.

use super::assemble::Builder;
use crate::description::Terms;
use crate::diagnostic::{Diagnostic, Site};
use crate::scalar::{Dd, Real};

/// Springs, dampers and rotors of all joints, each in the order of the velocities.
#[derive(Clone, Debug)]
pub(crate) struct JointTerms<C> {
    pub(crate) springs: Vec<Spring<C>>,
    pub(crate) dampers: Vec<Damper<C>>,
    pub(crate) rotors: Vec<Rotor<C>>,
}

/// The joint exerts −k (q − rest).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring<C> {
    pub(crate) q: usize,
    pub(crate) v: usize,
    pub(crate) stiffness: C,
    pub(crate) rest: C,
}

/// The joint exerts −d q̇.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper<C> {
    pub(crate) v: usize,
    pub(crate) damping: C,
}

/// A rotor that adds N² I to the joint's inertia.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rotor<C> {
    pub(crate) v: usize,
    pub(crate) inertia: C,
}

impl<C: Copy> JointTerms<C> {
    pub(super) fn none() -> JointTerms<C> {
        JointTerms { springs: Vec::new(), dampers: Vec::new(), rotors: Vec::new() }
    }

    /// The same terms with every constant converted.
    pub(super) fn map<D>(&self, f: impl Fn(C) -> D + Copy) -> JointTerms<D> {
        let spring =
            |x: &Spring<C>| Spring { q: x.q, v: x.v, stiffness: f(x.stiffness), rest: f(x.rest) };
        JointTerms {
            springs: self.springs.iter().map(spring).collect(),
            dampers: self
                .dampers
                .iter()
                .map(|x| Damper { v: x.v, damping: f(x.damping) })
                .collect(),
            rotors: self.rotors.iter().map(|x| Rotor { v: x.v, inertia: f(x.inertia) }).collect(),
        }
    }
}

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
