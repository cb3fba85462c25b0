//! Springs, dampers and rotors of joints, as lists of the joints that have them.

use crate::scalar::constants;
/// Springs, dampers and rotors of all joints, each in the order of the velocities.
#[derive(Clone, Debug)]
pub(crate) struct JointTerms<T> {
    pub(crate) springs: Vec<Spring<T>>,
    pub(crate) dampers: Vec<Damper<T>>,
    pub(crate) rotors: Vec<Rotor<T>>,
}

constants! { JointTerms:
    each springs dampers rotors;
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

impl<T: Copy> JointTerms<T> {
    pub(crate) fn none() -> JointTerms<T> {
        JointTerms { springs: Vec::new(), dampers: Vec::new(), rotors: Vec::new() }
    }
}
