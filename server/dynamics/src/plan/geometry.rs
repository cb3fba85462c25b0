//! Derivatives of the closed configuration and of frames by the geometry, at fixed y: see
//! [`crate::guide::parameters`].

use sarrus_proto::{Field, Slot, Status};

use crate::mechanism::{Cluster, Cut};
use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::Real;
use crate::spatial::Matrix;
use crate::workspace::{Derivatives, Workspace};

impl Plan {
    /// Rows of tree velocities, then six of each frame.
    #[inline(never)]
    pub(super) fn write_geometry<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        output: &mut [T],
    ) -> Result<(), Status> {
        // a workspace without them does not serve this plan
        let mut d = ws.derivatives.take().ok_or(Status::WrongSize)?;
        let out = &mut output[self.want().slot(Field::DgammaDtheta).map_or(0..0, Slot::range)];
        let width = model.sizes().n_geometry();
        out.fill(T::ZERO);
        let (of_q, of_frames) = out.split_at_mut(self.needed.v.len() * width);
        self.each_frame(model, of_frames, 6 * width, |frame, out| {
            self.view(model).by_geometry(model, frame, &ws.world, |joint, k, column| {
                for (row, x) in column.into_iter().enumerate() {
                    out[row * width + 6 * joint + k] = x;
                }
            });
        });
        let mut written = Ok(());
        for &c in &self.needed.scope.closed {
            // couplings have no geometry
            if model.clusters[c].cuts.iter().all(Cut::is_coupling) {
                continue;
            }
            if !solve(model, &model.clusters[c], ws, &mut d) {
                written = Err(Status::SingularClosure);
                break;
            }
            self.add_cluster(model, c, ws, &d.by_geometry, [&mut *of_q, &mut *of_frames]);
        }
        out.iter_mut().for_each(|x| *x = x.plus_zero());
        ws.derivatives = Some(d);
        written
    }

    /// Adds the dependents of a cluster.
    fn add_cluster<T: Real>(
        &self,
        model: &Model<T>,
        c: usize,
        ws: &Workspace<T>,
        X: &[T],
        [of_q, of_frames]: [&mut [T]; 2],
    ) {
        let cluster = &model.clusters[c];
        let width = model.sizes().n_geometry();
        let own = cluster.n_geometry();
        // columns of each place among those of the model
        let column = |place: usize| {
            if let Some(end) = place.checked_sub(cluster.n) {
                let cut = model.order.cuts.iter().position(|cut| *cut == (c, end / 2))?;
                Some(6 * (model.order.bodies.len() + 2 * cut + end % 2))
            } else {
                model.order.joint_of(cluster.body + place).map(|(joint, _)| 6 * joint)
            }
        };
        let dependent = |v: usize| {
            let local = v.checked_sub(cluster.v)?;
            cluster.dependent.iter().position(|j| *j == local)
        };
        let columns = (0..own / 6).filter_map(|place| Some((6 * place, column(place)?)));
        for (from, to) in columns {
            for (row, v) in self.needed.v.iter().enumerate() {
                let Some(a) = dependent(*v) else { continue };
                of_q[row * width + to..][..6].copy_from_slice(&X[a * own + from..][..6]);
            }
            self.each_frame(model, of_frames, 6 * width, |frame, out| {
                self.view(model).columns(model, frame, &ws.world, |v, column| {
                    let Some(a) = dependent(v) else { return };
                    for (row, x) in column.into_iter().enumerate() {
                        let out = &mut out[row * width + to..][..6];
                        let moves = &X[a * own + from..][..6];
                        out.iter_mut().zip(moves).for_each(|(y, m)| *y = x.mul_add(*m, *y));
                    }
                });
            });
        }
    }
}

/// ∂q/∂θ of the dependents of a cluster; false where K_d is singular.
fn solve<T: Real>(
    model: &Model<T>,
    cluster: &Cluster<T>,
    ws: &Workspace<T>,
    d: &mut Derivatives<T>,
) -> bool {
    let bodies = model.bodies_of(cluster);
    let pose = (&ws.q[cluster.coordinates()], &ws.cos_sin[cluster.bodies()]);
    let still = &d.still[cluster.velocities()];
    let is_regular = d.second.at(cluster, bodies, pose, (still, still));
    let axes = |place: usize| {
        let link = model.order.joint_of(cluster.body + place).map(|(_, link)| link);
        link.map_or(Matrix::identity(), |link| model.frames[link].x_body_frame.R)
    };
    if is_regular {
        d.second.by_geometry(cluster, bodies, axes, &mut d.by_geometry);
    }
    is_regular
}
