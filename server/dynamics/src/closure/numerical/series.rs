//! Newton's method, G and g of a block whose unknowns are joints in series, each on the one before,
//! that carry one end of its only cut while the other end is fixed: a leg with a ball at its end, a
//! crank and its slider. The same equations, thresholds and order of steps as for any block
//! ([`super::newton`], [`super::jacobian`], [`super::bias`]), with all variables of fixed size.
//! Without it a state from a guess takes 6,913 instead of 5,207 instructions on the lambda and
//! 56,240 instead of 40,870 on the full robot.

use core::array::from_fn;

use nalgebra::Vector3;

use crate::closure::constraint::rows::{base, cos_sin_of};
use crate::closure::numerical::End;
use crate::closure::numerical::block::{Block, RowKind};
use crate::closure::numerical::inverse::{Inverted, invert};
use crate::closure::numerical::newton::{Attempt, Start, Thresholds};
use crate::closure::{Level, Local, column_unit};
use crate::linalg::column_square;
use crate::mechanism::{Body, Cluster, Dof, Motion, single_pose};
use crate::scalar::{Real, Triple};
use crate::spatial::{Matrix, Pose};

/// Most independents of a cluster whose G is written in fixed size.
pub(crate) const INDEPENDENTS: usize = 4;
/// Room for a matrix of three rows.
const NINE: usize = 9;

/// The fixed end of the cut.
struct Ends<T, const M: usize> {
    /// The joints carry the successor.
    on_successor: bool,
    /// The fixed point, and the moving one {its body}.
    fixed: Vector3<T>,
    tip: Vector3<T>,
    /// Directions of the rows; none for a ball, whose rows are the axes.
    directions: Option<[Vector3<T>; M]>,
}

impl<T: Real, const M: usize> Ends<T, M> {
    #[inline(always)]
    fn new(
        block: &Block,
        on_successor: bool,
        cluster: &Cluster<T>,
        pose: &[Pose<T>],
    ) -> Ends<T, M> {
        let rows = &block.cuts[0];
        let cut = &cluster.cuts[rows.cut];
        let (fixed, tip) = if on_successor {
            (pose[cut.predecessor].point(&cut.x_p_cut.p), cut.x_s_cut.p)
        } else {
            (pose[cut.successor].point(&cut.x_s_cut.p), cut.x_p_cut.p)
        };
        let R_p = &pose[cut.predecessor].R;
        let directions = (rows.kind == RowKind::Linear)
            .then(|| from_fn(|k| R_p.apply(cut.rows[rows.rows[k].0].linear_p)));
        Ends { on_successor, fixed, tip, directions }
    }

    /// Components of a vector along the rows.
    #[inline(always)]
    fn along(&self, x: &Vector3<T>) -> [T; M] {
        match &self.directions {
            None => from_fn(|k| x[k]),
            Some(directions) => from_fn(|k| directions[k].dot(*x)),
        }
    }

    /// φ, and the origin of S, where the tip is there.
    #[inline(always)]
    fn residual(&self, tip: &Vector3<T>) -> ([T; M], Vector3<T>) {
        if self.on_successor {
            (self.along(&(tip - self.fixed)), *tip)
        } else {
            (self.along(&(self.fixed - tip)), self.fixed)
        }
    }

    /// Entries of K in the column of a degree of freedom.
    #[inline(always)]
    fn column(&self, dof: &Dof, pose: &Pose<T>, point: &Vector3<T>, on_successor: bool) -> [T; M] {
        let z = dof.axis(&pose.R);
        let v = if dof.slides() { z } else { z.cross(point - pose.p) };
        self.along(&if on_successor { v } else { -v })
    }
}

/// The joints and their bodies.
struct Series<T: Real, const M: usize> {
    q: [T; M],
    cos_sin: [(T, T); M],
    pose: [Pose<T>; M],
}

impl<T: Real, const M: usize> Series<T, M> {
    /// Poses from coordinates and their cosines and sines; the first body's from that at zero of
    /// its joint.
    #[inline(always)]
    fn place(&mut self, block: &Block, bodies: &[Body<T>], first: &Pose<T>) {
        for a in 0..M {
            let body = &bodies[block.unknowns[a].body];
            let q = self.q[a];
            let cos_sin = self.cos_sin[a];
            self.pose[a] = if a == 0 {
                single_pose(body, first, q, cos_sin)
            } else {
                let at_zero = Pose { R: body.R_parent_body, p: body.p_local };
                single_pose(body, &self.pose[a - 1].then(&at_zero), q, cos_sin)
            };
        }
    }

