//! Maps from the external order to that of the bodies, and limits by internal coordinate.

/// Limits of one joint, by internal coordinate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limit {
    pub(crate) q: usize,
    pub(crate) v: usize,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) velocity: f64,
}

/// Maps from the external order to the order of the bodies.
#[derive(Clone, Debug, Default)]
pub(crate) struct Order {
    /// Internal index of each tree coordinate and tree velocity.
    pub(crate) q: Vec<usize>,
    pub(crate) v: Vec<usize>,
    /// For each independent coordinate its tree coordinate; for each independent velocity its tree
    /// velocity and its internal number.
    pub(crate) qy_q: Vec<usize>,
    pub(crate) vy_v: Vec<usize>,
    pub(crate) vy: Vec<usize>,
    /// For each actuator its tree coordinate and velocity.
    pub(crate) u_q: Vec<usize>,
    pub(crate) u_v: Vec<usize>,
    /// The inverse: external index of each internal tree and independent velocity; and the
    /// identity.
    pub(crate) v_external: Vec<usize>,
    pub(crate) vy_external: Vec<usize>,
    pub(crate) vy_internal: Vec<usize>,
    /// Each moving body with the number of the link that its joint carries.
    pub(crate) bodies: Vec<(usize, usize)>,
    /// Each cut but couplings, as (cluster, number in it).
    pub(crate) cuts: Vec<(usize, usize)>,
    /// The closed clusters that have a branch, in the order of their submechanisms.
    pub(crate) branches: Vec<usize>,
}

impl Order {
    /// The number of a moving body in [`Order::bodies`], and the link that its joint carries.
    pub(crate) fn joint_of(&self, body: usize) -> Option<(usize, usize)> {
        self.bodies.iter().position(|(i, _)| *i == body).map(|k| (k, self.bodies[k].1))
    }
}
