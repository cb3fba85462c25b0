//! One block of a numerical closure: Newton's method, G and g.

use nalgebra::Vector3;

use crate::closure::constraint::rows::{CutState, base, cos_sin, place, row_acceleration};
use crate::closure::numerical::End;
use crate::closure::numerical::inverse::{ANY, Inverted, accurate, invert, nearness};
use crate::closure::{Cut, Level, Local, NEAR, column_unit};
use crate::linalg::column_square;
use crate::mechanism::{Freedom, Motion, single_pose};
use crate::model::{Body, Cluster};
use crate::scalar::{Mask, Real};
use crate::spatial::{Pose, dot, zero};

/// Largest first step, in radians or cluster lengths.
const TRUST: f64 = 0.5;
/// Part of a block's distance to singularity that independents and first step may go: a longer way
/// could lead through a place where the loops do not close, and out of it on the other side.
const CAUTION: f64 = 0.7;
/// A Newton step must be at most this fraction of the one before.
const CONTRACTION: f64 = 0.3;

/// The blocks of a cluster in the order of solution.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    pub(crate) blocks: Vec<Block>,
    /// Bodies on the way to the cluster's cuts, in tree order, and those among them that the blocks
    /// leave without their pose.
    pub(crate) on_way: Vec<usize>,
    pub(crate) after: Vec<usize>,
}

/// A smallest set of rows that determines as many joints.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Local velocities that the block determines.
    pub(crate) unknowns: Vec<Freedom>,
    /// The cuts whose rows it holds.
    pub(crate) cuts: Vec<BlockCut>,
    /// Bodies that move with the unknowns and matter to the block, in tree order; true where the
    /// parent stands still and there is one freedom.
    pub(crate) bodies: Vec<(usize, bool)>,
    /// The other bodies on the way whose pose is not yet that of their coordinates, in tree order.
    pub(crate) before: Vec<usize>,
    /// Where its inverse lies in the scratch.
    pub(crate) offset: usize,
    /// True when the determinant at the old unknowns changes with the new y, so that the first step
    /// does not show its old sign.
    pub(crate) remember: bool,
}

/// The rows of one cut that a block holds.
#[derive(Clone, Debug)]
pub(crate) struct BlockCut {
    /// Index of the cut.
    pub(crate) cut: usize,
    /// (row of the cut, row of the block).
    pub(crate) rows: Vec<(usize, usize)>,
    /// The length that makes each of them a length, angles among them; empty where all are.
    pub(crate) units: Vec<f64>,
    /// What the rows have in common.
    pub(crate) kind: RowKind,
    /// Freedoms of the cut's path that the block determines, side (true = successor's), column.
    pub(crate) solve: Vec<(Freedom, bool, usize)>,
    /// Freedoms of the path that an earlier block determined, and the independents with their
    /// number.
    pub(crate) earlier: Vec<(Freedom, bool)>,
    pub(crate) independent: Vec<(Freedom, bool, usize)>,
}

/// What rows of one cut have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RowKind {
    /// A whole ball joint: the axes do not matter and those of the cluster's parent body are taken.
    Ball,
    /// Directions of the predecessor along which the points coincide.
    Linear,
    /// Angular rows or couplings among them.
    Any,
}

/// Calls a method with the block's width as a constant.
macro_rules! by_width {
    ($self:ident . $method:ident ( $($argument:expr),* )) => {
        match $self.unknowns.len() {
            1 => $self.$method::<T, 1>($($argument),*),
            2 => $self.$method::<T, 2>($($argument),*),
            3 => $self.$method::<T, 3>($($argument),*),
            _ => $self.$method::<T, ANY>($($argument),*),
        }
    };
}

