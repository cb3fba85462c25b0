//! The data of a block of a numerical closure, and its residual and Jacobian at a pose.

use nalgebra::Vector3;

use crate::closure::constraint::rates::rate_of;
use crate::closure::constraint::rows::{CutState, place};
use crate::closure::numerical::elimination::Elimination;
use crate::closure::numerical::inverse::{
    ANY, Inverted, ROOTS, accurate, inverse_square_sines, invert,
};
use crate::closure::{Level, Local, Rate};
use crate::mechanism::{Cut, Dof, single_pose};
use crate::scalar::{Real, Triple};
use crate::spatial::{Pose, zero};

/// The blocks of a cluster in the order of solution.
#[derive(Clone, Debug)]
pub(crate) struct Blocks {
    pub(crate) blocks: Vec<Block>,
    /// Bodies on the paths to the cluster's cuts, in tree order, and those whose pose no block
    /// computes.
    pub(crate) on_way: Vec<usize>,
    pub(crate) after: Vec<usize>,
}

// operations of a body's pose, of a row of the residual, of an entry of the Jacobian
const POSE: usize = 60;
const ROW: usize = 20;
const ENTRY: usize = 8;

/// A smallest set of rows that determines as many joints.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    /// Local velocities that the block determines.
    pub(crate) unknowns: Vec<Dof>,
    /// The cuts of its rows.
    pub(crate) cuts: Vec<BlockCut>,
    /// Bodies of the block that move with the unknowns, in tree order; true if the parent does not
    /// move and the joint has one degree of freedom.
    pub(crate) bodies: Vec<(usize, bool)>,
    /// The other bodies on these paths whose pose is not yet up to date, in tree order.
    pub(crate) before: Vec<usize>,
    /// The earlier blocks that determined joints on these paths.
    pub(crate) earlier: Vec<usize>,
    /// Offset of its inverse in the scratch.
    pub(crate) offset: usize,
    /// Its zeros, for more than three rows.
    pub(crate) elimination: Option<Elimination>,
    /// Where up to three unknowns are joints in series that carry one end of the only cut, whose
    /// rows are linear: whether that is the successor's.
    pub(crate) series: Option<bool>,
    /// Squares of the columns' norms where they are long: a column that is much shorter belongs to
    /// a joint whose axis passes near the point that it moves.
    pub(crate) sizes: Vec<f64>,
    /// Their product.
    pub(crate) volume: f64,
    /// Squares of the levers of two or three unknowns where the rows may see a small part of them:
    /// columns that are short turn quickly. Else zero.
    pub(crate) levers: [f64; 3],
    /// All of its rows are couplings: one step of any length solves them.
    pub(crate) couples: bool,
    /// True when the determinant at the old unknowns changes with the new y, so that the first step
    /// does not show its old sign.
    pub(crate) remember: bool,
    /// Operations of one Newton step, see [`Block::operations`].
    pub(crate) work: u64,
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
    /// Kind of the rows.
    pub(crate) kind: RowKind,
    /// Freedoms of the cut's path that the block determines, side (true = successor's), column.
    pub(crate) solve: Vec<(Dof, bool, usize)>,
    /// Freedoms of the path that an earlier block determined, and the independents with their
    /// number.
    pub(crate) earlier: Vec<(Dof, bool)>,
    pub(crate) independent: Vec<(Dof, bool, usize)>,
}

/// The kind that the rows of one cut share.
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
            1 if T::UNROLLED => $self.$method::<T, 1>($($argument),*),
            2 if T::UNROLLED => $self.$method::<T, 2>($($argument),*),
            3 if T::UNROLLED => $self.$method::<T, 3>($($argument),*),
            _ => $self.$method::<T, { $crate::closure::numerical::inverse::ANY }>($($argument),*),
        }
    };
}
pub(super) use by_width;

