//! Where Newton's method starts without a guess: the closed poses of a cluster of few independents,
//! tabulated at load around the zero pose.
//!
//! ```text
//!   q_d ≈ γ(0) + Σ_corners Σ_derivatives w(t) h^|d| ∂^d γ        t = (y − y_corner) / h
//! ```
//! with the cubic Hermite weights of each axis multiplied, first derivatives from G and mixed ones
//! from differences of G.
//!
//! **The same assembly.** A cell is used only where its corners were reached from the zero pose on
//! regular paths with no change of sign of any block's determinant, where the closed pose at its
//! center agrees with the interpolation to a small part of the distance to the nearest singular
//! pose, and where the same is true of every cell that a straight path from the zero pose into it
//! can cross. So on the straight path from the zero pose to any y of it γ is one smooth function,
//! and continuation along that path can arrive nowhere else. An attempt from a seed must pass the
//! checks of any attempt, and each determinant must keep its sign at the zero pose; otherwise
//! continuation answers.
//!
//! **Closed form.** A mechanism of which a form ([`crate::closure::Form`]) agrees with Newton's
//! method at every corner and every center of these cells is closed by it there: in a cell γ is one
//! smooth function, and so is the form. A form that itself starts from a seed has only its unknowns
//! in the table; the other dependents of a seed follow from these.

use crate::scalar::Real;

/// Numbers added at once: the table is padded to a multiple of this.
pub(crate) const LANES: usize = 4;
/// Most independents of a cluster with seeds.
pub(crate) const MOST: usize = 3;
/// How often the path out of the cells is halved.
const HALVINGS: u32 = 12;
/// Most corners of a cell, and derivatives at each.
const SIDES: usize = 1 << MOST;

/// Closed poses around the zero pose, by cubic interpolation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seeds {
    /// One for each independent; nodes and cells are numbered with the last one fastest.
    pub(crate) axes: Vec<Axis>,
    /// The local coordinates that are tabulated.
    pub(crate) columns: Vec<usize>,
    /// The coordinates relative to the zero pose and their derivatives by the axes of the bits of
    /// d, times the steps of these axes: (node, columns by lanes, d, lane).
    pub(crate) values: Vec<f32>,
    /// Cells that are used.
    pub(crate) cells: Vec<bool>,
    /// Sign of the determinant of each block at the zero pose.
    pub(crate) signs: Vec<f64>,
}

/// The nodes along one independent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Axis {
    /// Its local coordinate.
    pub(crate) coordinate: usize,
    /// Number of nodes, and of those below the zero pose.
    pub(crate) nodes: usize,
    pub(crate) below: usize,
    /// Distance between nodes `[rad, m]`.
    pub(crate) step: f64,
}

impl Seeds {
    /// Numbers between one derivative and the next.
    pub(crate) fn stride(&self) -> usize {
        self.columns.len().next_multiple_of(LANES)
    }

    /// Cells that are used, and bytes of the whole table.
    pub(crate) fn size(&self) -> (usize, usize) {
        let used = self.cells.iter().filter(|used| **used).count();
        (used, size_of_val(&*self.values) + size_of_val(&*self.cells))
    }

    /// The node below the independents in `q` and how far they are from it along each axis, in its
    /// steps; `None` outside the cells that are used.
    #[inline]
    pub(crate) fn cell<T: Real>(&self, start: &[T], q: &[T]) -> Option<(usize, [f64; MOST])> {
        self.cell_at(|axis| (q[axis.coordinate] - start[axis.coordinate]).to_f64())
    }

    /// As above, so far from the zero pose along each axis.
    #[inline(always)]
    fn cell_at(&self, from_zero: impl Fn(&Axis) -> f64) -> Option<(usize, [f64; MOST])> {
        let mut cell = 0;
        let mut node = 0;
        let mut along = [0.0; MOST];
        for (axis, along) in self.axes.iter().zip(&mut along) {
            let x = from_zero(axis) / axis.step + axis.below as f64;
            if !(0.0 <= x && x <= (axis.nodes - 1) as f64) {
                return None;
            }
            let i = (x as usize).min(axis.nodes - 2);
            *along = x - i as f64;
            cell = cell * (axis.nodes - 1) + i;
            node = node * axis.nodes + i;
        }
        self.cells[cell].then_some((node, along))
    }

    /// A part of the straight path from `start` to the independents of `goal` that ends in a cell
    /// that is used, where the path leaves them.
    pub(crate) fn share<T: Real>(&self, start: &[T], goal: &[T]) -> f64 {
        let [mut inside, mut outside] = [0.0, 1.0];
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            let at = |axis: &Axis| {
                let from_zero = (goal[axis.coordinate] - start[axis.coordinate]).to_f64();
                middle * from_zero
            };
            match self.cell_at(at) {
                Some(_) => inside = middle,
                None => outside = middle,
            }
        }
        inside
    }

    /// The seed of the independents in `q` into its dependents; false where there is none. `start`
    /// is the zero pose, turned round by whole turns.
    pub(crate) fn find<T: Real>(&self, start: &[T], q: &mut [T]) -> bool {
        match self.axes.len() {
            1 => self.find_along::<T, 1>(start, q),
            2 => self.find_along::<T, 2>(start, q),
            _ => self.find_along::<T, MOST>(start, q),
        }
    }

    fn find_along<T: Real, const N: usize>(&self, start: &[T], q: &mut [T]) -> bool {
        let Some((node, along)) = self.cell(start, q) else { return false };
        let along = along.map(hermite);

        // where the corners have their values, and products of the weights of their derivatives
        let of_columns = LANES << N;
        let mut first = [0; SIDES];
        let mut weights = [[0.0; SIDES]; SIDES];
        for corner in 0..1 << N {
            let mut at = 0;
            for (a, axis) in self.axes.iter().enumerate() {
                at = at * axis.nodes + (corner >> a & 1);
            }
            first[corner] = (node + at) * (self.stride() << N);
            for (d, weight) in weights[corner][..1 << N].iter_mut().enumerate() {
                *weight = (0..N).fold(1.0, |w, a| w * along[a][corner >> a & 1][d >> a & 1]);
            }
        }
        for (chunk, columns) in self.columns.chunks(LANES).enumerate() {
            let mut sum = [0.0; LANES];
            for (first, weights) in first.iter().zip(&weights).take(1 << N) {
                let values = self.values.get(first + chunk * of_columns..).unwrap_or(&[]);
                let (values, _) = values.as_chunks::<LANES>();
                for (values, weight) in values.iter().zip(&weights[..1 << N]) {
                    for k in 0..LANES {
                        sum[k] = f64::from(values[k]).mul_add(*weight, sum[k]);
                    }
                }
            }
            for (i, x) in columns.iter().zip(sum) {
                q[*i] = start[*i] + T::from_f64(x);
            }
        }
        true
    }
}

/// Cubic Hermite weights at t of (value, slope) at 0 and at 1.
fn hermite(t: f64) -> [[f64; 2]; 2] {
    let s = 1.0 - t;
    [[s * s * t.mul_add(2.0, 1.0), t * s * s], [t * t * s.mul_add(2.0, 1.0), -(s * t * t)]]
}
