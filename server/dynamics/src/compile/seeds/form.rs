//! Compares a closed form with the poses of a table: where both agree it replaces Newton's method.

use sarrus_proto::Status;

use crate::closure::{Formed, Level, Seeds, column_unit};
use crate::compile::seeds::grid::{Grid, center};
use crate::compile::seeds::{ERROR, Node, Table};
use crate::mechanism::{Dof, Motion, Winding};

/// Largest distance of a closed form from Newton's method at a node, in radians or cluster lengths.
pub(super) const AGREES: f64 = 1e-9;
/// Largest residual of rows that a form leaves out, in radians or cluster lengths.
const CLOSED: f64 = 1e-12;
/// Largest angle from the middle of a coordinate's range, less than half a turn.
const ANGLE: f64 = 2.8;

impl Table<'_> {
    /// The closed form, with the turns of its coordinates, if it agrees with the poses at the
    /// corners of a used cell and with the interpolation at its center.
    pub(super) fn form(
        &mut self,
        seeds: &Seeds,
        zero: &[f64],
        nodes: &[Option<Node>],
    ) -> Option<Box<Formed<f64>>> {
        let mut form = self.form.clone()?;
        form.set_signs(&self.signs);
        // a seed has whole turns of its own
        let seeded: Vec<usize> = form.seeded().iter().map(|dof| dof.q).collect();
        let turns = |dof: &Dof| dof.motion == Motion::Revolute && !seeded.contains(&dof.q);
        let grid = Grid::of_cells(&seeds.axes);
        let corners = Grid::of_nodes(&seeds.axes);
        let used =
            || (0..grid.len()).filter(|cell| seeds.cells[*cell]).map(|cell| grid.place(cell));
        let around = || used().flat_map(|place| corners.corners(&place).collect::<Vec<_>>());
        let cluster = self.cluster();
        let dofs = cluster.dependent.iter().map(|v| cluster.dofs[*v]);
        for dof in dofs.filter(turns) {
            let turns = self.numerical.turns.iter().map(|of| (of.coordinate, of.turns[dof.q]));
            let turns: Vec<(usize, f64)> = turns.filter(|(_, w)| *w != 0.0).collect();
            let off = |corner: usize| {
                nodes[corner].as_ref().map_or(0.0, |node| {
                    turns.iter().fold(node.q[dof.q], |off, (k, w)| off - w * node.q[*k])
                })
            };
            let least = around().map(off).fold(0.0, f64::min);
            let most = around().map(off).fold(0.0, f64::max);
            if most - least > 2.0 * ANGLE {
                return None;
            }
            if !turns.is_empty() || least < -ANGLE || most > ANGLE {
                let middle = 0.5 * (least + most);
                let winding = Winding { coordinate: dof.q, middle, turns, is_function: true };
                form.windings.push(winding);
            }
        }
        self.form = Some(form.clone());
        loop {
            let holds = used().all(|place| {
                let mut center = center(&seeds.axes, zero, &place);
                let at_center = self.seed(seeds, zero, &mut center)
                    && self.form_is_at(&form, &center, 2.0 * ERROR);
                at_center
                    && corners.corners(&place).all(|corner| {
                        let at_corner = |node: &Node| self.form_is_at(&form, &node.q, AGREES);
                        nodes[corner].as_ref().is_some_and(at_corner)
                    })
            });
            if holds || !form.lengthen() {
                return holds.then_some(form);
            }
        }
    }

    /// True if the closed form gives a pose's dependents from its independents.
    fn form_is_at(&mut self, form: &Formed<f64>, q: &[f64], allowed: f64) -> bool {
        let model = self.model;
        let c = self.c;
        let cluster = &model.clusters[c];
        let at = cluster.coordinates();
        self.ws.q[at.clone()].copy_from_slice(q);
        self.ws.start[at.clone()].copy_from_slice(q);
        let bodies = model.bodies_of(cluster);
        let mut local = self.ws.local(cluster, bodies);
        let outcome = form.close(&mut local, Level::Position);
        let gap = form.gap(&mut local);
        let agrees = |v: &usize| {
            let i = cluster.dofs[*v].q;
            let apart = (self.ws.q[cluster.q + i] - q[i]).abs() / column_unit(cluster, *v);
            apart < allowed
        };
        outcome.status == Status::Ok && gap < CLOSED && cluster.dependent.iter().all(agrees)
    }
}
