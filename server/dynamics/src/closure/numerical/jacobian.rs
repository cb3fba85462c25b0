//! The rows of G that a block determines: G_d = −K_d⁻¹ K_i.

use crate::closure::numerical::block::{Block, RowsAt, by_width};
use crate::closure::numerical::inverse::Inverted;
use crate::closure::numerical::series::INDEPENDENTS;
use crate::closure::{Level, Local, column_unit};
use crate::scalar::Real;

impl Block {
    /// The block's rows of G at the closed pose: G_d = −K_d⁻¹ K_i, with the joints of earlier
    /// blocks on the right-hand side. Returns whether they are regular, and
    /// 1/sin² of the angle that vanishes at a singular pose of the block.
    #[inline]
    pub(super) fn jacobian<T: Real>(&self, local: &mut Local<'_, T>, level: Level) -> (bool, T) {
        let cluster = local.cluster;
        if T::UNROLLED && self.series.is_some() && cluster.n_vy <= INDEPENDENTS {
            return match self.unknowns.len() {
                1 => self.jacobian_in_series::<T, 1>(local, level),
                2 => self.jacobian_in_series::<T, 2>(local, level),
                _ => self.jacobian_in_series::<T, 3>(local, level),
            };
        }
        by_width!(self.jacobian_of_width(local, level))
    }

    fn jacobian_of_width<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> (bool, T) {
        let cluster = local.cluster;
        let m = self.width::<M>();
        let n_vy = cluster.n_vy;
        self.both_sides::<T, M>(local);
        let scratch = &mut *local.scratch;
        // one row alone: its independents move it more than its unknown does
        let lever_ratio = (m == 1).then(|| {
            let square = |x: T, v: usize| {
                (x * x) * T::from_f64(column_unit(cluster, v) * column_unit(cluster, v))
            };
            let moves = (scratch.B[..n_vy].iter().zip(&cluster.independent))
                .fold(T::ZERO, |sum, (b, v)| sum + square(*b, *v));
            moves / square(scratch.A[0], self.unknowns[0].v)
        });
        let Inverted { sound, accurate, gain, .. } = self.invert::<T, M>(local);
        let scratch = &*local.scratch;
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        for (i, dof) in self.unknowns[..m].iter().enumerate() {
            let of_unknown = &inverse[i * m..(i + 1) * m];
            let row = &mut local.G[dof.v * n_vy..(dof.v + 1) * n_vy];
            for k in 0..n_vy {
                let mut x = T::ZERO;
                for r in 0..m {
                    x = of_unknown[r].mul_add(scratch.B[r * n_vy + k], x);
                }
                row[k] = -x;
            }
        }
        let good = if level == Level::Acceleration { sound & accurate } else { sound };
        (good, lever_ratio.unwrap_or(gain))
    }

    /// A = K_d of the block, B = K_i + K_before G_before.
    #[inline(always)]
    fn both_sides<T: Real, const M: usize>(&self, local: &mut Local<'_, T>) {
        let cluster = local.cluster;
        let m = self.width::<M>();
        let n_vy = cluster.n_vy;
        let scratch = &mut *local.scratch;
        let G = &*local.G;
        let A = &mut scratch.A;
        let B = &mut scratch.B;
        A[..m * m].fill(T::ZERO);
        B[..m * n_vy].fill(T::ZERO);
        for rows in &self.cuts {
            let at = RowsAt::new(rows, &cluster.cuts[rows.cut], &scratch.pose, local.q);
            let directions = at.directions();
            for (dof, side, column) in &rows.solve {
                at.column(&directions, dof, *side, |i, x| A[i * m + column] = x);
            }
            // an independent's row of G is a unit vector
            for (dof, side, column) in &rows.independent {
                at.column(&directions, dof, *side, |i, x| B[i * n_vy + column] = x);
            }
            for (dof, side) in &rows.earlier {
                let of_joint = &G[dof.v * n_vy..(dof.v + 1) * n_vy];
                at.column(&directions, dof, *side, |i, x| {
                    for (b, g) in B[i * n_vy..(i + 1) * n_vy].iter_mut().zip(of_joint) {
                        *b = x.mul_add(*g, *b);
                    }
                });
            }
        }
    }
}
