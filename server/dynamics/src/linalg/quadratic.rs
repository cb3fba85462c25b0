//! Strictly convex quadratic programs with two-sided rows, by the dual method of Goldfarb and
//! Idnani \[GI83: A numerically stable dual method for solving strictly convex quadratic programs,
//! Mathematical Programming 27, 1983\]: min ½ xᵀHx − gᵀx with lo ≤ A x ≤ hi.
//!
//! It starts from the free minimum and adds violated rows one at a time; the multipliers stay
//! non-negative.

/// A violation below this, relative to the numbers of its row, is rounding.
const ROUNDING: f64 = 1e-13;
/// Square of the part of a row that the active ones leave free, relative to the row's, below which
/// it depends on them.
const DEPENDENT: f64 = 1e-22;

/// The outcome of a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Optimum {
    Found,
    /// No point meets all rows; the row that contradicts those that are active.
    Contradicts(usize),
    /// H is not positive definite, or the steps did not suffice.
    Failed,
}

/// Rows lo ≤ a·x ≤ hi: first one for each variable, then dense ones. The first `equal` dense ones
/// are equations, with lo = hi.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows<'a> {
    pub(crate) dense: &'a [f64],
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
    pub(crate) equal: usize,
}

/// Scratch and result for up to so many variables and rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Quadratic {
    /// The minimum (n).
    pub(crate) x: Vec<f64>,
    /// Of each row (n + dense): 1 where its upper bound is active, −1 its lower one, else 0.
    pub(crate) side: Vec<i8>,
    /// The active rows in the order of R, and their multipliers, those of the others zero.
    active: Vec<usize>,
    multiplier: Vec<f64>,
    /// J = L⁻ᵀ Q with H = L Lᵀ, and R = Qᵀ L⁻¹ N of the active normals N; by columns.
    J: Vec<f64>,
    R: Vec<f64>,
    d: Vec<f64>,
    z: Vec<f64>,
    r: Vec<f64>,
    /// Squared norms of the dense rows.
    norm: Vec<f64>,
}

impl Quadratic {
    /// For up to `n` variables and `dense` rows. Allocates; nothing after it does.
    pub(crate) fn new(n: usize, dense: usize) -> Quadratic {
        let of = |n: usize| vec![0.0; n];
        Quadratic {
            x: of(n),
            side: vec![0; n + dense],
            active: vec![0; n],
            multiplier: of(n + 1),
            J: of(n * n),
            R: of(n * n),
            d: of(n),
            z: of(n),
            r: of(n),
            norm: of(dense),
        }
    }

    /// The largest multiplier of an inequality after [`Quadratic::solve`]; `n_active` of them.
    pub(crate) fn largest_multiplier(&self, n_active: usize) -> f64 {
        self.multiplier[..n_active].iter().fold(0.0, |most: f64, u| most.max(u.abs()))
    }

    /// Solves a program of the lower triangle of H (n × n), which becomes its factor. Returns the
    /// outcome and the number of active rows. Allocates never.
    pub(crate) fn solve(
        &mut self,
        n: usize,
        H: &mut [f64],
        g: &[f64],
        rows: Rows<'_>,
    ) -> (Optimum, usize) {
        let m = rows.lower.len().saturating_sub(n);
        self.side[..n + m].fill(0);
        if !factorise(H, n) {
            return (Optimum::Failed, 0);
        }
        self.invert(H, n);
        // x = H⁻¹ g = J Jᵀ g
        self.x[..n].fill(0.0);
        for k in 0..n {
            let column = &self.J[k * n..(k + 1) * n];
            let along = dot(column, &g[..n]);
            axpy(along, column, &mut self.x[..n]);
        }
        for i in 0..m {
            let row = &rows.dense[i * n..(i + 1) * n];
            self.norm[i] = dot(row, row);
        }
        let mut n_active = 0;
        let mut equations = 0..rows.equal.min(m);
        for _ in 0..20 * (n + m) + 20 {
            let (row, side) = match equations.next() {
                Some(i) => {
                    let value = self.value(n, &rows, n + i);
                    (n + i, if value > rows.upper[n + i] { 1 } else { -1 })
                }
                None => match self.most_violated(n, m, &rows) {
                    Some(violated) => violated,
                    None => return (Optimum::Found, n_active),
                },
            };
            match self.add(n, &rows, (row, side), &mut n_active) {
                Optimum::Found => {}
                Optimum::Contradicts(_) if row >= n && row < n + rows.equal => {
                    // a dependent equation that holds already is left out
                    let value = self.value(n, &rows, row);
                    let size = self.size(n, row).sqrt() * norm(&self.x[..n]);
                    if (value - rows.lower[row]).abs() > 1e-9 * (size + rows.lower[row].abs()) {
                        self.keep_involved(row, side, n_active);
                        return (Optimum::Contradicts(row), n_active);
                    }
                }
                Optimum::Contradicts(_) => {
                    self.keep_involved(row, side, n_active);
                    return (Optimum::Contradicts(row), n_active);
                }
                outcome => return (outcome, n_active),
            }
        }
        (Optimum::Failed, n_active)
    }

