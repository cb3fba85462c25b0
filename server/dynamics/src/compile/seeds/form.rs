//! Compares a closed form with the poses of a table: where both agree it replaces Newton's method.

use crate::closure::{Level, Seeds, column_unit};
use crate::compile::seeds::grid::{Grid, center};
use crate::compile::seeds::{ERROR, Node, Table};

/// Largest distance of a closed form from Newton's method at a node, in radians or cluster lengths.
const AGREES: f64 = 1e-9;

impl Table<'_> {
    /// True if the closed form agrees with the poses at the corners of a used cell and with the
    /// interpolation at its center.
    pub(super) fn form_holds(
        &mut self,
        seeds: &Seeds,
        zero: &[f64],
        nodes: &[Option<Node>],
    ) -> bool {
        if self.numerical.form.is_none() {
            return false;
        }
        let grid = Grid::of_cells(&seeds.axes);
        let corners = Grid::of_nodes(&seeds.axes);
        (0..grid.len()).filter(|cell| seeds.cells[*cell]).all(|cell| {
            let place = grid.place(cell);
            let mut center = center(&seeds.axes, zero, &place);
            let at_center = seeds.find(zero, &mut center) && self.form_is_at(&center, 2.0 * ERROR);
            at_center
                && corners.corners(&place).all(|corner| {
                    nodes[corner].as_ref().is_some_and(|node| self.form_is_at(&node.q, AGREES))
                })
        })
    }

    /// True if the closed form gives a pose's dependents from its independents.
    fn form_is_at(&mut self, q: &[f64], allowed: f64) -> bool {
        let model = self.model;
        let c = self.c;
        let cluster = &model.clusters[c];
        let at = cluster.coordinates();
        self.ws.q[at.clone()].copy_from_slice(q);
        self.ws.start[at.clone()].copy_from_slice(q);
        let Some(form) = &self.numerical.form else { return false };
        let bodies = model.bodies_of(cluster);
        form.close(cluster, bodies, &mut self.ws.local(cluster), Level::Position);
        cluster.dependent.iter().all(|v| {
            let i = cluster.dofs[*v].q;
            let apart = (self.ws.q[cluster.q + i] - q[i]).abs() / column_unit(cluster, *v);
            apart < allowed
        })
    }
}
