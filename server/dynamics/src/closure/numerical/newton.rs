//! Newton's method for one block, with the rule by which an attempt is accepted.
//!
//! With A = ∂φ/∂q_d of the block and s the size of a step, the largest of its components in radians
//! or cluster lengths:
//!
//! ```text
//!   Δ_k = A⁻¹ φ(q_k)        q_{k+1} = q_k − Δ_k        s_k = ‖Δ_k‖∞
//! ```
//! The attempt ends at the first k with
//!
//! ```text
//!   s_k < s_end  or  ‖φ(q_k)‖∞ < 8 ε ℓ                 s_end = √ε / 10, or the tolerance given
//! ```
//! and is accepted when every step before was:
//!
//! ```text
//!   s_0 < ½   and   max(s_0, m)² / sin²α < 0.7²        trust region
//!   s_k < 0.3 s_{k−1}                                  contraction
//!   det A_k · det A_{k−1} > 0                          assembly branch
//! ```
//! m is the distance that the independents have moved, α the least angle between a column of A at
//! the start and the span of the others: the search for a pose stays well within the distance to
//! the nearest singular pose. An attempt from the zero pose satisfies the rule of the trust region
//! for m also with the α of that pose (`Numerical::is_far`). Where the rows see a small part of a
//! joint's lever, its column counts as long as the lever: a motion turns the rest of it into sight.
//!
//! Chord rule: after s_{k−1} < ε^(3/8) the inverse of step k − 1 serves again, as the error then is
//! the cube of that step. In blocks of more than eight rows, whose inverse costs more than several
//! residuals, it serves again after s_{k−1} < ε^(1/4) with s_{k−1}
//! < sin α / 100 already, and the error after a step is estimated from the contraction:
//!
//! ```text
//!   2 s_k² / s_{k−1} < ε / 16
//! ```

use crate::closure::Local;
use crate::closure::constraint::rows::base;
use crate::closure::numerical::End;
use crate::closure::numerical::block::{Block, by_width};
use crate::closure::numerical::inverse::Inverted;
use crate::linalg::column_square;
use crate::mechanism::{Cluster, Motion, turn_some};
use crate::scalar::Real;

/// Largest first step, in radians or cluster lengths.
pub(super) const TRUST: f64 = 0.5;
/// Part of a block's distance to singularity that independents and first step may go: a longer path
/// could lead through a place where the loops do not close, and out of it on the other side.
pub(super) const CAUTION: f64 = 0.7;
/// A Newton step must be at most this fraction of the one before.
pub(super) const CONTRACTION: f64 = 0.3;
/// Part of the distance to singularity below which a step of a wide block keeps its inverse.
const STEADY: f64 = 0.01;
/// Most rows of a block whose inverse costs less than several residuals.
const NARROW: usize = 8;

/// Where an attempt starts.
#[derive(Clone, Copy)]
pub(super) struct Start<T> {
    /// The determinant at the old pose, where its sign is to be kept from there on.
    pub(super) branch: Option<T>,
    /// How far the independents are from the old pose, in radians or cluster lengths.
    pub(super) moved: T,
}

/// The thresholds of one attempt.
pub(super) struct Thresholds<T> {
    /// Size of a step after which the error is rounding.
    pub(super) last: T,
    /// Size of the step, and residual, that end the attempt.
    pub(super) end: T,
    pub(super) floor: T,
    /// Size of a step after which its inverse serves again; of a wide block.
    pub(super) chord: T,
    wide_chord: T,
    /// Largest error after a step by a kept inverse.
    left: T,
}

impl<T: Real> Thresholds<T> {
    #[inline(always)]
    pub(super) fn new(length: f64, end: End) -> Thresholds<T> {
        let last = T::from_f64(0.1 * T::EPSILON.sqrt());
        Thresholds {
            last,
            end: end.tolerance.map_or(last, T::from_f64),
            floor: T::from_f64(8.0 * T::EPSILON * length),
            chord: T::from_f64(T::EPSILON.sqrt().sqrt() * T::EPSILON.sqrt().sqrt().sqrt()),
            wide_chord: T::from_f64(T::EPSILON.sqrt().sqrt()),
            left: T::from_f64(T::EPSILON / 16.0),
        }
    }
}

/// The state of an attempt.
pub(super) struct Attempt<T: Real> {
    /// Every step was accepted; the attempt has converged.
    pub(super) good: bool,
    pub(super) done: bool,
    /// Size of the last step, and the determinant of the last inverse.
    pub(super) size: T,
    pub(super) det: T,
    /// 1/sin² of the angle that vanishes at a singular pose, at the last inverse.
    pub(super) gain: T,
}