    /// The inactive row that is violated most, relative to its norm.
    fn most_violated(&self, n: usize, m: usize, rows: &Rows<'_>) -> Option<(usize, i8)> {
        let length = norm(&self.x[..n]);
        let mut most = 0.0;
        let mut found = None;
        for row in (0..n + m).filter(|row| self.side[*row] == 0) {
            if row >= n && row < n + rows.equal {
                continue;
            }
            let value = self.value(n, rows, row);
            let size = self.size(n, row).sqrt();
            let (off, side, bound) = if value > rows.upper[row] {
                (value - rows.upper[row], 1, rows.upper[row])
            } else {
                (rows.lower[row] - value, -1, rows.lower[row])
            };
            if off > ROUNDING * (size * length + bound.abs()) && off > most * size {
                most = off / size.max(f64::MIN_POSITIVE);
                found = Some((row, side));
            }
        }
        found
    }

    /// Sides of the row that was not added and of the active ones that it contradicts, alone.
    fn keep_involved(&mut self, row: usize, side: i8, n_active: usize) {
        let most = self.r[..n_active].iter().fold(0.0, |most: f64, r| most.max(r.abs()));
        for (of, r) in self.active[..n_active].iter().zip(&self.r) {
            if r.abs() <= 1e-9 * most {
                self.side[*of] = 0;
            }
        }
        self.side[row] = side;
    }

    /// Squared norm of a row.
    fn size(&self, n: usize, row: usize) -> f64 {
        if row < n { 1.0 } else { self.norm[row - n] }
    }

    fn value(&self, n: usize, rows: &Rows<'_>, row: usize) -> f64 {
        match row.checked_sub(n) {
            None => self.x[row],
            Some(i) => dot(&rows.dense[i * n..(i + 1) * n], &self.x[..n]),
        }
    }

    /// Adds a violated row to the active ones, and drops those that it replaces.
    fn add(
        &mut self,
        n: usize,
        rows: &Rows<'_>,
        (row, side): (usize, i8),
        n_active: &mut usize,
    ) -> Optimum {
        // the normal into the feasible side
        let sign = -f64::from(side);
        let bound = if side > 0 { rows.upper[row] } else { rows.lower[row] };
        let mut own = 0.0;
        // each pass but the last drops a row
        for _ in 0..=n {
            let q = *n_active;
            // d = Jᵀ n, z = J₂ d₂, r = R⁻¹ d₁
            for k in 0..n {
                let column = &self.J[k * n..(k + 1) * n];
                self.d[k] = sign
                    * match row.checked_sub(n) {
                        None => column[row],
                        Some(i) => dot(&rows.dense[i * n..(i + 1) * n], column),
                    };
            }
            self.z[..n].fill(0.0);
            for k in q..n {
                axpy(self.d[k], &self.J[k * n..(k + 1) * n], &mut self.z[..n]);
            }
            self.r[..q].copy_from_slice(&self.d[..q]);
            for k in (0..q).rev() {
                let x = self.r[k] / self.R[k * n + k];
                self.r[k] = x;
                for i in 0..k {
                    self.r[i] -= self.R[k * n + i] * x;
                }
            }
            // the longest step that keeps the multipliers, and the one that reaches the row
            let mut partial = f64::INFINITY;
            let mut blocking = None;
            for k in 0..q {
                let of = self.active[k];
                let is_equation = of >= n && of < n + rows.equal;
                if !is_equation && self.r[k] > 0.0 {
                    let step = self.multiplier[k] / self.r[k];
                    if step < partial {
                        (partial, blocking) = (step, Some(k));
                    }
                }
            }
            let free = dot(&self.d[q..n], &self.d[q..n]);
            let all = free + dot(&self.d[..q], &self.d[..q]);
            let off = sign * (self.value(n, rows, row) - bound);
            let full = if free > DEPENDENT * all { -off / free } else { f64::INFINITY };
            let step = partial.min(full);
            if !step.is_finite() {
                return Optimum::Contradicts(row);
            }
            for k in 0..q {
                self.multiplier[k] -= step * self.r[k];
            }
            own += step;
            if full.is_finite() {
                axpy(step, &self.z[..n], &mut self.x[..n]);
            }
            if full <= partial {
                self.extend(n, q);
                self.active[q] = row;
                self.multiplier[q] = own;
                self.side[row] = side;
                *n_active += 1;
                return Optimum::Found;
            }
            let Some(k) = blocking else { return Optimum::Failed };
            self.drop_row(n, q, k);
            *n_active -= 1;
        }
        Optimum::Failed
    }

