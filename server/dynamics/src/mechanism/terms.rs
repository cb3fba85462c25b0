//! What acts in joints besides their actuators, as lists that are empty where nothing does.

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
    pub(crate) fn none() -> JointTerms<C> {
        JointTerms { springs: Vec::new(), dampers: Vec::new(), rotors: Vec::new() }
    }

    /// The same terms with every constant converted.
    pub(crate) fn map<D>(&self, f: impl Fn(C) -> D + Copy) -> JointTerms<D> {
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