    /// Coordinates, cosines and sines, and poses into the cluster's numbers.
    #[inline(always)]
    fn store(&self, dofs: &[Dof], local: &mut Local<'_, T>) {
        for (a, dof) in dofs.iter().enumerate() {
            local.q[dof.q] = self.q[a];
            local.cos_sin[dof.body] = self.cos_sin[a];
            local.scratch.pose[dof.body + 1] = self.pose[a];
        }
    }

    /// Cosines and sines after a step. PRECISION: as in `Block::update_cos_sin`.
    #[inline(always)]
    fn update_cos_sin(&mut self, dofs: &[Dof], step: &[T; M], tiny: bool) {
        // that of a slide is not read
        let fresh = (!tiny && T::TOGETHER).then(|| T::sin_cos_of(self.q));
        for (i, dof) in dofs.iter().enumerate().filter(|(_, dof)| !dof.slides()) {
            debug_assert!(dof.motion == Motion::Revolute);
            let (c, s) = self.cos_sin[i];
            self.cos_sin[i] = match fresh {
                Some(fresh) => (fresh[i].1, fresh[i].0),
                None if tiny => (s.mul_add(step[i], c), (-c).mul_add(step[i], s)),
                None => cos_sin_of(self.q[i]),
            };
        }
    }
}

