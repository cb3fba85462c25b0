//! Rods that only hold a distance: links between a universal joint and a ball, whose own two
//! coordinates enter no loop but through the rod's length. Newton's method solves one row for each,
//!
//! ```text
//!   ½ (|p_S − p_P|² − ℓ²) / ℓ = 0
//! ```
//! with P the center of the universal joint and S that of the ball; the two turns follow in closed
//! form ([`crate::closure::Universal`]), on the side of the root on which they were.

use crate::closure::constraint::rows::CutState;
use crate::closure::numerical::inverse::{accurate, is_sound};
use crate::closure::numerical::newton::CAUTION;
use crate::closure::rod::{Reached, Universal};
use crate::closure::{Level, Local, Rate, Validity};
use crate::mechanism::{Cluster, TURN, read_turns, turn};
use crate::scalar::{Real, Triple, constants};

/// A cluster with one row in place of the three of each rod.
#[derive(Clone, Debug)]
pub(crate) struct Reduced<T> {
    /// The cluster of the other unknowns.
    pub(crate) cluster: Cluster<T>,
    pub(crate) rods: Vec<Rod<T>>,
    /// Turning joints whose coordinates Newton's method reads, and those of the rods.
    pub(crate) turned: Vec<(usize, usize)>,
    pub(crate) found: Vec<(usize, usize)>,
}

constants! { Reduced:
    keep turned found;
    map cluster;
    each rods;
}

/// A rod, and the cut of its row.
#[derive(Clone, Debug)]
pub(crate) struct Rod<T> {
    pub(crate) universal: Universal<T>,
    /// Local velocities of its two turns.
    pub(crate) turns: [usize; 2],
    pub(crate) cut: usize,
}

constants! { Rod:
    keep turns cut;
    map universal;
}

impl<T: Real> Reduced<T> {
    /// Cosines and sines of the joints that are not of rods, and of each rod's second turn.
    #[inline]
    pub(super) fn turn(&self, local: &mut Local<'_, T>) {
        turn(&self.turned, local.q, local.cos_sin);
    }

    /// The turns of the rods from those in `local`; false where one is singular or far from there.
    /// `gains` are those of the blocks, then of the rods.
    #[inline]
    pub(super) fn close(&self, blocks: usize, local: &mut Local<'_, T>) -> bool {
        let mut good = true;
        let before = local.scratch.gain[..blocks].iter().fold(T::ONE, |x, gain| x.larger(*gain));
        for (k, rod) in self.rods.iter().enumerate() {
            let (_, validity) = rod.reach(&self.cluster, local);
            good &= !validity.unreachable & !validity.singular;
            local.scratch.gain[blocks + k] = before * T::ONE.larger(validity.gain);
        }
        for (k, (_, i)) in self.found.iter().enumerate() {
            local.scratch.step[k] = local.q[*i];
        }
        read_turns(&self.found, local.cos_sin, local.q);
        let whole = T::from_f64(TURN[0]) + T::from_f64(TURN[1]);
        for (k, (_, i)) in self.found.iter().enumerate() {
            // the turns nearest to the old ones; from a seed these are those of the zero pose
            let old = local.scratch.step[k];
            let turns = ((old - local.q[*i]) * T::from_f64(1.0 / TURN[0])).nearest_whole();
            local.q[*i] = turns.mul_add(whole, local.q[*i]);
            let step = local.q[*i] - old;
            let gain = local.scratch.gain[blocks + k / 2];
            let near = (step * step * gain).lt(before * T::from_f64(CAUTION * CAUTION));
            good &= local.from_zero | near;
        }
        good
    }

    /// G, q̇ and g of the rods' turns from those of the other joints; whether they mean something.
    #[inline]
    pub(super) fn rates(&self, local: &mut Local<'_, T>, level: Level) -> bool {
        let m = self.cluster.n_vy;
        let mut good = true;
        for rod in &self.rods {
            let (at, Validity { gain, .. }) = rod.reach(&self.cluster, local);
            good &= is_sound(gain);
            good &= level < Level::Acceleration || accurate(T::ONE, gain);
            let cut = &self.cluster.cuts[rod.cut];
            let [first, second] = rod.turns;
            // twists of the ball against the body that carries the universal joint
            let state = CutState::new(cut, &local.scratch.pose);
            let mut turns = [[T::ZERO; 2]; 2];
            for row in [first, second] {
                local.G[row * m..(row + 1) * m].fill(T::ZERO);
            }
            for &(v, on_successor) in &cut.path {
                let dof = &self.cluster.dofs[v];
                let (_, twist) = state.twist(dof, &local.scratch.pose[dof.body + 1], on_successor);
                let rates = at.solve(&twist);
                for k in 0..m {
                    let G = local.G[v * m + k];
                    for (row, rate) in [first, second].into_iter().zip(rates) {
                        local.G[row * m + k] = rate.mul_add(G, local.G[row * m + k]);
                    }
                }
                for (sum, rate) in turns.iter_mut().zip(rates) {
                    sum[0] = rate.mul_add(local.qd[v], sum[0]);
                    sum[1] = rate.mul_add(local.g[v], sum[1]);
                }
            }
            if level >= Level::Velocity {
                local.qd[first] = turns[0][0];
                local.qd[second] = turns[1][0];
            }
            if level == Level::Acceleration {
                let rate = &local.scratch.rate;
                let Rate { w, alpha, .. } = rate[cut.predecessor];
                let (relative, _) = state.acceleration(cut, &local.scratch.pose, rate, true);
                // less that of the rod's end, beyond that of the carrying body there
                let turning = at.acceleration(w, alpha, [turns[0][0], turns[1][0]]);
                let carried = w.cross(w.cross(at.r)).add_cross(alpha, at.r);
                let bias = at.solve(&(relative + carried - turning));
                local.g[first] = bias[0] + turns[0][1];
                local.g[second] = bias[1] + turns[1][1];
            }
        }
        good
    }
}

impl<T: Real> Rod<T> {
    /// The turns, on the side of the root of the second one in `local`.
    #[inline(always)]
    fn reach(&self, cluster: &Cluster<T>, local: &mut Local<'_, T>) -> (Reached<T>, Validity<T>) {
        let cut = &cluster.cuts[self.cut];
        let carrier = local.scratch.pose[cut.predecessor];
        let ball = local.scratch.pose[cut.successor].point(&cut.x_s_cut.p);
        let r = ball - carrier.point(&cut.x_p_cut.p);
        let (c, s) = local.cos_sin[self.universal.joints[1]];
        let w = &self.universal.rod;
        let z = c.mul_add(w[2], -(s * w[0]));
        let root = T::select_lt(z, T::ZERO, -T::ONE, T::ONE);
        self.universal.reach(&carrier.R, r, root, local)
    }
}
