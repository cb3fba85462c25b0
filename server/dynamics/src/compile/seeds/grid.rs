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
