//! Forces along the independents and of the actuators as matrices times the parameters of bodies
//! and joints: see [`crate::guide::parameters`].

use sarrus_proto::{Field, Slot, Status};

use crate::algorithms;
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::derivatives::projection;
use crate::scalar::Real;
use crate::workspace::Workspace;

impl Plan {
    /// Y_y = Gᵀ Y_t and Y_u = P Gᵀ Y_t, where P takes τ_y into τ_u.
    #[inline(never)]
    pub(super) fn write_regressors<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        output: &mut [T],
    ) -> Result<(), Status> {
        let columns = model.sizes().n_parameters();
        if self.wants(Field::RegressorU) {
            self.actuation(model, ws)?;
        }
        let slot = |field| self.want().slot(field).map_or(0..0, Slot::range);
        let [of_y, of_u] = [slot(Field::RegressorY), slot(Field::RegressorU)];
        output[of_y.clone()].fill(T::ZERO);
        output[of_u.clone()].fill(T::ZERO);
        let rows = &self.needed;
        let Workspace { G, qd, qdd, motion, actuation, .. } = ws;
        let width = actuation.len() / model.sizes().n_v.max(1);
        algorithms::tree_regressor(model, (qd, qdd), motion, |v, first, numbers| {
            let mut add = |row: Option<usize>, range: &core::ops::Range<usize>, factor: T| {
                let Some(row) = row.filter(|_| !range.is_empty()) else { return };
                let to = &mut output[range.start + row * columns + first..];
                to.iter_mut().zip(numbers).for_each(|(to, x)| *to = factor.mul_add(*x, *to));
            };
            let cluster = &model.clusters[model.cluster_of_v[v]];
            for (k, g) in cluster.independents().zip(cluster.G(G).row(v - cluster.v)) {
                add(rows.vy.iter().position(|vy| *vy == k), &of_y, *g);
            }
            for ((u, _), x) in cluster.active.iter().zip(&actuation[v * width..]) {
                add(rows.u.iter().position(|picked| picked == u), &of_u, *x);
            }
        });
        Ok(())
    }

    /// G Pᵀ of all clusters: the row of a tree velocity holds its part in the forces of the
    /// actuators of its cluster.
    fn actuation<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>) -> Result<(), Status> {
        let width = ws.actuation.len() / model.sizes().n_v.max(1);
        for cluster in &model.clusters {
            let m = cluster.n_vy;
            if !cluster.is_serial() {
                projection(cluster, ws)?;
            }
            let Workspace { G, dense_spare: P, actuation, .. } = &mut *ws;
            let G = cluster.G(G);
            for v in 0..cluster.n_v {
                let to = &mut actuation[(cluster.v + v) * width..];
                for (r, ((_, j), to)) in cluster.active.iter().zip(to).enumerate() {
                    *to = if cluster.is_serial() {
                        G[(v, *j)]
                    } else {
                        let row = G.row(v).iter().zip(&P[r * m..]);
                        row.fold(T::ZERO, |sum, (g, P)| g.mul_add(*P, sum))
                    };
                }
            }
        }
        Ok(())
    }
}