impl<T: Real> Attempt<T> {
    #[inline(always)]
    pub(super) fn new() -> Attempt<T> {
        Attempt {
            good: true,
            done: false,
            size: T::from_f64(TRUST / CONTRACTION),
            det: T::ZERO,
            gain: T::ONE,
        }
    }

    /// Assembly branch: det A_k · det A_{k−1} > 0.
    #[inline(always)]
    pub(super) fn check_branch(&mut self, inverted: &Inverted<T>) {
        let same = T::ZERO.lt(inverted.det * self.det);
        self.det = inverted.det;
        self.good &= self.done | (inverted.sound & same);
    }

    /// Trust region: s_0 < ½ and max(s_0, m)² / sin²α < 0.7².
    #[inline(always)]
    pub(super) fn check_trust(&mut self, size: T, moved: T, inverse_square_sine: T) {
        let distance = T::select_lt(size, moved, moved, size);
        self.good = self.good
            & size.lt(T::from_f64(TRUST))
            & (distance * distance * inverse_square_sine).lt(T::from_f64(CAUTION * CAUTION));
    }

    /// True if the inverse of the last step of a wide block serves again: s_{k−1} < ε^(1/4) and
    /// s_{k−1} < sin α / 100.
    #[inline(always)]
    fn is_steady(&self, thresholds: &Thresholds<T>) -> bool {
        let part = self.size * self.size * self.gain;
        self.size.lt(thresholds.wide_chord) & part.lt(T::from_f64(STEADY * STEADY))
    }

    /// Contraction, s_k < 0.3 s_{k−1}, and the end of the attempt; `kept`: the inverse may be older
    /// than that of the step before.
    #[inline(always)]
    pub(super) fn check_contraction(
        &mut self,
        size: T,
        residual: T,
        thresholds: &Thresholds<T>,
        tolerant: bool,
        kept: bool,
    ) {
        // s_k < 0.3 s_{k−1};  s_k < s_end, of a kept inverse also 2 s_k² / s_{k−1} < ε / 16;  or
        // ‖φ‖∞ < 8 ε ℓ
        let contracts = size.lt(self.size * T::from_f64(CONTRACTION));
        let mut ends = size.lt(thresholds.end);
        if kept {
            ends &= (size * size * T::from_f64(2.0)).lt(thresholds.left * self.size);
        }
        let mut at_floor = ends | residual.lt(thresholds.floor);
        if tolerant || kept {
            // below the threshold of rounding steps no longer contract
            at_floor |= size.lt(thresholds.last) & !contracts;
        }
        self.good &= self.done | at_floor | contracts;
        self.done |= at_floor;
    }
}

impl Block {
    /// Newton's method for the block's unknowns; poses before the block are closed, its own are
    /// fresh before and after a good end. Returns whether the attempt was accepted, the number of
    /// steps and the gain.
    #[inline]
    pub(super) fn newton<T: Real>(
        &self,
        local: &mut Local<'_, T>,
        start: Start<T>,
        end: End,
    ) -> (bool, u32, T) {
        if T::UNROLLED && self.series.is_some() {
            return match self.unknowns.len() {
                1 => self.newton_in_series::<T, 1>(local, start, end),
                2 => self.newton_in_series::<T, 2>(local, start, end),
                _ => self.newton_in_series::<T, 3>(local, start, end),
            };
        }
        by_width!(self.newton_of_width(local, start, end))
    }