impl Block {
    /// [`Block::newton`] of joints in series.
    pub(super) fn newton_in_series<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        start: Start<T>,
        end: End,
    ) -> (bool, u32, T) {
        let &mut Local { cluster, bodies, .. } = local;
        let thresholds = Thresholds::<T>::new(cluster.length, end);
        let mut attempt = Attempt::<T>::new();
        let dofs: &[Dof] = &self.unknowns[..M];
        let on_successor = self.series == Some(true);
        let ends = Ends::<T, M>::new(self, on_successor, cluster, &local.scratch.pose);
        let first = base(cluster, bodies, dofs[0].body, &local.scratch.pose);
        let mut series = Series::<T, M> {
            q: from_fn(|a| local.q[dofs[a].q]),
            cos_sin: from_fn(|a| local.cos_sin[dofs[a].body]),
            pose: from_fn(|_| first),
        };
        series.place(self, bodies, &first);
        let unit = T::from_f64(1.0 / cluster.length);
        let mut A = [T::ZERO; NINE];
        let mut inverse = [T::ZERO; NINE];
        let mut trust = T::ZERO;
        let mut taken = 0;
        for k in 0..end.steps {
            // φ(q_k), and A⁻¹ unless the chord rule keeps it
            let fresh = k == 0 || !attempt.size.lt(thresholds.chord);
            let (phi, point) = ends.residual(&series.pose[M - 1].point(&ends.tip));
            let residual =
                phi.iter().fold(T::ZERO, |x, phi| T::select_lt(x, phi.abs(), phi.abs(), x));
            if fresh {
                for (a, dof) in dofs.iter().enumerate() {
                    let column = ends.column(dof, &series.pose[a], &point, on_successor);
                    (0..M).for_each(|i| A[i * M + a] = column[i]);
                }
                let squares: [T; M] = from_fn(|a| column_square(&A, M, M, a));
                let inverted =
                    invert::<T, M>(&mut A[..M * M], &mut inverse[..M * M], self.volume, M);
                if k == 0 {
                    attempt.det = start.branch.unwrap_or(inverted.det);
                    trust = self.trust_gain(&inverse[..M * M], &squares);
                }
                attempt.check_branch(&inverted);
                attempt.gain = match M {
                    1 => self.lever_gain_of(cluster, inverse[0]),
                    _ => inverted.gain,
                };
            }

            // Δ_k = A⁻¹ φ(q_k), q_{k+1} = q_k − Δ_k, s_k = ‖Δ_k‖∞
            let mut size = T::ZERO;
            let step: [T; M] = from_fn(|i| {
                let step = (0..M).fold(T::ZERO, |step, r| inverse[i * M + r].mul_add(phi[r], step));
                T::select(attempt.done, T::ZERO, step)
            });
            for (i, dof) in dofs.iter().enumerate() {
                series.q[i] += -step[i];
                let scaled = step[i].abs();
                let scaled = if dof.slides() { scaled * unit } else { scaled };
                size = T::select_lt(size, scaled, scaled, size);
            }
            taken += 1;
            if k == 0 {
                attempt.check_trust(size, start.moved, trust);
            }
            attempt.check_contraction(size, residual, &thresholds, end.tolerance.is_some(), false);
            if !attempt.good {
                break;
            }
            attempt.size = size;

            series.update_cos_sin(dofs, &step, size.lt(thresholds.last));
            series.place(self, bodies, &first);
            if attempt.done {
                break;
            }
        }
        series.store(dofs, local);
        let good = attempt.good & (attempt.done | end.tolerance.is_some());
        (good, taken, attempt.gain)
    }

    /// [`Block::jacobian`] of joints in series.
    pub(super) fn jacobian_in_series<T: Real, const M: usize>(
        &self,
        local: &mut Local<'_, T>,
        level: Level,
    ) -> (bool, T) {
        let cluster = local.cluster;
        let n_vy = cluster.n_vy;
        let on_successor = self.series == Some(true);
        let dofs: &[Dof] = &self.unknowns[..M];
        let scratch = &mut *local.scratch;
        let pose = &scratch.pose;
        let ends = Ends::<T, M>::new(self, on_successor, cluster, pose);
        let (_, point) = ends.residual(&pose[dofs[M - 1].body + 1].point(&ends.tip));
        let rows = &self.cuts[0];

        // A = K_d of the block;  B = K_i + K_before G_before
        let mut A = [T::ZERO; NINE];
        for (a, dof) in dofs.iter().enumerate() {
            let column = ends.column(dof, &pose[dof.body + 1], &point, on_successor);
            (0..M).for_each(|i| A[i * M + a] = column[i]);
        }
        let mut B = [[T::ZERO; M]; INDEPENDENTS];
        for (dof, side, k) in &rows.independent {
            B[*k] = ends.column(dof, &pose[dof.body + 1], &point, *side);
        }
        for (dof, side) in &rows.earlier {
            let column = ends.column(dof, &pose[dof.body + 1], &point, *side);
            let of_joint = &local.G[dof.v * n_vy..(dof.v + 1) * n_vy];
            for (B, g) in B.iter_mut().zip(of_joint) {
                *B = from_fn(|i| column[i].mul_add(*g, B[i]));
            }
        }

        // one row alone: its independents move it more than its unknown does
        let lever_ratio = (M == 1).then(|| {
            let square = |x: T, v: usize| {
                (x * x) * T::from_f64(column_unit(cluster, v) * column_unit(cluster, v))
            };
            let moves = (B.iter().zip(&cluster.independent))
                .fold(T::ZERO, |sum, (b, v)| sum + square(b[0], *v));
            moves / square(A[0], dofs[0].v)
        });
        let inverse = &mut scratch.inverse[self.offset..self.offset + M * M];
        let Inverted { sound, accurate, gain, .. } =
            invert::<T, M>(&mut A[..M * M], inverse, self.volume, M);
        for (i, dof) in dofs.iter().enumerate() {
            let row = &mut local.G[dof.v * n_vy..(dof.v + 1) * n_vy];
            for (g, B) in row.iter_mut().zip(&B) {
                *g = -(0..M).fold(T::ZERO, |x, r| inverse[i * M + r].mul_add(B[r], x));
            }
        }
        let good = if level == Level::Acceleration { sound & accurate } else { sound };
        (good, lever_ratio.unwrap_or(gain))
    }

    /// [`Block::bias`] of joints in series.
    pub(super) fn bias_in_series<T: Real, const M: usize>(&self, local: &mut Local<'_, T>) {
        let cluster = local.cluster;
        let dofs: &[Dof] = &self.unknowns[..M];
        let scratch = &*local.scratch;
        let pose = &scratch.pose;
        let rate = &scratch.rate;
        let on_successor = self.series == Some(true);
        let ends = Ends::<T, M>::new(self, on_successor, cluster, pose);
        let (_, point) = ends.residual(&pose[dofs[M - 1].body + 1].point(&ends.tip));
        let rows = &self.cuts[0];
        let cut = &cluster.cuts[rows.cut];

        // k: acceleration of S against P at q̈ = 0, seen from P where rows turn with it
        let at = |end: usize| {
            let rate = &rate[end];
            let r = point - pose[end].p;
            let a = rate.a.add_cross(rate.alpha, r);
            (rate.v.add_cross(rate.w, r), a.add_cross(rate.w, rate.w.cross(r)))
        };
        let ((v_s, a_s), (v_p, a_p)) = (at(cut.successor), at(cut.predecessor));
        let mut relative = a_s - a_p;
        if ends.directions.is_some() {
            relative -= rate[cut.predecessor].w.cross(v_s - v_p) * T::from_f64(2.0);
        }
        let mut B = ends.along(&-relative);
        for (dof, side) in &rows.earlier {
            let column = ends.column(dof, &pose[dof.body + 1], &point, *side);
            let g = local.g[dof.v];
            B = from_fn(|i| (-column[i]).mul_add(g, B[i]));
        }
        let inverse = &scratch.inverse[self.offset..self.offset + M * M];
        for (i, dof) in dofs.iter().enumerate() {
            local.g[dof.v] = (0..M).fold(T::ZERO, |x, r| inverse[i * M + r].mul_add(B[r], x));
        }
    }
}
