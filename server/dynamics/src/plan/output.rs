//! Packs the output from the workspace.

use sarrus_proto::{Field, Slot, Status};

use crate::algorithms;
use crate::linalg::solve_sound;
use crate::mechanism::Frame;
use crate::model::Model;
use crate::plan::diagnostics::singular;
use crate::plan::needed::{OBSERVED, OF_THE_LINKS};
use crate::plan::run::RunReport;
use crate::plan::{Plan, links};
use crate::scalar::{Real, all_finite};
use crate::workspace::Workspace;

impl Plan {
    /// Writes every wanted field.
    #[inline(always)]
    pub(super) fn write<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &mut RunReport<T>,
        input: &[T],
        output: &mut [T],
    ) -> Result<(), Status> {
        if self.steps.frames || self.steps.links {
            algorithms::world_poses(model, &self.frame_bodies, &ws.motion, &mut ws.world);
            if self.steps.frame_velocities {
                algorithms::velocities(model, &self.frame_bodies, &ws.qd, &mut ws.motion);
            }
        }
        // before others compute cosines again, which are those of the closures' own forms
        if self.steps.geometry && !T::STRAIGHT {
            self.write_geometry(model, ws, output)?;
        }
        if self.steps.conditions {
            self.write_conditions(model, ws, output)?;
        }
        for slot in self.want().slots() {
            self.write_field(model, ws, slot, &mut output[slot.range()])?;
        }
        if self.motors.is_some() || self.steps.task_space || self.steps.regressor {
            self.write_rare(model, ws, report, input, output)?;
        }
        self.write_figure(Field::Iterations, T::from_f64(f64::from(report.iterations)), output);
        self.write_figure(Field::Projection, T::from_f64(report.projection), output);
        self.check_overflow(output)
    }

    /// Writes the fields of motors and of parameters, then those of task space, which overwrites
    /// the workspace.
    #[inline(never)]
    fn write_rare<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &mut RunReport<T>,
        input: &[T],
        output: &mut [T],
    ) -> Result<(), Status> {
        // no packet has them
        if let (Some(motors), false) = (&self.motors, T::STRAIGHT) {
            self.write_motors(model, ws, motors, input, output)?;
        }
        if self.steps.regressor && !T::STRAIGHT {
            self.write_regressors(model, ws, output)?;
        }
        if self.steps.task_space {
            self.write_task_space(model, ws, report, output)?;
        }
        Ok(())
    }

    /// Numbers too large to be computed with are no answer; a condition may be infinite.
    #[inline(always)]
    fn check_overflow<T: Real>(&self, output: &[T]) -> Result<(), Status> {
        let has_rare = self.motors.is_some() || self.task.is_some() || !self.base.is_empty();
        let fits = if self.steps.conditions || has_rare {
            self.are_finite(output)
        } else {
            all_finite(output)
        };
        if fits { Ok(()) } else { Err(Status::NonFiniteInput) }
    }

    /// The same of a plan with fields that may be infinite.
    #[inline(never)]
    fn are_finite<T: Real>(&self, output: &[T]) -> bool {
        let may_be_infinite = |field: Field| {
            matches!(field, Field::CondKd | Field::CondGu | Field::CondMy)
                || matches!(field, Field::TaskResidual | Field::Solutions | Field::BaseParameters)
                || field.is_of_motors()
        };
        let mut slots = self.want().slots().iter().filter(|slot| !may_be_infinite(slot.field));
        slots.all(|slot| all_finite(&output[slot.range()]))
    }

    /// Writes NaN except to the outputs that survive a failure.
    pub(super) fn write_failure<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        report: &RunReport<T>,
        output: &mut [T],
    ) {
        output.fill(T::from_f64(f64::NAN));
        let slot = |field| self.want().slot(field).map(Slot::range);
        if let (Some(range), true) = (slot(Field::NearestY), report.nearest) {
            let nearest = output[range].iter_mut().zip(&self.needed.qy_q);
            nearest.for_each(|(x, q)| *x = ws.q[*q].plus_zero());
        }
        self.write_figure(Field::Residual, report.residual, output);
        self.write_figure(Field::SigmaMin, self.distance_after(model, ws, report), output);
        self.write_figure(Field::Iterations, T::from_f64(f64::from(report.iterations)), output);
        if let (Some(range), true) = (slot(Field::GoodIndependents), report.failed) {
            let independents = output[range].iter_mut().zip(&ws.loop_q);
            independents.for_each(|(x, is_good)| *x = is_good.plus_zero());
        }
        if let (Some(range), Status::SingularActuation) = (slot(Field::Uncontrolled), report.status)
        {
            // the one that failed was closed as far as it matters here
            let direction = &mut output[range];
            singular::uncontrolled(model, ws, report.closed + 1, direction);
            direction.iter_mut().for_each(|x| *x = x.plus_zero());
        }
    }

    pub(super) fn write_figure<T: Real>(&self, field: Field, value: T, output: &mut [T]) {
        if let Some(slot) = self.want().slot(field) {
            output[slot.offset] = value.plus_zero();
        }
    }

    /// A field that stands in the workspace, or one that is formed from it, without a negative
    /// zero where it was not given. By itself: in the loop over the fields, all that any field
    /// needs would be read before the first.
    #[inline(never)]
    fn write_field<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        slot: &Slot,
        out: &mut [T],
    ) -> Result<(), Status> {
        let rows = &self.needed;
        let (from, order) = match slot.field {
            Field::Y | Field::NearestY => (&ws.q, &rows.qy_q),
            Field::Yd => (&ws.qd, &rows.vy_v),
            Field::Ydd => (&ws.qdd, &rows.vy_v),
            Field::Q => (&ws.q, &rows.q),
            Field::Qd => (&ws.qd, &rows.v),
            Field::Qdd => (&ws.qdd, &rows.v),
            Field::U => (&ws.q, &rows.u_q),
            Field::Ud => (&ws.qd, &rows.u_v),
            Field::Udd => (&ws.qdd, &rows.u_v),
            Field::TauQ => (&ws.tau_q, &rows.v),
            Field::TauY => (&ws.tau_y, &rows.vy),
            Field::TauUnactuated => (&ws.tau_rest, &rows.vy),
            Field::TauU => (&ws.tau_u, &rows.u),
            Field::CY => (&ws.C_y, &rows.vy),
            Field::GBias => (&ws.g, &rows.v),
            Field::GUBias => (&ws.g, &rows.u_v),
            _ => {
                let formed = self.write_formed(model, ws, slot, out);
                out.iter_mut().for_each(|x| *x = x.plus_zero());
                return formed;
            }
        };
        // numbers that were given come back as they are
        let is_given = matches!(slot.field, Field::Y | Field::Yd | Field::Ydd)
            && self.query().given.has(slot.field);
        if is_given {
            out.iter_mut().zip(order).for_each(|(x, i)| *x = from[*i]);
        } else {
            out.iter_mut().zip(order).for_each(|(x, i)| *x = from[*i].plus_zero());
        }
        Ok(())
    }

    #[inline(never)]
    fn write_formed<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        slot: &Slot,
        out: &mut [T],
    ) -> Result<(), Status> {
        let order = &model.order;
        let rows = &self.needed;
        match slot.field {
            Field::G => write_G(model, ws, out, &rows.v),
            Field::GU => write_G(model, ws, out, &rows.u_v),
            Field::MY => {
                let n = order.vy.len();
                for (i, &a) in rows.vy.iter().enumerate() {
                    for (j, &b) in order.vy.iter().enumerate() {
                        out[i * n + j] =
                            model.sparsity.entry(a, b).map_or(T::ZERO, |at| ws.M_y[at]);
                    }
                }
            }
            Field::FramePose => self.each_frame(model, out, 7, |frame, out| {
                out.copy_from_slice(&self.view(model).pose(frame, &ws.world))
            }),
            Field::FrameTwist => {
                self.each_frame(model, out, 6, |frame, out| {
                    out.copy_from_slice(&self.view(model).twist(frame, &ws.world, &ws.motion))
                });
            }
            Field::FrameAcc | Field::JdYd => {
                let of_twist = slot.field == Field::JdYd;
                let qdd = if of_twist { &ws.g } else { &ws.qdd };
                algorithms::rates(model, &self.frame_bodies, &ws.qd, qdd, &mut ws.motion);
                self.each_frame(model, out, 6, |frame, out| {
                    let view = self.view(model);
                    out.copy_from_slice(&view.acceleration(frame, &ws.world, &ws.motion, of_twist))
                });
            }
            field if OF_THE_LINKS.contains(&field) => {
                return links::write(model, ws, &self.frame_bodies, field, out);
            }
            Field::JacobianTree => self.each_frame(model, out, 6 * order.v.len(), |frame, out| {
                self.tree_jacobian(model, ws, frame, out)
            }),
            Field::JacobianIndependent => {
                self.each_frame(model, out, 6 * order.vy.len(), |frame, out| {
                    self.independent_jacobian(model, ws, frame, out, &order.vy_external)
                });
            }
            Field::Limits => self.write_limits(model, ws, out),
            Field::JacobianActuator => return self.actuator_jacobians(model, ws, out),
            field if field.is_second() => out.fill(T::ZERO),
            Field::BaseParameters => {
                out.iter_mut().zip(&self.base).for_each(|(to, x)| *to = T::from_f64(*x));
            }
            field if (field.is_derivative() || OBSERVED.contains(&field)) && !T::STRAIGHT => {
                self.write_derivative(model, ws, field, out);
            }
            // written where they are computed
            _ => {}
        }
        Ok(())
    }

    pub(super) fn each_frame<T: Real>(
        &self,
        model: &Model<T>,
        out: &mut [T],
        len: usize,
        mut write: impl FnMut(&Frame<T>, &mut [T]),
    ) {
        for (link, out) in self.frames.iter().zip(out.chunks_exact_mut(len.max(1))) {
            write(&model.frames[*link], out);
        }
    }

    /// J over u̇ = J over ẏ · G_u⁻¹, cluster by cluster.
    fn actuator_jacobians<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        out: &mut [T],
    ) -> Result<(), Status> {
        let n_u = model.sizes().n_u;
        let n_vy = model.sizes().n_vy;
        out.fill(T::ZERO);
        for (link, out) in self.frames.iter().zip(out.chunks_exact_mut((6 * n_u).max(1))) {
            let frame = &model.frames[*link];
            let mut spare = core::mem::take(&mut ws.jacobian);
            self.independent_jacobian(model, ws, frame, &mut spare, &model.order.vy_internal);
            ws.jacobian = spare;
            let Workspace { G, jacobian: J, dense, dense_rhs, .. } = &mut *ws;
            for cluster in &model.clusters {
                let m = cluster.n_vy;
                if (0..m).all(|k| (0..6).all(|row| J[row * n_vy + cluster.vy + k] == T::ZERO)) {
                    continue;
                }
                if cluster.active.len() != m {
                    return Err(Status::SingularActuation);
                }
                // G_uᵀ Xᵀ = Jᵀ
                let G = cluster.G(G);
                for k in 0..m {
                    for (r, &(_, j)) in cluster.active.iter().enumerate() {
                        dense[k * m + r] = G[(j, k)];
                    }
                    for row in 0..6 {
                        dense_rhs[k * 6 + row] = J[row * n_vy + cluster.vy + k];
                    }
                }
                solve_sound(dense, dense_rhs, m, 6, cluster.least_authority)
                    .ok_or(Status::SingularActuation)?;
                for (r, (u, _)) in cluster.active.iter().enumerate() {
                    for row in 0..6 {
                        out[row * n_u + u] = dense_rhs[r * 6 + row];
                    }
                }
            }
        }
        Ok(())
    }
}

