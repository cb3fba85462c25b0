//! One block of a numerical closure: Newton's method, its inverse, G and g.

use nalgebra::Vector3;

use super::rows::{CutState, cos_sin, place, row_acceleration};
use super::{Cut, Local, Scratch};
use crate::linear::solve_unpivoted;
use crate::model::{Body, Cluster, Freedom, Motion};
use crate::scalar::{Mask, Real};
use crate::spatial::{Pose, dot, zero};

/// Largest first step, in radians or cluster lengths.
const TRUST: f64 = 0.5;
/// Part of a block's distance to singularity that independents and first step may go: a longer way could lead through a place where the
/// loops do not close, and out of it on the other side.
const CAUTION: f64 = 0.7;
/// A Newton step must be at most this fraction of the one before.
const CONTRACTION: f64 = 0.3;
/// Least pivot of a wide block against its row.
const SINGULAR: f64 = 1e-12;
/// Least determinant of a narrow block against the product of its column norms, in roots of the unit roundoff: a pose closer to
/// singularity than that is known to no digit.
const ROOTS: f64 = 10.0;

/// A smallest set of rows that determines as many joints.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Local velocities that the block determines.
    pub(crate) unknowns: Vec<Freedom>,
    /// The cuts whose rows it holds.
    pub(crate) cuts: Vec<BlockCut>,
    /// Bodies that move with the unknowns and matter to the block, in tree order.
    pub(crate) bodies: Vec<usize>,
    /// Bodies on the way that earlier blocks moved.
    pub(crate) stale: Vec<usize>,
    /// Where its inverse lies in the scratch.
    pub(crate) offset: usize,
    /// True when the determinant at the old unknowns changes with the new y, so that the first step does not show its old sign.
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
    /// True when the rows are a whole ball joint: then the axes do not matter and those of the cluster's parent body are taken.
    pub(crate) ball: bool,
    /// Freedoms of the cut's path that the block determines, side (true = successor's), column.
    pub(crate) solve: Vec<(Freedom, bool, usize)>,
    /// Freedoms of the path that are known before, and those among them that an earlier block determined.
    pub(crate) known: Vec<(Freedom, bool)>,
    pub(crate) earlier: Vec<(Freedom, bool)>,
}

