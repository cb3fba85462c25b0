//! The order in which a block is eliminated: little fill-in at pivots that are large enough.

use crate::closure::Elimination;

/// Least pivot relative to the largest entry of its column, at every sampled pose.
const PIVOT: f64 = 0.25;
/// Largest entry of a column, relative to all entries, below which the pose is ignored for it.
const NOTHING: f64 = 1e-9;

/// Rows and columns of a block in the order of elimination, and for more than three rows the
/// fill-in. `set` holds its columns, each with its row; `sees` is its sparsity pattern; `entry`
/// gives the entries at each sampled pose.
pub(super) fn order(
    set: &[usize],
    row_of: &[usize],
    sees: &[Vec<bool>],
    poses: usize,
    entry: impl Fn(usize, usize, usize) -> f64,
) -> (Vec<usize>, Vec<usize>, Option<Elimination>) {
    let mut rows: Vec<usize> = set.iter().map(|a| row_of[*a]).collect();
    rows.sort_unstable();
    let m = set.len();
    if m <= 3 {
        return (rows, set.to_vec(), None);
    }
    let at = |k: usize| -> Vec<Vec<f64>> {
        rows.iter().map(|i| set.iter().map(|a| entry(k, *i, *a)).collect()).collect()
    };
    let mut block = Matrix {
        entries: (0..poses).map(at).collect(),
        filled: rows.iter().map(|i| set.iter().map(|a| sees[*i][*a]).collect()).collect(),
        rows,
        columns: set.to_vec(),
    };
    (0..m).for_each(|k| block.eliminate(k));
    let elimination = Elimination {
        below: (0..m).map(|k| (k + 1..m).filter(|i| block.filled[*i][k]).collect()).collect(),
        right: (0..m).map(|k| (k + 1..m).filter(|j| block.filled[k][*j]).collect()).collect(),
        is_fixed: false,
    };
    (block.rows, block.columns, Some(elimination))
}

/// A matrix at several poses under elimination.
struct Matrix {
    entries: Vec<Vec<Vec<f64>>>,
    filled: Vec<Vec<bool>>,
    rows: Vec<usize>,
    columns: Vec<usize>,
}

impl Matrix {
    /// Brings the best pivot from k on to its place and clears the column below it.
    fn eliminate(&mut self, k: usize) {
        let (p, q) = self.sparsest(k);
        let m = self.rows.len();
        self.filled.swap(k, p);
        self.filled.iter_mut().for_each(|row| row.swap(k, q));
        self.rows.swap(k, p);
        self.columns.swap(k, q);
        for entries in &mut self.entries {
            entries.swap(k, p);
            entries.iter_mut().for_each(|row| row.swap(k, q));
        }
        for i in (k + 1..m).filter(|i| self.filled[*i][k]).collect::<Vec<_>>() {
            for j in (k + 1..m).filter(|j| self.filled[k][*j]).collect::<Vec<_>>() {
                self.filled[i][j] = true;
                for entries in &mut self.entries {
                    if entries[k][k] != 0.0 {
                        entries[i][j] -= entries[i][k] / entries[k][k] * entries[k][j];
                    }
                }
            }
        }
    }

    /// The entry that fills in least \[M57\], of those that are not small in their columns; where
    /// all are, the least small one.
    fn sparsest(&self, k: usize) -> (usize, usize) {
        let m = self.rows.len();
        let largest = |entries: &Vec<Vec<f64>>, j: usize| {
            (k..m).fold(0.0_f64, |largest, i| largest.max(entries[i][j].abs()))
        };
        let columns: Vec<Vec<f64>> = self
            .entries
            .iter()
            .map(|entries| (0..m).map(|j| largest(entries, j)).collect())
            .collect();
        let share = |i: usize, j: usize| {
            self.entries.iter().zip(&columns).fold(1.0_f64, |share, (entries, columns)| {
                let of_all = columns[k..].iter().fold(0.0_f64, |all, x| all.max(*x));
                if columns[j] > NOTHING * of_all {
                    share.min(entries[i][j].abs() / columns[j])
                } else {
                    share
                }
            })
        };
        let count = |i: usize, j: usize| {
            let in_row = (k..m).filter(|j| self.filled[i][*j]).count();
            let in_column = (k..m).filter(|i| self.filled[*i][j]).count();
            (in_row - 1) * (in_column - 1)
        };
        // cost first among the sound, share among the others
        let mut best: Option<(bool, usize, f64, (usize, usize))> = None;
        for i in k..m {
            for j in (k..m).filter(|j| self.filled[i][*j]) {
                let share = share(i, j);
                let cost = count(i, j);
                let sound = share >= PIVOT;
                let better = best.is_none_or(|(was_sound, was_cost, was_share, _)| {
                    match (sound, was_sound) {
                        (true, true) => (cost, was_share) < (was_cost, share),
                        (false, false) => share > was_share,
                        _ => sound,
                    }
                });
                if better {
                    best = Some((sound, cost, share, (i, j)));
                }
            }
        }
        best.map_or((k, k), |(_, _, _, place)| place)
    }
}
