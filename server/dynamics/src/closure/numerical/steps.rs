//! A fixed number of Newton's steps on the rows themselves, from a seed: the form of a cluster that
//! has no other one, so that generated code closes it too.
//!
//! The inverse of the first step, or of the second one where seeds are rough, serves those after
//! it. With the sizes s_k of the steps, the error after the last one is s_k² / s_{k−1} of a kept
//! inverse; the steps pass the rule of [`super::newton`].

use crate::closure::constraint::rows::place;
use crate::closure::numerical::block::{Block, Blocks, by_width};
use crate::closure::numerical::newton::{CAUTION, CONTRACTION, TRUST};
use crate::closure::{Level, Local, Numerical, Validity};
use crate::mechanism::{Cluster, Dof, Motion, turn};
use crate::scalar::Real;
use crate::spatial::Pose;

/// Steps from a seed: few where a table is fine enough, else up to most, then with most inverses.
const FEW_STEPS: usize = 2;
const MOST_STEPS: usize = 4;
const MOST_INVERSES: usize = 2;
/// Roundings below which the last step may stay.
const ROUNDINGS: f64 = 64.0;

/// The rows of a cluster whose joints have one degree of freedom each.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    pub(crate) rows: Blocks,
    /// All dependents.
    pub(crate) unknowns: Vec<Dof>,
    /// The joints that turn, as places of cosine and sine and of the coordinate.
    pub(crate) turning: Vec<(usize, usize)>,
    /// Sign of the determinant of each block at the zero pose.
    pub(crate) signs: Vec<f64>,
    /// Steps from a seed, and how many of them have an inverse of their own.
    pub(crate) steps: usize,
    inverses: usize,
}

impl Steps {
    /// Of a cluster of single joints that has a table; `None` of others.
    pub(crate) fn new<T>(of: &Numerical<T>, cluster: &Cluster<T>) -> Option<Steps> {
        let mut rows = of.choices[0].clone();
        let eliminations = rows.blocks.iter_mut().filter_map(|block| block.elimination.as_mut());
        eliminations.for_each(|elimination| elimination.is_fixed = true);
        let unknowns = rows.blocks.iter().flat_map(|block| block.unknowns.clone()).collect();
        let turns = cluster.dofs.iter().filter(|dof| dof.motion == Motion::Revolute);
        let turning = turns.map(|dof| (dof.body, dof.q)).collect();
        let signs = Vec::new();
        let steps = Steps { rows, unknowns, turning, signs, steps: FEW_STEPS, inverses: 1 };
        cluster.dofs.iter().all(|dof| dof.single).then_some(steps)
    }

    /// It has no constant to convert.
    pub(crate) fn map<C, D>(&self, _: impl Fn(C) -> D) -> Steps {
        self.clone()
    }

    /// Takes one step or one inverse more; false where it takes most already.
    pub(super) fn lengthen(&mut self) -> bool {
        match self.steps < MOST_STEPS {
            true => self.steps += 1,
            false => self.inverses += 1,
        }
        self.inverses <= MOST_INVERSES
    }

    /// All levels, from the unknowns in `local.q`.
    pub(super) fn close<T: Real>(&self, local: &mut Local<'_, T>, level: Level) -> Validity<T> {
        let &mut Local { cluster, bodies, .. } = local;
        local.scratch.choice = 0;
        local.scratch.pose[0] = Pose::identity();
        turn(&self.turning, local.q, local.cos_sin);
        let put = |joints: &[usize], local: &mut Local<'_, T>| {
            for &j in joints {
                place(cluster, bodies, j, local.q, local.cos_sin, &mut local.scratch.pose);
            }
        };
        let mut validity = Validity::fine();
        for (b, (block, sign)) in self.rows.blocks.iter().zip(&self.signs).enumerate() {
            put(&block.before, local);
            let (good, gain) = by_width!(block.steps(local, [self.steps, self.inverses], *sign));
            block.multiply_gain(b, gain, &mut local.scratch.gain);
            let gain = local.scratch.gain[b];
            validity = validity.or(Validity { singular: !good, gain, ..Validity::fine() });
        }
        put(&self.rows.after, local);
        let is_regular = level == Level::Position || self.rows.rates(local, level);
        Validity { singular: validity.singular | !is_regular, ..validity }
    }
}

impl Block {
    /// The steps; whether they pass the rule, and the gain.
    fn steps<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        [steps, inverses]: [usize; 2],
        sign: f64,
    ) -> (bool, T) {
        let length = local.cluster.length;
        let rounding = T::from_f64(ROUNDINGS * T::EPSILON);
        let [mut before, mut last, mut gain] = [T::ONE; 3];
        let mut good = true;
        self.begin(local);
        for k in 0..steps {
            if k > 0 {
                self.update_cos_sin::<T, M>(local, false);
                self.place(local);
            }
            before = last;
            if k < inverses {
                let (size, _, inverted, near) = self.fresh_step::<T, M>(local);
                last = size;
                gain = match self.width::<M>() {
                    1 => self.lever_gain(local),
                    _ => inverted.gain,
                };
                good &= inverted.sound & T::ZERO.lt(inverted.det * T::from_f64(sign));
                let is_near = size.lt(T::from_f64(TRUST))
                    & (size * size * near).lt(T::from_f64(CAUTION * CAUTION));
                good &= is_near | self.couples;
            } else {
                self.evaluate::<T, M>(local, false);
                last = self.step::<T, M>(local, length, false);
            }
            let most = (before * T::from_f64(CONTRACTION)).larger(rounding);
            good &= (k == 0) | last.lt(most);
        }
        self.update_cos_sin::<T, M>(local, true);
        self.place(local);
        let left = (before * T::from_f64(T::EPSILON / 32.0)).larger(rounding * rounding);
        good &= last.lt(T::from_f64(0.1 * T::EPSILON.sqrt())) & (last * last).lt(left);
        (good, gain)
    }
}