/// The width of a block as the compiler sees it: 1 to 3 are written out, `ANY` is read from the block.
const ANY: usize = 0;

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
    /// Newton's method for the block's unknowns; poses before the block are closed, its own are fresh before and after a good end. `branch` is
    /// the determinant at the old pose, `moved` how far the independents are from it, in radians or cluster lengths.
    #[inline]
    pub(super) fn newton<T: Real>(
        &self,
        cluster: &Cluster<T::Const>,
        bodies: &[Body<T::Const>],
        local: &mut Local<'_, T>,
        branch: Option<T>,
        moved: T,
        steps: u32,
    ) -> (T::Mask, u32) {
        by_width!(self.newton_of_width(cluster, bodies, local, branch, moved, steps))
    }

    /// The determinant at the closed pose in `local`, whose poses are fresh.
    pub(super) fn determinant<T: Real>(&self, cluster: &Cluster<T::Const>, local: &mut Local<'_, T>) -> T {
        self.evaluate::<T, ANY>(cluster, local, true);
        self.invert::<T, ANY>(local.scratch).1
    }

    /// The block's rows of G at the closed pose: G_d = −K_d⁻¹ K_i, with the joints of earlier blocks on the right-hand side.
    #[inline]
    pub(super) fn jacobian<T: Real>(&self, n_vy: usize, cuts: &[Cut<T::Const>], local: &mut Local<'_, T>) -> T::Mask {
        by_width!(self.jacobian_of_width(n_vy, cuts, local))
    }

    /// The block's rows of g from the bodies' rates and the inverse that [`Block::jacobian`] left: g_d = K_d⁻¹ (k − K_before g_before).
    #[inline]
    pub(super) fn bias<T: Real>(&self, cuts: &[Cut<T::Const>], local: &mut Local<'_, T>) {
        by_width!(self.bias_of_width(cuts, local));
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
        steps: u32,
    ) -> (T::Mask, u32) {
        let m = self.width::<M>();
        let unknowns = &self.unknowns[..m];
        let converged = T::from_f64(0.1 * T::EPSILON.sqrt());
        let floor = T::from_f64(8.0 * T::EPSILON * cluster.length);
        let unit = T::from_f64(1.0 / cluster.length);
        // after a step below this size, ε^(3/8), the next one uses the same inverse: what is left then is its cube
        let chord = T::from_f64(T::EPSILON.sqrt().sqrt() * T::EPSILON.sqrt().sqrt().sqrt());
        let (mut good, mut done) = (T::Mask::splat(true), T::Mask::splat(false));
        let mut previous = T::from_f64(TRUST / CONTRACTION);
        let (mut last_det, mut nearness) = (T::ZERO, T::ZERO);
        let mut taken = 0;
        for k in 0..steps {
            // residual, and unless the last step was tiny the inverse
            let fresh = k == 0 || !previous.lt(chord).all();
            let residual = self.evaluate::<T, M>(cluster, local, fresh);
            if fresh {
                if k == 0 {
                    let scratch = &mut *local.scratch;
                    (0..m).for_each(|i| scratch.step[i] = column_square(&scratch.A, m, i));
                }
                let (fine, det) = self.invert::<T, M>(local.scratch);
                if k == 0 {
                    last_det = match branch {
                        Some(branch) if self.remember => branch,
                        _ => det,
                    };
                    nearness = self.nearness::<T, M>(local.scratch);
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
                good = good & size.lt(T::from_f64(TRUST)) & (way * way * nearness).lt(T::from_f64(CAUTION * CAUTION));
            }
            let at_floor = size.lt(converged) | residual.lt(floor);
            good = good & (done | at_floor | size.lt(previous * T::from_f64(CONTRACTION)));
            done = done | at_floor;
            if !good.any() {
                break;
            }
            previous = size;
            // sines and cosines follow a last tiny step by its first order; PRECISION: the second is below half a unit roundoff
            let tiny = size.lt(converged).all();
            for (i, of) in unknowns.iter().enumerate() {
                if of.motion == Motion::Revolute {
                    let (c, s) = local.turn[of.body];
                    let step = steps[i];
                    local.turn[of.body] = if tiny { (s.mul_add(step, c), (-c).mul_add(step, s)) } else { cos_sin(local.q[of.q]) };
                }
            }
            for &j in &self.bodies {
                place(cluster, bodies, j, local.q, local.turn, &mut scratch.pose);
            }
            if done.all() {
                break;
            }
        }
        (good & done, taken)
    }

    /// 1/sin² of the least angle between a column of the block, whose squared norms stand in `step`, and the span of the others: the inverse's
    /// row i is 1/sin over the column's norm.
    #[inline(always)]
    fn nearness<T: Real, const M: usize>(&self, scratch: &Scratch<T>) -> T {
        let m = self.width::<M>();
        let inverse = &scratch.inverse[self.offset..self.offset + m * m];
        let mut nearness = T::ZERO;
        for i in 0..m {
            let row = inverse[i * m..(i + 1) * m].iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum)) * scratch.step[i];
            nearness = T::select(nearness.lt(row), row, nearness);
        }
        nearness
    }

    /// φ into the scratch and, if wanted, K of the unknowns; returns the largest |φ|.
    #[inline(always)]
    fn evaluate<T: Real, const M: usize>(&self, cluster: &Cluster<T::Const>, local: &mut Local<'_, T>, jacobian: bool) -> T {
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
            for (k, &(r, i)) in of.rows.iter().enumerate() {
                let value = if of.ball { state.d[k] } else { of.in_lengths(k, state.value(cluster, &cut.rows[r], local.q)) };
                phi[i] = value;
                largest = T::select(largest.lt(value.abs()), value.abs(), largest);
            }
            if jacobian {
                let directions = of.directions(cut, &state);
                for (on, side, column) in &of.solve {
                    of.column(cut, &state, &directions, on, *side, &scratch.pose[on.body + 1], |i, x| A[i * m + column] = x);
                }
            }
        }
        largest
    }

    /// Inverse of A into the scratch: closed form up to 3×3, elimination in the order fixed at load beyond. Returns where it is sound,
    /// and the determinant.
    #[inline(always)]
    fn invert<T: Real, const M: usize>(&self, scratch: &mut Scratch<T>) -> (T::Mask, T) {
        let m = self.width::<M>();
        let A = &mut scratch.A[..m * m];
        let inverse = &mut scratch.inverse[self.offset..self.offset + m * m];
        match m {
            1 => {
                inverse[0] = T::ONE / A[0];
                (T::ZERO.lt(A[0].abs()), A[0])
            }
            2 => {
                let det = A[0].mul_add(A[3], -(A[1] * A[2]));
                let d = T::ONE / det;
                (inverse[0], inverse[1], inverse[2], inverse[3]) = (A[3] * d, -(A[1] * d), -(A[2] * d), A[0] * d);
                (sound(A, 2, det), det)
            }
            3 => {
                let minor = |a: usize, b: usize, c: usize, d: usize, A: &[T]| A[a].mul_add(A[d], -(A[b] * A[c]));
                let (c0, c1, c2) = (minor(4, 5, 7, 8, A), minor(5, 3, 8, 6, A), minor(3, 4, 6, 7, A));
                let det = A[0].mul_add(c0, A[1].mul_add(c1, A[2] * c2));
                let d = T::ONE / det;
                let adjugate = [
                    c0,
                    minor(2, 1, 8, 7, A),
                    minor(1, 2, 4, 5, A),
                    c1,
                    minor(0, 2, 6, 8, A),
                    minor(2, 0, 5, 3, A),
                    c2,
                    minor(1, 0, 7, 6, A),
                    minor(0, 1, 3, 4, A),
                ];
                for (x, y) in inverse.iter_mut().zip(adjugate) {
                    *x = y * d;
                }
                (sound(A, 3, det), det)
            }
            _ => {
                for (k, x) in inverse.iter_mut().enumerate() {
                    *x = if k / m == k % m { T::ONE } else { T::ZERO };
                }
                solve_unpivoted(A, inverse, m, m, SINGULAR)
            }
        }
    }

    fn jacobian_of_width<T: Real, const M: usize>(&self, n_vy: usize, cuts: &[Cut<T::Const>], local: &mut Local<'_, T>) -> T::Mask {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let G = &mut *local.G;
        scratch.A[..m * m].fill(T::ZERO);
        scratch.B[..m * n_vy].fill(T::ZERO);
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            let directions = of.directions(cut, &state);
            for (on, side, column) in &of.solve {
                of.column(cut, &state, &directions, on, *side, &scratch.pose[on.body + 1], |i, x| scratch.A[i * m + column] = x);
            }
            for (on, side) in &of.known {
                let of_joint = &G[on.v * n_vy..(on.v + 1) * n_vy];
                of.column(cut, &state, &directions, on, *side, &scratch.pose[on.body + 1], |i, x| {
                    for (b, g) in scratch.B[i * n_vy..(i + 1) * n_vy].iter_mut().zip(of_joint) {
                        *b = x.mul_add(*g, *b);
                    }
                });
            }
        }
        let (good, _) = self.invert::<T, M>(local.scratch);
        for (i, of) in self.unknowns.iter().enumerate() {
            for k in 0..n_vy {
                let mut x = T::ZERO;
                for r in 0..m {
                    x = local.scratch.inverse[self.offset + i * m + r].mul_add(local.scratch.B[r * n_vy + k], x);
                }
                local.G[of.v * n_vy + k] = -x;
            }
        }
        good
    }

    fn bias_of_width<T: Real, const M: usize>(&self, cuts: &[Cut<T::Const>], local: &mut Local<'_, T>) {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let g = &mut *local.g;
        for of in &self.cuts {
            let cut = &cuts[of.cut];
            let state = CutState::new(cut, &scratch.pose);
            let second = state.acceleration(cut, &scratch.pose, &scratch.rate, of.ball);
            for (k, &(r, i)) in of.rows.iter().enumerate() {
                scratch.B[i] = if of.ball {
                    -second.0[k]
                } else {
                    -of.in_lengths(k, row_acceleration(cut, &cut.rows[r], &state, &second, &scratch.rate))
                };
            }
            if !of.earlier.is_empty() {
                let directions = of.directions(cut, &state);
                for (on, side) in &of.earlier {
                    of.column(cut, &state, &directions, on, *side, &scratch.pose[on.body + 1], |i, x| {
                        scratch.B[i] = (-x).mul_add(g[on.v], scratch.B[i]);
                    });
                }
            }
        }
        for (i, of) in self.unknowns.iter().enumerate() {
            let mut x = T::ZERO;
            for r in 0..m {
                x = scratch.inverse[self.offset + i * m + r].mul_add(scratch.B[r], x);
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
        if !self.ball {
            for (k, &(r, _)) in self.rows.iter().enumerate() {
                (directions.linear[k], directions.angular[k]) = state.directions(&cut.rows[r]);
            }
        }
        directions
    }

    /// A number of row k in the unit of the others, so that the block's determinant and residual mean something.
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
        if self.ball {
            for (k, &(_, i)) in self.rows.iter().enumerate() {
                each(i, v[k]);
            }
            return;
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

/// Product of the squared column norms of a square matrix: turning and sliding joints have columns of different units.
#[inline(always)]
fn column_squares<T: Real>(A: &[T], m: usize) -> T {
    (0..m).fold(T::ONE, |product, j| product * column_square(A, m, j))
}

/// Squared norm of column j of a square matrix.
#[inline(always)]
fn column_square<T: Real>(A: &[T], m: usize, j: usize) -> T {
    (0..m).fold(T::ZERO, |sum, i| A[i * m + j].mul_add(A[i * m + j], sum))
}

/// |det| against the product of the column norms.
#[inline]
fn sound<T: Real>(A: &[T], m: usize, det: T) -> T::Mask {
    (column_squares(&A[..m * m], m) * T::from_f64(ROOTS * ROOTS * T::EPSILON)).lt(det * det)
}
