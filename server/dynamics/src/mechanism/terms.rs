//! Springs, dampers and rotors of joints, as lists of the joints that have them.

use crate::scalar::constants;
/// Springs, dampers, rotors and friction of all joints, each in the order of the velocities.
#[derive(Clone, Debug)]
pub(crate) struct JointTerms<T> {
    pub(crate) springs: Vec<Spring<T>>,
    pub(crate) dampers: Vec<Damper<T>>,
    pub(crate) rotors: Vec<Rotor<T>>,
    pub(crate) frictions: Vec<Friction<T>>,
    /// 1 / v₀ of all other joints, whose dry friction is not known yet.
    pub(crate) per_speed: T,
}

constants! { JointTerms:
    number per_speed;
    each springs dampers rotors frictions;
}

/// The joint exerts −k (q − rest).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring<T> {
    pub(crate) q: usize,
    pub(crate) v: usize,
    pub(crate) stiffness: T,
    pub(crate) rest: T,
}

constants! { Spring:
    keep q v;
    number stiffness rest;
}

/// The joint exerts −d q̇.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper<T> {
    pub(crate) v: usize,
    pub(crate) damping: T,
}

constants! { Damper:
    keep v;
    number damping;
}

/// A rotor that adds N² I to the joint's inertia.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rotor<T> {
    pub(crate) v: usize,
    pub(crate) inertia: T,
}

constants! { Rotor:
    keep v;
    number inertia;
}

/// The joint exerts −F tanh(q̇ / v₀) − d q̇ where it is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Friction<T> {
    pub(crate) v: usize,
    pub(crate) coulomb: T,
    pub(crate) viscous: T,
    /// 1 / v₀.
    pub(crate) per_speed: T,
}

constants! { Friction:
    keep v;
    number coulomb viscous per_speed;
}

impl<T> JointTerms<T> {
    pub(crate) fn none(per_speed: T) -> JointTerms<T> {
        JointTerms {
            springs: Vec::new(),
            dampers: Vec::new(),
            rotors: Vec::new(),
            frictions: Vec::new(),
            per_speed,
        }
    }
}
