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
//! pose, and where every cell between it and the zero pose is used too. So the straight path from
//! the zero pose to any y of it lies in cells in which γ is one smooth function, and continuation
//! along that path can arrive nowhere else. An attempt from a seed must pass the checks of any
//! attempt, and each determinant must keep its sign at the zero pose; otherwise continuation
//! answers.
//!
//! **Closed form.** A mechanism of cranks and rods ([`crate::closure::RodLeg`]) whose closed form
//! agrees with Newton's method at every corner and every center of these cells is closed by it
//! there: in a cell γ is one smooth function, and so is the closed form.

use crate::scalar::Real;

/// Numbers added at once: the table is padded to a multiple of this.
pub(crate) const LANES: usize = 4;
/// Most independents of a cluster with seeds.
pub(crate) const MOST: usize = 3;
/// Most corners of a cell times derivatives at each.
const TERMS: usize = 1 << (2 * MOST);

/// Closed poses around the zero pose, by cubic interpolation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Seeds {
    /// One for each independent; nodes and cells are numbered with the last one fastest.
    pub(crate) axes: Vec<Axis>,
    /// The local coordinates that are tabulated.
    pub(crate) columns: Vec<usize>,
    /// The coordinates relative to the zero pose and their derivatives by the axes of the bits of
    /// d, times the steps of these axes: (node, d, columns padded).
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
        let mut cell = 0;
        let mut node = 0;
        let mut along = [0.0; MOST];
        for (axis, along) in self.axes.iter().zip(&mut along) {
            let from_zero = (q[axis.coordinate] - start[axis.coordinate]).to_f64();
            let x = from_zero / axis.step + axis.below as f64;
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

    /// The seed of the independents in `q` into its dependents; false where there is none. `start`
    /// is the zero pose, turned round by whole turns.
    pub(crate) fn find<T: Real>(&self, start: &[T], q: &mut [T]) -> bool {
        let Some((node, along)) = self.cell(start, q) else { return false };
        let along = along.map(hermite);

        // products of the weights, with the places of the values
        let n = self.axes.len();
        let stride = self.stride();
        let mut terms = [(0, 0.0); TERMS];
        let mut count = 0;
        for corner in 0..1 << n {
            let mut at = 0;
            for (a, axis) in self.axes.iter().enumerate() {
                at = at * axis.nodes + (corner >> a & 1);
            }
            for d in 0..1 << n {
                let weight = (0..n).fold(1.0, |w, a| w * along[a][corner >> a & 1][d >> a & 1]);
                terms[count] = ((((node + at) << n) + d) * stride, weight);
                count += 1;
            }
        }
        for (columns, first) in self.columns.chunks(LANES).zip((0..).step_by(LANES)) {
            let mut sum = [0.0; LANES];
            for &(place, weight) in &terms[..count] {
                let values = self.values[place + first..].first_chunk::<LANES>();
                let values = values.unwrap_or(&[0.0; LANES]);
                for k in 0..LANES {
                    sum[k] = f64::from(values[k]).mul_add(weight, sum[k]);
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
