//! Newton's method in pieces that do not branch: one step of a block, and the levels below the
//! position at a closed pose. Generated code takes these steps by itself.

use crate::closure::numerical::Numerical;
use crate::closure::numerical::block::Block;
use crate::closure::numerical::inverse::{ANY, Inverted};
use crate::closure::{Level, Local};
use crate::linalg::column_square;
use crate::scalar::Real;

impl<T: Real> Numerical<T> {
    /// One step of block b, by the first choice of rows, from the coordinates in `local.q`. Returns
    /// the size of the step, the residual before it, the determinant, and 1/sin²α of
    /// the trust region of [`super::newton`].
    pub(crate) fn one_step(&self, b: usize, local: &mut Local<'_, T>) -> [T; 4] {
        local.pose();
        let (size, residual, inverted, near) =
            self.choices[0].blocks[b].fresh_step::<T, ANY>(local);
        [size, residual, inverted.det, near]
    }

    /// G, q̇ and g at the closed pose in `local.q` by the first choice of rows: whether they mean
    /// something, and the gain of their roundings.
    pub(crate) fn rates_at(&self, local: &mut Local<'_, T>, level: Level) -> (bool, T) {
        local.scratch.choice = 0;
        local.pose();
        if level == Level::Position {
            return (true, T::ONE);
        }
        let sound = self.choices[0].rates(local, level);
        (sound, self.gain(local))
    }
}

impl Block {
    /// One step by an inverse of its own: its size, the residual before it, the inverse, and
    /// 1/sin²α of the trust region.
    #[inline(always)]
    pub(super) fn fresh_step<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
    ) -> (T, T, Inverted<T>, T) {
        let m = self.width::<M>();
        let residual = self.evaluate::<T, M>(local, true);
        let scratch = &mut *local.scratch;
        if m <= 3 {
            (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, m, i));
        }
        let inverted = self.invert::<T, M>(local);
        let scratch = &*local.scratch;
        let near = if m > 3 {
            inverted.near
        } else {
            let inverse = &scratch.inverse[self.offset..self.offset + m * m];
            self.trust_gain(inverse, &scratch.step[..m])
        };
        let size = self.step::<T, M>(local, local.cluster.length, false);
        (size, residual, inverted, near)
    }
}