/// The rows of G of these internal velocities.
fn write_G<T: Real>(model: &Model<T>, ws: &Workspace<T>, out: &mut [T], velocities: &[usize]) {
    let n_vy = model.sizes().n_vy;
    out.fill(T::ZERO);
    for (row, v) in out.chunks_exact_mut(n_vy.max(1)).zip(velocities) {
        let cluster = &model.clusters[model.cluster_of_v[*v]];
        let G = cluster.G(&ws.G).row(v - cluster.v);
        for (k, g) in cluster.independents().zip(G) {
            row[model.order.vy_external[k]] = *g;
        }
    }
}

impl Plan {
    /// Jacobian over the tree velocities (6 × n_v).
    fn tree_jacobian<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        frame: &Frame<T>,
        out: &mut [T],
    ) {
        let n_v = model.sizes().n_v;
        out.fill(T::ZERO);
        self.view(model).columns(model, frame, &ws.world, |v, column| {
            for row in 0..6 {
                out[row * n_v + model.order.v_external[v]] = column[row];
            }
        });
    }

    /// Jacobian over the independent velocities (6 × n_vy), J G, with the columns in the given
    /// order.
    pub(super) fn independent_jacobian<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        frame: &Frame<T>,
        out: &mut [T],
        order: &[usize],
    ) {
        let n_vy = model.sizes().n_vy;
        out.fill(T::ZERO);
        self.view(model).columns(model, frame, &ws.world, |v, column| {
            let cluster = &model.clusters[model.cluster_of_v[v]];
            for (k, g) in cluster.G(&ws.G).row(v - cluster.v).iter().enumerate() {
                for row in 0..6 {
                    let entry = &mut out[row * n_vy + order[cluster.vy + k]];
                    *entry = column[row].mul_add(*g, *entry);
                }
            }
        });
    }
}