impl Block {
    /// Newton's method for the block's unknowns; poses before the block are closed, its own are
    /// fresh before and after a good end. `branch` is the determinant at the old pose, `moved` how
    /// far the independents are from it, in radians or cluster lengths.
    #[inline]
    pub(in crate::closure) fn newton<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
        branch: Option<T>,
        moved: T,
        end: End,
    ) -> (T::Mask, u32) {
        by_width!(self.newton_of_width(cluster, bodies, local, branch, moved, end))
    }

    /// The determinant at the closed pose in `local`, whose poses are fresh.
    pub(in crate::closure) fn determinant<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        local: &mut Local<'_, T>,
    ) -> T {
        self.evaluate::<T, ANY>(cluster, local, true);
        self.invert::<T, ANY>(local).det
    }

    /// The block's rows of G at the closed pose: G_d = −K_d⁻¹ K_i, with the joints of earlier
    /// blocks on the right-hand side. The masks tell where they mean something and where the pose
    /// is near a singular one.
    #[inline]
    pub(in crate::closure) fn jacobian<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> (T::Mask, T::Mask) {
        by_width!(self.jacobian_of_width(cluster, local, level))
    }

    /// The block's rows of g from the bodies' rates and the inverse that [`Block::jacobian`] left:
    /// g_d = K_d⁻¹ (k − K_before g_before).
    #[inline]
    pub(in crate::closure) fn bias<T: Real>(
        &self,
        cuts: &[Cut<T::Const>],
        local: &mut Local<'_, T>,
    ) {
        by_width!(self.bias_of_width(cuts, local));
    }

    /// Inverse of A into the block's place.
    #[inline(always)]
    fn invert<T: Real, const M: usize>(&self, local: &mut Local<'_, T>) -> Inverted<T> {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        invert::<T, M>(
            &mut scratch.A[..m * m],
            &mut scratch.inverse[self.offset..self.offset + m * m],
            m,
        )
    }

    #[inline(always)]
    fn width<const M: usize>(&self) -> usize {
        if M == ANY { self.unknowns.len() } else { M }
    }

    fn newton_of_width<T: Real, const M: usize>(
        &self,
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
        branch: Option<T>,
        moved: T,
        end: End,
    ) -> (T::Mask, u32) {
        let m = self.width::<M>();
        let unknowns = &self.unknowns[..m];
        // what the next step would leave of a step below this is rounding
        let last = T::from_f64(0.1 * T::EPSILON.sqrt());
        let converged = end.tolerance.map_or(last, T::from_f64);
        let floor = T::from_f64(8.0 * T::EPSILON * cluster.length);
        let unit = T::from_f64(1.0 / cluster.length);
        // after a step below this size, ε^(3/8), the next one uses the same inverse: what is left
        // then is its cube
        let chord = T::from_f64(T::EPSILON.sqrt().sqrt() * T::EPSILON.sqrt().sqrt().sqrt());
        let (mut good, mut done) = (T::Mask::splat(true), T::Mask::splat(false));
        let mut previous = T::from_f64(TRUST / CONTRACTION);
        let (mut last_det, mut nearness) = (T::ZERO, T::ZERO);
        let mut taken = 0;
        // poses at the start; where the parent stands still, what a step does not change
        for &(j, held) in &self.bodies {
            let scratch = &mut *local.scratch;
            if held {
                scratch.base[j] = base(cluster, bodies, j, &scratch.pose);
            }
        }
        self.place(cluster, bodies, local);
        for k in 0..end.steps {
            // residual, and unless the last step was tiny the inverse
            let fresh = k == 0 || !previous.lt(chord).all();
            let residual = self.evaluate::<T, M>(cluster, local, fresh);
            if fresh {
                if k == 0 {
                    let scratch = &mut *local.scratch;
                    (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, m, i));
                }
                let Inverted { sound: fine, det, .. } = self.invert::<T, M>(local);
                if k == 0 {
                    last_det = match branch {
                        Some(branch) if self.remember => branch,
                        _ => det,
                    };
                    let scratch = &*local.scratch;
                    nearness = self::nearness(
                        &scratch.inverse[self.offset..self.offset + m * m],
                        &scratch.step[..m],
                        m,
                    );
                }
                let same_branch = T::ZERO.lt(det * last_det);
                last_det = det;
                good = good & (done | (fine & same_branch));
            }
            // step, in radians or cluster lengths
            let mut size = T::ZERO;
            let scratch = &mut *local.scratch;
            let (phi, steps) = (&scratch.phi[..m], &mut scratch.step[..m]);
            let inverse = &scratch.inverse[self.offset..self.offset + m * m];
            for i in 0..m {
                let mut step = T::ZERO;
                for r in 0..m {
                    step = inverse[i * m + r].mul_add(phi[r], step);
                }
                steps[i] = T::select(done, T::ZERO, step);
            }
            for (i, of) in unknowns.iter().enumerate() {
                of.advance(local.q, -steps[i]);
                let scaled = steps[i].abs();
                let scaled = if of.slides() { scaled * unit } else { scaled };
                size = T::select(size.lt(scaled), scaled, size);
            }
            taken += 1;
            if k == 0 {
                let way = T::select(size.lt(moved), moved, size);
                good = good
                    & size.lt(T::from_f64(TRUST))
                    & (way * way * nearness).lt(T::from_f64(CAUTION * CAUTION));
            }
            let contracts = size.lt(previous * T::from_f64(CONTRACTION));
            let mut at_floor = size.lt(converged) | residual.lt(floor);
            if end.tolerance.is_some() {
                // a tolerance below what rounding lets through
                at_floor = at_floor | (size.lt(last) & !contracts);
            }
            good = good & (done | at_floor | contracts);
            done = done | at_floor;
            if !good.any() {
                break;
            }
            previous = size;
            // sines and cosines follow a last tiny step by its first order; PRECISION: the second
            // is below half a unit roundoff
            let tiny = size.lt(last).all();
            for (i, of) in unknowns.iter().enumerate() {
                if of.motion == Motion::Revolute {
                    let (c, s) = local.turn[of.body];
                    let step = steps[i];
                    local.turn[of.body] = if tiny {
                        (s.mul_add(step, c), (-c).mul_add(step, s))
                    } else {
                        cos_sin(local.q[of.q])
                    };
                }
            }
            self.place(cluster, bodies, local);
            if done.all() {
                break;
            }
        }
        (good & (done | T::Mask::splat(end.tolerance.is_some())), taken)
    }

    /// Poses of the block's bodies from coordinates and turns.
    #[inline(always)]
    fn place<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
    ) {
        let scratch = &mut *local.scratch;
        for &(j, held) in &self.bodies {
            if held {
                let body = &bodies[j];
                scratch.pose[j + 1] =
                    single_pose(body, &scratch.base[j], local.q[body.q - cluster.q], local.turn[j]);
            } else {
                place(cluster, bodies, j, local.q, local.turn, &mut scratch.pose);
            }
        }
    }

    /// φ into the scratch and, if wanted, K of the unknowns; returns the largest |φ|.
    #[inline(always)]
    fn evaluate<T: Real, const M: usize>(
        &self,
        cluster: &Cluster<T::Const>,
        local: &mut Local<'_, T>,
        jacobian: bool,
    ) -> T {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let (phi, A) = (&mut scratch.phi[..m], &mut scratch.A[..m * m]);
        let mut largest = T::ZERO;
        if jacobian && self.cuts.len() > 1 {
            A.fill(T::ZERO);
        }
        for of in &self.cuts {
            let cut = &cluster.cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            let directions = of.directions(cut, &state);
            for (k, &(r, i)) in of.rows.iter().enumerate() {
                let value = match of.kind {
                    RowKind::Ball => state.d[k],
                    RowKind::Linear => dot(&directions.linear[k], &state.d),
                    RowKind::Any => of.in_lengths(k, state.value(cluster, &cut.rows[r], local.q)),
                };
                phi[i] = value;
                largest = T::select(largest.lt(value.abs()), value.abs(), largest);
            }
            if jacobian {
                for (on, side, column) in &of.solve {
                    of.column(
                        cut,
                        &state,
                        &directions,
                        on,
                        *side,
                        &scratch.pose[on.body + 1],
                        |i, x| A[i * m + column] = x,
                    );
                }
            }
        }
        largest
    }

    fn jacobian_of_width<T: Real, const M: usize>(
        &self,
        cluster: &Cluster<T::Const>,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> (T::Mask, T::Mask) {
        let (m, n_vy) = (self.width::<M>(), cluster.n_vy);
        let scratch = &mut *local.scratch;
        let G = &mut *local.G;
        scratch.A[..m * m].fill(T::ZERO);
        scratch.B[..m * n_vy].fill(T::ZERO);
        for of in &self.cuts {
            let cut = &cluster.cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            let directions = of.directions(cut, &state);
            for (on, side, column) in &of.solve {
                of.column(
                    cut,
                    &state,
                    &directions,
                    on,
                    *side,
                    &scratch.pose[on.body + 1],
                    |i, x| scratch.A[i * m + column] = x,
                );
            }
            // an independent's row of G is a unit vector
            for (on, side, column) in &of.independent {
                of.column(
                    cut,
                    &state,
                    &directions,
                    on,
                    *side,
                    &scratch.pose[on.body + 1],
                    |i, x| scratch.B[i * n_vy + column] = x,
                );
            }
            for (on, side) in &of.earlier {
                let of_joint = &G[on.v * n_vy..(on.v + 1) * n_vy];
                of.column(
                    cut,
                    &state,
                    &directions,
                    on,
                    *side,
                    &scratch.pose[on.body + 1],
                    |i, x| {
                        for (b, g) in scratch.B[i * n_vy..(i + 1) * n_vy].iter_mut().zip(of_joint) {
                            *b = x.mul_add(*g, *b);
                        }
                    },
                );
            }
        }
        let wide = m > 3;
        let scratch = &mut *local.scratch;
        if wide {
            (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, m, i));
        }
        // one row is near singular where its independents move it far more than its unknown
        let alone = (m == 1).then(|| {
            let square = |x: T, v: usize| {
                (x * x) * T::from_f64(column_unit(cluster, v) * column_unit(cluster, v))
            };
            let moves = (scratch.B[..n_vy].iter().zip(&cluster.independent))
                .fold(T::ZERO, |sum, (b, v)| sum + square(*b, *v));
            square(scratch.A[0], self.unknowns[0].v).lt(moves * T::from_f64(NEAR))
        });
        let Inverted { sound, mut accurate, mut near, .. } = self.invert::<T, M>(local);
        let scratch = &*local.scratch;
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        if let Some(alone) = alone {
            near = alone;
        }
        if wide {
            let nearness = nearness(inverse, &scratch.step[..m], m);
            (accurate, near) =
                (self::accurate(T::ONE, nearness), T::from_f64(1.0 / NEAR).lt(nearness));
        }
        for (i, of) in self.unknowns[..m].iter().enumerate() {
            let row = &mut local.G[of.v * n_vy..(of.v + 1) * n_vy];
            for k in 0..n_vy {
                let mut x = T::ZERO;
                for r in 0..m {
                    x = inverse[i * m + r].mul_add(scratch.B[r * n_vy + k], x);
                }
                row[k] = -x;
            }
        }
        (if level == Level::Acceleration { sound & accurate } else { sound }, near)
    }

    fn bias_of_width<T: Real, const M: usize>(
        &self,
        cuts: &[Cut<T::Const>],
        local: &mut Local<'_, T>,
    ) {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let g = &mut *local.g;
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            let second =
                state.acceleration(cut, &scratch.pose, &scratch.rate, of.kind == RowKind::Ball);
            for (k, &(r, i)) in of.rows.iter().enumerate() {
                scratch.B[i] = if of.kind == RowKind::Ball {
                    -second.0[k]
                } else {
                    -of.in_lengths(
                        k,
                        row_acceleration(cut, &cut.rows[r], &state, &second, &scratch.rate),
                    )
                };
            }
            if !of.earlier.is_empty() {
                let directions = of.directions(cut, &state);
                for (on, side) in &of.earlier {
                    of.column(
                        cut,
                        &state,
                        &directions,
                        on,
                        *side,
                        &scratch.pose[on.body + 1],
                        |i, x| {
                            scratch.B[i] = (-x).mul_add(g[on.v], scratch.B[i]);
                        },
                    );
                }
            }
        }
        let (inverse, B) = (&scratch.inverse[self.offset..self.offset + m * m], &scratch.B[..m]);
        for (i, of) in self.unknowns[..m].iter().enumerate() {
            let mut x = T::ZERO;
            for r in 0..m {
                x = inverse[i * m + r].mul_add(B[r], x);
            }
            g[of.v] = x;
        }
    }
}

