//! The nodes and cells of a table of seeds by their numbers, from the zero pose outwards.

use crate::closure::Axis;

/// The independents at the center of a cell, and the zero pose's other coordinates.
pub(super) fn center(axes: &[Axis], zero: &[f64], cell: &[usize]) -> Vec<f64> {
    let mut q = zero.to_vec();
    for (axis, i) in axes.iter().zip(cell) {
        q[axis.coordinate] += (*i as f64 + 0.5 - axis.below as f64) * axis.step;
    }
    q
}

/// Numbers of nodes or cells.
pub(super) struct Grid {
    sizes: Vec<usize>,
    /// Node of the zero pose, or first cell beyond it.
    pub(super) below: Vec<usize>,
    /// Cells lie between nodes: two of them are next to the zero pose.
    cells: bool,
}

impl Grid {
    pub(super) fn of_nodes(axes: &[Axis]) -> Grid {
        let below = axes.iter().map(|axis| axis.below).collect();
        Grid { sizes: axes.iter().map(|axis| axis.nodes).collect(), below, cells: false }
    }

    pub(super) fn of_cells(axes: &[Axis]) -> Grid {
        let sizes = axes.iter().map(|axis| axis.nodes - 1).collect();
        Grid { sizes, cells: true, ..Grid::of_nodes(axes) }
    }

    pub(super) fn len(&self) -> usize {
        self.sizes.iter().product()
    }

    pub(super) fn number(&self, place: &[usize]) -> usize {
        self.sizes.iter().zip(place).fold(0, |number, (size, i)| number * size + i)
    }

    pub(super) fn place(&self, number: usize) -> Vec<usize> {
        let mut rest = number;
        let mut place: Vec<usize> = self
            .sizes
            .iter()
            .rev()
            .map(|size| {
                let i = rest % size;
                rest /= size;
                i
            })
            .collect();
        place.reverse();
        place
    }

    /// The nodes at the corners of a cell; of the grid of nodes.
    pub(super) fn corners(&self, cell: &[usize]) -> impl Iterator<Item = usize> {
        (0..1 << cell.len()).map(move |corner: usize| {
            let along = self.sizes.iter().zip(cell).enumerate();
            along.fold(0, |number, (a, (size, i))| number * size + i + (corner >> a & 1))
        })
    }

    /// How many steps along one axis lead to the zero pose.
    fn away(&self, i: usize, a: usize) -> usize {
        let below = self.below[a];
        if i >= below { i - below } else { below - i - usize::from(self.cells) }
    }

    /// True if a straight path from the zero pose into a cell can cross another one: at some part t
    /// of the path, t [d, d + 1] meets [c, c + 1] along every axis.
    pub(super) fn crosses(&self, cell: &[usize], other: &[usize]) -> bool {
        let mut since = 0.0_f64;
        let mut until = 1.0_f64;
        for (a, below) in self.below.iter().enumerate() {
            if (cell[a] < *below) != (other[a] < *below) {
                return false;
            }
            let [d, c] = [cell, other].map(|place| self.away(place[a], a) as f64);
            since = since.max(c / (d + 1.0));
            until = until.min((c + 1.0) / d);
        }
        since < until
    }

    /// The neighbour along one axis that is nearer to the zero pose.
    pub(super) fn inwards(&self, place: &[usize], a: usize) -> Option<usize> {
        if self.away(place[a], a) == 0 {
            return None;
        }
        let mut inner = place.to_vec();
        inner[a] = if place[a] >= self.below[a] { place[a] - 1 } else { place[a] + 1 };
        Some(self.number(&inner))
    }

    /// All of them, those next to the zero pose first.
    pub(super) fn outwards(&self) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.len()).collect();
        let away = |number: &usize| {
            self.place(*number).iter().enumerate().map(|(a, i)| self.away(*i, a)).sum::<usize>()
        };
        all.sort_by_cached_key(away);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_crossed_where_a_path_to_another_goes_through_it() {
        let axis = |nodes, below| Axis { coordinate: 0, nodes, below, step: 1.0 };
        let axes = [axis(6, 2), axis(4, 0), axis(4, 3)];
        let grid = Grid::of_cells(&axes);
        for number in 0..grid.len() {
            let cell = grid.place(number);
            // points on paths to a lattice of points inside the cell
            let mut crossed = vec![false; grid.len()];
            for k in 0..6 * 6 * 6 {
                let share = [k % 6, k / 6 % 6, k / 36].map(|i| (f64::from(i) + 0.01) / 5.02);
                for t in (1..=400).map(|t| f64::from(t) / 400.0) {
                    let along = |a: usize| {
                        let to = cell[a] as f64 + share[a] - axes[a].below as f64;
                        (t * to + axes[a].below as f64) as usize
                    };
                    crossed[grid.number(&[along(0), along(1), along(2)])] = true;
                }
            }
            let crosses: Vec<bool> =
                (0..grid.len()).map(|other| grid.crosses(&cell, &grid.place(other))).collect();
            assert_eq!(crosses, crossed, "{cell:?}");
        }
    }
}
