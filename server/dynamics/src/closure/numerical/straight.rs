//! Newton's method in pieces that do not branch: one step of a block, and the levels below the
//! position at a closed pose. Generated code takes these steps by itself.

use crate::closure::numerical::Numerical;
use crate::closure::numerical::inverse::ANY;
use crate::closure::{Level, Local};
use crate::linalg::column_square;
use crate::scalar::Real;

impl<T: Real> Numerical<T> {
    /// One step of block b, by the first choice of rows, from the coordinates in `local.q`. Returns
    /// the size of the step, the residual before it, the determinant, and 1/sin²α of
    /// the trust region of [`super::newton`].
    pub(crate) fn one_step(&self, b: usize, local: &mut Local<'_, T>) -> [T; 4] {
        let cluster = local.cluster;
        let block = &self.choices[0].blocks[b];
        let m = block.unknowns.len();
        local.pose();
        let residual = block.evaluate::<T, ANY>(local, true);
        let scratch = &mut *local.scratch;
        if m <= 3 {
            (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, m, i));
        }
        let inverted = block.invert::<T, ANY>(local);
        let scratch = &*local.scratch;
        let inverse_square_sine = if m > 3 {
            inverted.near
        } else {
            let inverse = &scratch.inverse[block.offset..block.offset + m * m];
            let squares = &scratch.step[..m];
            block.trust_gain(inverse, squares)
        };
        let size = block.step::<T, ANY>(local, cluster.length, false);
        [size, residual, inverted.det, inverse_square_sine]
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