    /// Turns the columns of J behind the first q so that d has one number there, a column of R.
    fn extend(&mut self, n: usize, q: usize) {
        for k in (q + 1..n).rev() {
            let (c, s, length) = rotation(self.d[k - 1], self.d[k]);
            if s != 0.0 {
                (self.d[k - 1], self.d[k]) = (length, 0.0);
                let (a, b) = self.J.split_at_mut(k * n);
                turn(&mut a[(k - 1) * n..], &mut b[..n], c, s);
            }
        }
        self.R[q * n..=q * n + q].copy_from_slice(&self.d[..=q]);
    }

    /// Takes row k out of the q active ones; R stays triangular.
    fn drop_row(&mut self, n: usize, q: usize, k: usize) {
        self.side[self.active[k]] = 0;
        self.active.copy_within(k + 1..q, k);
        self.multiplier.copy_within(k + 1..q, k);
        self.R.copy_within((k + 1) * n..q * n, k * n);
        for j in k..q - 1 {
            let (c, s, length) = rotation(self.R[j * n + j], self.R[j * n + j + 1]);
            (self.R[j * n + j], self.R[j * n + j + 1]) = (length, 0.0);
            for i in j + 1..q - 1 {
                let a = self.R[i * n + j];
                let b = self.R[i * n + j + 1];
                self.R[i * n + j] = c * a + s * b;
                self.R[i * n + j + 1] = c * b - s * a;
            }
            let (a, b) = self.J.split_at_mut((j + 1) * n);
            turn(&mut a[j * n..], &mut b[..n], c, s);
        }
    }

    /// J = L⁻ᵀ, by columns: its column k is row k of L⁻¹.
    fn invert(&mut self, L: &[f64], n: usize) {
        for k in 0..n {
            let (before, row) = self.J.split_at_mut(k * n);
            let row = &mut row[..n];
            row.fill(0.0);
            for i in 0..k {
                axpy(-L[k * n + i], &before[i * n..(i + 1) * n], row);
            }
            row[k] += 1.0;
            let inverse = 1.0 / L[k * n + k];
            row[..=k].iter_mut().for_each(|x| *x *= inverse);
        }
    }
}