impl Blocks {
    /// The levels below the position at the closed pose: G, q̇, then g; where they mean something.
    #[inline]
    pub(in crate::closure) fn rates<T: Real>(
        &self,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> bool {
        let &mut Local { cluster, bodies, .. } = local;
        let m = cluster.n_vy;
        for (k, &j) in cluster.independent.iter().enumerate() {
            local.G[j * m..(j + 1) * m].fill(T::ZERO);
            local.G[j * m + k] = T::ONE;
            local.g[j] = T::ZERO;
        }
        // G block by block: G_d = −K_d⁻¹ K_i
        let mut good = true;
        let Blocks { blocks, on_way, .. } = self;
        for (b, block) in blocks.iter().enumerate() {
            let (sound, own) = block.jacobian(local, level);
            block.multiply_gain(b, own, &mut local.scratch.gain);
            good &= sound;
        }
        if level == Level::Jacobian {
            return good;
        }
        for block in blocks {
            for &Dof { v: j, .. } in &block.unknowns {
                let mut qd = T::ZERO;
                for (k, &i) in cluster.independent.iter().enumerate() {
                    qd = local.G[j * m + k].mul_add(local.qd[i], qd);
                }
                local.qd[j] = qd;
            }
        }
        if level >= Level::Acceleration {
            let scratch = &mut *local.scratch;
            scratch.rate[0] = Rate::at_rest();
            for &j in on_way {
                rate_of(cluster, bodies, j, local.qd, &scratch.pose, &mut scratch.rate);
            }
            for block in blocks {
                block.bias(local);
            }
        }
        good
    }
}

impl Block {
    /// Estimate of the operations of one Newton step: poses, residual, Jacobian, inverse and step;
    /// those on whole rows of a wide block count half, as the processor does several at once, and
    /// all of a block in series three fifths, as its variables stay in registers.
    pub(crate) fn operations(&self) -> u64 {
        let m = self.unknowns.len();
        let columns: usize = self.cuts.iter().map(|cut| cut.rows.len() * cut.solve.len()).sum();
        let inverse = match &self.elimination {
            None => 3 * m * m * m,
            Some(elimination) => elimination.operations() / 2 + m * m,
        };
        let all = POSE * self.bodies.len() + ROW * m + ENTRY * columns + inverse + m * m;
        (if self.series.is_some() { all * 3 / 5 } else { all }) as u64
    }

    /// The determinant at the closed pose in `local`, whose poses are fresh.
    pub(super) fn determinant<T: Real>(&self, local: &mut Local<'_, T>) -> T {
        self.evaluate::<T, ANY>(local, true);
        self.invert::<T, ANY>(local).det
    }

    /// 1/sin² of the angle that vanishes at a singular pose, at the pose in `local`, whose poses
    /// are fresh; infinite where the block cannot be inverted.
    pub(super) fn gain<T: Real>(&self, local: &mut Local<'_, T>) -> T {
        let cluster = local.cluster;
        self.evaluate::<T, ANY>(local, true);
        let inverted = self.invert::<T, ANY>(local);
        match (inverted.sound, self.unknowns.len()) {
            (false, _) => T::from_f64(f64::INFINITY),
            (_, 1) => self.lever_gain_of(cluster, local.scratch.inverse[self.offset]),
            _ => inverted.gain,
        }
    }

    /// 1/sin²α of the rule of an attempt at the pose in `local`, whose poses are fresh; infinite
    /// where the block cannot be inverted.
    pub(super) fn near<T: Real>(&self, local: &mut Local<'_, T>) -> T {
        self.evaluate::<T, ANY>(local, true);
        let inverted = self.invert::<T, ANY>(local);
        if inverted.sound { inverted.near } else { T::from_f64(f64::INFINITY) }
    }

    /// The gain of this block b, which multiplies that of the blocks before it.
    #[inline(always)]
    pub(super) fn multiply_gain<T: Real>(&self, b: usize, own: T, gains: &mut [T]) {
        let before = self.earlier.iter().fold(T::ONE, |gain, a| T::larger(gain, gains[*a]));
        gains[b] = T::larger(T::ONE, own) * before;
    }

    /// Inverse of A into the block's place.
    #[inline(always)]
    pub(super) fn invert<T: Real, const M: usize>(&self, local: &mut Local<'_, T>) -> Inverted<T> {
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let A = &mut scratch.A[..m * m];
        let inverse = &mut scratch.inverse[self.offset..self.offset + m * m];
        if m <= 3 {
            return invert::<T, M>(A, inverse, self.volume, m);
        }
        let squares = &mut scratch.step[..m];
        squares.fill(T::ZERO);
        for row in A.chunks_exact(m) {
            squares.iter_mut().zip(row).for_each(|(x, a)| *x = a.mul_add(*a, *x));
        }
        let inverted = match &self.elimination {
            Some(elimination) => elimination.invert(A, inverse, &mut scratch.spare),
            None => invert::<T, M>(A, inverse, self.volume, m),
        };
        let [near, gain] = inverse_square_sines(inverse, squares, &self.sizes, m);
        let sound = inverted.sound & (near * T::from_f64(ROOTS * ROOTS * T::EPSILON)).lt(T::ONE);
        Inverted { sound, accurate: accurate(T::ONE, near), near, gain, ..inverted }
    }

    /// 1/sin²α of a narrow block, whose columns have these squares, for the trust region: each
    /// column counts as its lever where that is longer.
    #[inline(always)]
    pub(super) fn trust_gain<T: Real>(&self, inverse: &[T], squares: &[T]) -> T {
        inverse_square_sines(inverse, squares, &self.levers, squares.len())[1]
    }

    #[inline(always)]
    pub(super) fn width<const M: usize>(&self) -> usize {
        if M == ANY { self.unknowns.len() } else { M }
    }

