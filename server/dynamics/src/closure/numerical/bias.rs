//! The part of g that a block determines: g_d = K_d⁻¹ (k − K_before g_before).

use crate::closure::Local;
use crate::closure::constraint::rows::row_acceleration;
use crate::closure::numerical::block::{Block, RowKind, RowsAt, by_width};
use crate::mechanism::Cut;
use crate::scalar::Real;

impl Block {
    /// The block's rows of g from the bodies' rates and the inverse that [`Block::jacobian`] left:
    /// g_d = K_d⁻¹ (k − K_before g_before).
    #[inline]
    pub(super) fn bias<T: Real>(&self, local: &mut Local<'_, T>) {
        let cluster = local.cluster;
        match (self.series.filter(|_| T::UNROLLED), self.unknowns.len()) {
            (Some(_), 1) => self.bias_in_series::<T, 1>(local),
            (Some(_), 2) => self.bias_in_series::<T, 2>(local),
            (Some(_), _) => self.bias_in_series::<T, 3>(local),
            _ => by_width!(self.bias_of_width(&cluster.cuts, local)),
        }
    }

    fn bias_of_width<T: Real, const M: usize>(&self, cuts: &[Cut<T>], local: &mut Local<'_, T>) {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let g = &mut *local.g;
        for rows in &self.cuts {
            let at = RowsAt::new(rows, &cuts[rows.cut], &scratch.pose, local.q);
            let ball = rows.kind == RowKind::Ball;
            let second = at.state.acceleration(at.cut, at.pose, &scratch.rate, ball);
            for (k, &(r, i)) in rows.rows.iter().enumerate() {
                let row = &at.cut.rows[r];
                scratch.B[i] = if ball {
                    -second.0[k]
                } else {
                    let rate = &scratch.rate;
                    let acceleration = row_acceleration(at.cut, row, &at.state, &second, rate);
                    rows.in_lengths(k, row.bend(local.q, local.qd) - acceleration)
                };
            }
            if !rows.earlier.is_empty() {
                let directions = at.directions();
                for (dof, side) in &rows.earlier {
                    at.column(&directions, dof, *side, |i, x| {
                        scratch.B[i] = (-x).mul_add(g[dof.v], scratch.B[i]);
                    });
                }
            }
        }
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        let B = &scratch.B[..m];
        for (i, dof) in self.unknowns[..m].iter().enumerate() {
            let row = &inverse[i * m..(i + 1) * m];
            let mut x = T::ZERO;
            for r in 0..m {
                x = row[r].mul_add(B[r], x);
            }
            g[dof.v] = x;
        }
    }
}