/// H = L Lᵀ in place of the lower triangle; false where H is not positive definite.
fn factorise(H: &mut [f64], n: usize) -> bool {
    for i in 0..n {
        let (above, row) = H.split_at_mut(i * n);
        for j in 0..i {
            let of = &above[j * n..];
            row[j] = (row[j] - dot(&of[..j], &row[..j])) / of[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}

/// Cosine and sine of the turn that takes (a, b) to (length, 0).
fn rotation(a: f64, b: f64) -> (f64, f64, f64) {
    if b == 0.0 {
        return (1.0, 0.0, a);
    }
    let length = a.mul_add(a, b * b).sqrt();
    (a / length, b / length, length)
}

/// (a, b) ← (c a + s b, c b − s a).
fn turn(a: &mut [f64], b: &mut [f64], c: f64, s: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (c.mul_add(*a, s * *b), c.mul_add(*b, -(s * *a)));
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0_f64; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] = a[k].mul_add(b[k], sums[k]);
        }
    }
    let rest = a_rest.iter().zip(b_rest).fold(0.0, |sum, (a, b)| f64::mul_add(*a, *b, sum));
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

fn norm(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

/// y += a x.
fn axpy(a: f64, x: &[f64], y: &mut [f64]) {
    y.iter_mut().zip(x).for_each(|(y, x)| *y = a.mul_add(*x, *y));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in (−1, 1) that look drawn.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }

        fn list(&mut self, n: usize) -> Vec<f64> {
            (0..n).map(|_| self.next()).collect()
        }
    }

    struct Program {
        n: usize,
        H: Vec<f64>,
        g: Vec<f64>,
        dense: Vec<f64>,
        lower: Vec<f64>,
        upper: Vec<f64>,
        equal: usize,
    }

    impl Program {
        /// A program with the optimum that its multipliers make: H x − g = −Aᵀ u.
        fn drawn(seed: u64) -> (Program, Vec<f64>) {
            let mut numbers = Numbers(seed * 7919 + 3);
            let n = 1 + seed as usize % 14;
            let m = seed as usize * 5 % 23;
            let equal = if seed.is_multiple_of(3) { m.min(n / 3) } else { 0 };
            let B = numbers.list(2 * n * n);
            let mut H = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    H[i * n + j] = (0..2 * n).map(|k| B[k * n + i] * B[k * n + j]).sum();
                }
                H[i * n + i] += 1e-3;
            }
            let dense = numbers.list(m * n);
            let x = numbers.list(n);
            let row = |i: usize, j: usize| match i.checked_sub(n) {
                None => f64::from(u8::from(i == j)),
                Some(i) => dense[i * n + j],
            };
            let mut lower = Vec::new();
            let mut upper = Vec::new();
            let mut g: Vec<f64> =
                (0..n).map(|i| (0..n).map(|j| H[i * n + j] * x[j]).sum()).collect();
            let mut n_active = 0;
            for i in 0..n + m {
                let at: f64 = (0..n).map(|j| row(i, j) * x[j]).sum();
                let is_equal = i >= n && i < n + equal;
                let below = numbers.next().abs();
                let above = numbers.next().abs();
                let u = numbers.next();
                // at most as many active rows as variables
                let is_active = is_equal || (n_active < n - equal && numbers.next() > 0.3);
                if is_active {
                    n_active += usize::from(!is_equal);
                    (0..n).for_each(|j| g[j] += u * row(i, j));
                }
                lower.push(if is_equal || is_active && u < 0.0 { at } else { at - below });
                upper.push(if is_equal || is_active && u > 0.0 { at } else { at + above });
            }
            (Program { n, H, g, dense, lower, upper, equal }, x)
        }

        fn solve(&self, of: &mut Quadratic) -> (Optimum, usize) {
            let Program { n, H, g, dense, lower, upper, equal } = self;
            let rows = Rows { dense, lower, upper, equal: *equal };
            of.solve(*n, &mut H.clone(), g, rows)
        }
    }

    #[test]
    fn optima_are_those_that_their_multipliers_make() {
        let mut quadratic = Quadratic::new(14, 23);
        for seed in 0..3000 {
            let (program, x) = Program::drawn(seed);
            let (outcome, _) = program.solve(&mut quadratic);
            assert_eq!(outcome, Optimum::Found, "seed {seed}");
            for (a, b) in quadratic.x.iter().zip(&x) {
                assert!((a - b).abs() < 1e-9, "seed {seed}: {a} instead of {b}");
            }
            let again = quadratic.x.clone();
            program.solve(&mut quadratic);
            assert_eq!(quadratic.x, again, "the same bits");
        }
    }

    #[test]
    fn rows_that_contradict_are_named() {
        let mut quadratic = Quadratic::new(2, 2);
        let program = |lower: [f64; 4], upper: [f64; 4], equal: usize| Program {
            n: 2,
            H: vec![1.0, 0.0, 0.0, 1.0],
            g: vec![3.0, 0.0],
            dense: vec![1.0, 1.0, 2.0, 2.0],
            lower: lower.to_vec(),
            upper: upper.to_vec(),
            equal,
        };
        let wide = f64::INFINITY;
        let none = program([0.0, 0.0, 3.0, -wide], [1.0, 1.0, wide, wide], 0);
        assert!(matches!(none.solve(&mut quadratic).0, Optimum::Contradicts(_)));
        let twice = program([-wide, -wide, 1.0, 2.0], [wide, wide, 1.0, 2.0], 2);
        assert_eq!(twice.solve(&mut quadratic).0, Optimum::Found, "a dependent equation holds");
        let other = program([-wide, -wide, 1.0, 3.0], [wide, wide, 1.0, 3.0], 2);
        assert_eq!(other.solve(&mut quadratic).0, Optimum::Contradicts(3));
    }
}
