//! Whole turns of dependent joints of which a closed form knows the angle alone.
//!
//! ```text
//!   r(y) = m + Σ_k w_k y_k       w_k turns of the joint for one turn of independent k
//! ```
//! stays within half a turn of the coordinate along the motion from the zero pose, where the
//! coordinate is a function of y. There it keeps the whole turns from r that it has at the start.
//! Elsewhere it is the one nearest to where the start moves with r.

use core::f64::consts::{PI, TAU};

use crate::scalar::Real;

/// 2π less its double.
const TAU_REST: f64 = 2.449_293_598_294_706_4e-16;

/// The dependent revolute joints of a cluster that a closed form closes; none of another cluster.
#[derive(Clone, Debug, Default)]
pub(crate) struct Windings {
    pub(crate) joints: Vec<Winding>,
    /// From the zero pose the coordinate of some joint leaves (−π, π].
    pub(crate) leaves: bool,
    /// The only independent, by its local coordinate, and the range in which none does.
    pub(crate) within: Option<(usize, [f64; 2])>,
}

/// The whole turns of one joint.
#[derive(Clone, Debug)]
pub(crate) struct Winding {
    /// Its local coordinate.
    pub(crate) coordinate: usize,
    /// m, and w_k by local coordinate where it is not zero.
    pub(crate) middle: f64,
    pub(crate) turns: Vec<(usize, f64)>,
    /// The coordinate is a function of y.
    pub(crate) is_function: bool,
}

impl Windings {
    /// True where the angles in `q` may not be the coordinates, from the zero pose.
    #[inline]
    pub(crate) fn leave<T: Real>(&self, q: &[T]) -> bool {
        let stays = |(k, [lower, upper]): (usize, [f64; 2])| {
            T::from_f64(lower).lt(q[k]) && q[k].lt(T::from_f64(upper))
        };
        self.leaves && !self.within.is_some_and(stays)
    }

    /// Takes the angles in `q` to the turns that continue those of `start`.
    #[inline]
    pub(crate) fn count<T: Real>(&self, start: &[T], q: &mut [T]) {
        for joint in &self.joints {
            let i = joint.coordinate;
            let is_near = (q[i] - start[i]).abs().lt(T::from_f64(PI));
            if !(is_near && joint.turns.is_empty() && !joint.is_function) {
                q[i] = joint.continued(start, q);
            }
        }
    }
}

impl Winding {
    /// The coordinate of the angle in `q` that continues the one of `start`.
    #[inline]
    pub(crate) fn continued<T: Real>(&self, start: &[T], q: &[T]) -> T {
        let turn = T::from_f64(TAU) + T::from_f64(TAU_REST);
        let in_turns = |x: T| (x * T::from_f64(1.0 / TAU)).nearest_whole();
        let off = |q: &[T]| {
            let term = |r: T, (k, w): &(usize, f64)| T::from_f64(*w).mul_add(q[*k], r);
            q[self.coordinate] - self.turns.iter().fold(T::from_f64(self.middle), term)
        };
        let turns = if self.is_function {
            in_turns(off(q)) - in_turns(off(start))
        } else {
            in_turns(off(q) - off(start))
        };
        // −0 turns leave −0 alone
        (-turns).mul_add(turn, q[self.coordinate])
    }
}