/// Linear and angular directions of the rows of a cut.
struct Directions<T> {
    linear: [Vector3<T>; 6],
    angular: [Vector3<T>; 6],
}

impl BlockCut {
    /// Directions of the rows, in their order here.
    #[inline(always)]
    fn directions<T: Real>(&self, cut: &Cut<T::Const>, state: &CutState<'_, T>) -> Directions<T> {
        let mut directions = Directions { linear: [zero(); 6], angular: [zero(); 6] };
        if self.kind != RowKind::Ball {
            for (k, &(r, _)) in self.rows.iter().enumerate() {
                (directions.linear[k], directions.angular[k]) = state.directions(&cut.rows[r]);
            }
        }
        directions
    }

    /// A number of row k in the unit of the others, so that the block's determinant and residual
    /// mean something.
    #[inline(always)]
    fn in_lengths<T: Real>(&self, k: usize, x: T) -> T {
        match self.units.get(k) {
            Some(unit) => x * T::from_f64(*unit),
            None => x,
        }
    }

    /// Calls `each(row of the block, entry of K)` for one freedom.
    #[inline(always)]
    fn column<T: Real>(
        &self,
        cut: &Cut<T::Const>,
        state: &CutState<'_, T>,
        directions: &Directions<T>,
        on: &Freedom,
        on_successor: bool,
        pose: &Pose<T>,
        mut each: impl FnMut(usize, T),
    ) {
        let (w, v) = state.twist(on, pose, on_successor);
        match self.kind {
            RowKind::Ball => {
                for (k, &(_, i)) in self.rows.iter().enumerate() {
                    each(i, v[k]);
                }
                return;
            }
            RowKind::Linear => {
                for (k, &(_, i)) in self.rows.iter().enumerate() {
                    each(i, dot(&directions.linear[k], &v));
                }
                return;
            }
            RowKind::Any => {}
        }
        for (k, &(r, i)) in self.rows.iter().enumerate() {
            let terms = &cut.rows[r].terms;
            let entry = if terms.is_empty() {
                let entry = dot(&directions.linear[k], &v);
                if cut.angular { entry + dot(&directions.angular[k], &w) } else { entry }
            } else {
                terms.iter().find(|(v, _)| *v == on.v).map_or(T::ZERO, |(_, c)| T::lift(*c))
            };
            each(i, self.in_lengths(k, entry));
        }
    }
}