    fn newton_of_width<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        start: Start<T>,
        end: End,
    ) -> (bool, u32, T) {
        let cluster = local.cluster;
        let thresholds = Thresholds::<T>::new(cluster.length, end);
        let mut attempt = Attempt::<T>::new();
        if self.couples {
            attempt.size = T::from_f64(f64::MAX);
        }
        let mut trust = T::ZERO;
        let mut taken = 0;
        self.begin(local);
        for k in 0..end.steps {
            // φ(q_k), and A⁻¹ unless the chord rule keeps it
            let tiny = k > 0 && attempt.size.lt(thresholds.chord);
            let kept = k > 0 && self.keeps::<M>(end) && attempt.is_steady(&thresholds);
            let fresh = !tiny && !kept;
            let residual = self.evaluate::<T, M>(local, fresh);
            if k == 0 {
                let gain;
                (gain, trust) = self.first_inverse::<T, M>(local, start, &mut attempt);
                attempt.gain = match self.width::<M>() {
                    1 => self.lever_gain(local),
                    _ => gain,
                };
            } else if fresh {
                attempt.gain = self.next_inverse::<T, M>(local, &mut attempt);
            }
            // Δ_k = A⁻¹ φ(q_k), q_{k+1} = q_k − Δ_k, s_k = ‖Δ_k‖∞
            let size = self.step::<T, M>(local, cluster.length, attempt.done);
            taken += 1;
            if k == 0 && !self.couples {
                attempt.check_trust(size, start.moved, trust);
            }
            attempt.check_contraction(size, residual, &thresholds, end.tolerance.is_some(), kept);
            if !attempt.good {
                break;
            }
            attempt.size = size;
            self.update_cos_sin::<T, M>(local, size.lt(thresholds.last));
            self.place(local);
            if attempt.done {
                break;
            }
        }
        let good = attempt.good & (attempt.done | end.tolerance.is_some());
        (good, taken, attempt.gain)
    }

    /// Poses at the start; of bodies whose parent stands still also that at zero of their joint.
    #[inline(always)]
    pub(super) fn begin<T: Real>(&self, local: &mut Local<'_, T>) {
        let &mut Local { cluster, bodies, .. } = local;
        let scratch = &mut *local.scratch;
        for &(j, _) in self.bodies.iter().filter(|(_, held)| *held) {
            scratch.base[j] = base(cluster, bodies, j, &scratch.pose);
        }
        self.place(local);
    }

    /// True where an inverse costs more than steps; a tolerance counts steps by fresh ones.
    #[inline(always)]
    fn keeps<const M: usize>(&self, end: End) -> bool {
        self.width::<M>() > NARROW && end.tolerance.is_none()
    }

    /// The inverse after a step; returns 1/sin² of the angle that vanishes at a singular pose.
    #[inline(always)]
    fn next_inverse<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        attempt: &mut Attempt<T>,
    ) -> T {
        let inverted = self.invert::<T, M>(local);
        attempt.check_branch(&inverted);
        match self.width::<M>() {
            1 => self.lever_gain(local),
            _ => inverted.gain,
        }
    }

    /// 1/sin² of a block of one row: its lever against the length of the cluster.
    #[inline(always)]
    pub(super) fn lever_gain<T: Real>(&self, local: &Local<'_, T>) -> T {
        let cluster = local.cluster;
        self.lever_gain_of(cluster, local.scratch.inverse[self.offset])
    }

    #[inline(always)]
    pub(super) fn lever_gain_of<T: Real>(&self, cluster: &Cluster<T>, inverse: T) -> T {
        let slides = self.unknowns[0].slides();
        let inverse = if slides { inverse } else { inverse * T::from_f64(cluster.length) };
        inverse * inverse
    }

    /// The inverse at the start, whose branch is compared with the old one; returns 1/sin²α, and
    /// that of the trust region.
    #[inline(always)]
    fn first_inverse<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        start: Start<T>,
        attempt: &mut Attempt<T>,
    ) -> (T, T) {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        if m <= 3 {
            (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, m, i));
        }
        let inverted = self.invert::<T, M>(local);
        attempt.det = start.branch.unwrap_or(inverted.det);
        attempt.check_branch(&inverted);
        if m > 3 {
            return (inverted.gain, inverted.near);
        }
        let scratch = &*local.scratch;
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        let squares = &scratch.step[..m];
        (inverted.gain, self.trust_gain(inverse, squares))
    }

    /// q ← q − A⁻¹ φ unless the attempt has converged; returns the size of the step.
    #[inline(always)]
    pub(super) fn step<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        length: f64,
        done: bool,
    ) -> T {
        let m = self.width::<M>();
        let unit = T::from_f64(1.0 / length);
        let scratch = &mut *local.scratch;
        let phi = &scratch.phi[..m];
        let steps = &mut scratch.step[..m];
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        for i in 0..m {
            let row = &inverse[i * m..(i + 1) * m];
            let mut step = T::ZERO;
            for r in 0..m {
                step = row[r].mul_add(phi[r], step);
            }
            steps[i] = if done { T::ZERO } else { step };
        }
        let mut size = T::ZERO;
        for (i, dof) in self.unknowns[..m].iter().enumerate() {
            dof.advance(local.q, -steps[i]);
            let scaled = steps[i].abs();
            let scaled = if dof.slides() { scaled * unit } else { scaled };
            size = T::select_lt(size, scaled, scaled, size);
        }
        size
    }

    /// Cosines and sines of the unknowns after a step; PRECISION: they follow a last tiny one by
    /// its first order, as the second is below half a unit roundoff.
    #[inline(always)]
    pub(super) fn update_cos_sin<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        tiny: bool,
    ) {
        let turns = || self.unknowns[..self.width::<M>()].iter().enumerate();
        let turns = || turns().filter(|(_, dof)| dof.motion == Motion::Revolute);
        if !tiny {
            turn_some(turns().map(|(_, dof)| (dof.body, dof.q)), local.q, local.cos_sin);
            return;
        }
        for (i, dof) in turns() {
            let (c, s) = local.cos_sin[dof.body];
            let step = local.scratch.step[i];
            local.cos_sin[dof.body] = (s.mul_add(step, c), (-c).mul_add(step, s));
        }
    }
}