    /// Poses of the block's bodies from coordinates and their cosines and sines.
    #[inline(always)]
    pub(super) fn place<T: Real>(&self, local: &mut Local<'_, T>) {
        let &mut Local { cluster, bodies, .. } = local;
        let scratch = &mut *local.scratch;
        for &(j, held) in &self.bodies {
            if held {
                let body = &bodies[j];
                let cos_sin = local.cos_sin[j];
                let q = local.q[body.q - cluster.q];
                scratch.pose[j + 1] = single_pose(body, &scratch.base[j], q, cos_sin);
            } else {
                place(cluster, bodies, j, local.q, local.cos_sin, &mut scratch.pose);
            }
        }
    }

    /// φ into the scratch and, if `jacobian`, K of the unknowns into A; returns the largest |φ|.
    #[inline(always)]
    pub(super) fn evaluate<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        jacobian: bool,
    ) -> T {
        let cluster = local.cluster;
        let m = self.width::<M>();
        let scratch = &mut *local.scratch;
        let phi = &mut scratch.phi[..m];
        let A = &mut scratch.A[..m * m];
        let mut largest = T::ZERO;
        if jacobian && self.cuts.len() > 1 {
            A.fill(T::ZERO);
        }
        for rows in &self.cuts {
            let at = RowsAt::new(rows, &cluster.cuts[rows.cut], &scratch.pose, local.q);
            let directions = at.directions();
            for (k, &(r, i)) in rows.rows.iter().enumerate() {
                let value = match rows.kind {
                    RowKind::Ball => at.state.d[k],
                    RowKind::Linear => directions.linear[k].dot(at.state.d),
                    RowKind::Any => {
                        rows.in_lengths(k, at.state.value(cluster, &at.cut.rows[r], local.q))
                    }
                };
                phi[i] = value;
                largest = T::select_lt(largest, value.abs(), value.abs(), largest);
            }
            if jacobian {
                for (dof, side, column) in &rows.solve {
                    at.column(&directions, dof, *side, |i, x| A[i * m + column] = x);
                }
            }
        }
        largest
    }
}

/// Linear and angular directions of the rows of a cut.
pub(super) struct Directions<T> {
    linear: [Vector3<T>; 6],
    angular: [Vector3<T>; 6],
}

/// The rows of one cut that a block holds, at one pose.
pub(super) struct RowsAt<'a, T: Real> {
    pub(super) rows: &'a BlockCut,
    pub(super) cut: &'a Cut<T>,
    pub(super) pose: &'a [Pose<T>],
    q: &'a [T],
    pub(super) state: CutState<'a, T>,
}

impl<'a, T: Real> RowsAt<'a, T> {
    #[inline(always)]
    pub(super) fn new(
        rows: &'a BlockCut,
        cut: &'a Cut<T>,
        pose: &'a [Pose<T>],
        q: &'a [T],
    ) -> RowsAt<'a, T> {
        let state = match rows.kind {
            RowKind::Any => CutState::new(cut, pose),
            _ => CutState::linear(cut, pose),
        };
        RowsAt { rows, cut, pose, q, state }
    }

    /// Directions of the rows, in their order here.
    #[inline(always)]
    pub(super) fn directions(&self) -> Directions<T> {
        let mut directions = Directions { linear: [zero(); 6], angular: [zero(); 6] };
        if self.rows.kind != RowKind::Ball {
            for (k, &(r, _)) in self.rows.rows.iter().enumerate() {
                (directions.linear[k], directions.angular[k]) =
                    self.state.directions(&self.cut.rows[r]);
            }
        }
        directions
    }

    /// Calls `each(row of the block, entry of K)` for one degree of freedom.
    #[inline(always)]
    pub(super) fn column(
        &self,
        directions: &Directions<T>,
        dof: &Dof,
        on_successor: bool,
        mut each: impl FnMut(usize, T),
    ) {
        let (w, v) = self.state.twist(dof, &self.pose[dof.body + 1], on_successor);
        match self.rows.kind {
            RowKind::Ball => {
                for (k, &(_, i)) in self.rows.rows.iter().enumerate() {
                    each(i, v[k]);
                }
                return;
            }
            RowKind::Linear => {
                for (k, &(_, i)) in self.rows.rows.iter().enumerate() {
                    each(i, directions.linear[k].dot(v));
                }
                return;
            }
            RowKind::Any => {}
        }
        for (k, &(r, i)) in self.rows.rows.iter().enumerate() {
            let row = &self.cut.rows[r];
            let entry = if row.terms.is_empty() {
                let entry = directions.linear[k].dot(v);
                if self.cut.angular { entry + directions.angular[k].dot(w) } else { entry }
            } else {
                row.slope(dof, self.q)
            };
            each(i, self.rows.in_lengths(k, entry));
        }
    }
}

impl BlockCut {
    /// A number of row k in the unit of the others, so that the block's determinant and residual
    /// mean something.
    #[inline(always)]
    pub(crate) fn in_lengths<T: Real>(&self, k: usize, x: T) -> T {
        match self.units.get(k) {
            Some(unit) => x * T::from_f64(*unit),
            None => x,
        }
    }
}
