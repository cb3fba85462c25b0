//! Forces: inverse and forward dynamics, maps between the spaces, loop-closure forces.

use sarrus_proto::{Field, Slot, Status};

use crate::algorithms::{self, TreeMotion};
use crate::linalg::{factorise_tree, solve_tree};
use crate::model::{Model, UNEQUAL};
use crate::plan::actuation::to_actuators;
use crate::plan::run::RunReport;
use crate::plan::state::tree_accelerations;
use crate::plan::{Method, Plan};
use crate::scalar::{Mask, Scalar};
use crate::spatial::zero;
use crate::workspace::Workspace;

/// Part of the largest force that may be left over: rounding.
const BALANCE: f64 = 1e-14;
/// Part of the largest ÿ that what is left over may be worth, in a method that keeps ten digits.
const WORTH: f64 = 1e-10;

impl Plan {
    /// τ_q = M q̈ + C − Σ Jᵀ w, τ_y = Gᵀ τ_q, τ_u from G_uᵀ τ_u = τ_y.
    pub(super) fn inverse_dynamics<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        report: &mut RunReport<T>,
    ) -> Result<(), Status> {
        if self.wants_any(&[Field::CY]) {
            self.bias_force(model, ws, input, false);
        }
        if self.steps.newton_euler {
            let wrench = self.wrenches(model, ws, input).then_some(ws.wrench.as_slice());
            let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
            algorithms::newton_euler(model, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
            to_independent(model, &ws.G, &ws.tau_q, &mut ws.tau_y);
        }
        if self.wants_any(&[Field::TauU, Field::TauUnactuated, Field::Lambda]) {
            report.warn_if(to_actuators(model, ws)?);
        }
        if self.wants(Field::Lambda) {
            // what the tree needs beyond the actuators comes from the loops
            ws.loop_q.copy_from_slice(&ws.tau_q);
            model.order.u_v.iter().zip(&ws.tau_u).for_each(|(v, tau)| ws.loop_q[*v] -= *tau);
            independents_subtract(model, &ws.tau_rest, &mut ws.loop_q);
        }
        if self.steps.mass_matrix {
            algorithms::reduced_mass_matrix(model, ws);
        }
        Ok(())
    }

    /// ÿ from M_y ÿ + C_y = τ_y, then q̈ = G ÿ + g; without loops tree and independent velocities
    /// are numbered alike.
    pub(super) fn forward_dynamics<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        report: &mut RunReport<T>,
    ) -> Result<(), Status> {
        if model.is_massless {
            return Err(Status::MassNotPositive);
        }
        self.bias_force(model, ws, input, true);
        self.given_forces(model, ws, input);
        let n = model.meta.sizes.n_vy;
        for k in 0..n {
            ws.ydd[k] = ws.tau_y[k] - ws.C_y[k];
        }
        if self.wants(Field::CY) && self.query.given.has(Field::Wrenches) {
            self.bias_force(model, ws, input, false);
        }
        if self.steps.mass_matrix {
            algorithms::reduced_mass_matrix(model, ws);
        }
        // the whole system has no pivots to judge: the recursion's tell of its masses too
        if self.method == Method::Kkt {
            ws.ydd.fill(T::ZERO);
        }
        let (positive, unequal) = if self.method == Method::Projection {
            ws.factor.copy_from_slice(&ws.M_y);
            let positive = factorise_tree(&model.sparsity, &mut ws.factor);
            solve_tree(&model.sparsity, &ws.factor, &mut ws.ydd);
            (positive, unequal(model, model.sparsity.diagonal().map(|at| ws.factor[at])))
        } else {
            let positive = algorithms::embedded_solve(model, ws);
            (positive, unequal(model, ws.embedding.inverses(model)))
        };
        report.warn_if(unequal);
        if self.method == Method::Kkt {
            self.tree_forward_dynamics(model, ws, input)?;
            report.warn_if(!self.balanced(model, ws, input));
            return Ok(());
        }
        if !positive.all() {
            return Err(Status::MassNotPositive);
        }
        for cluster in &model.clusters {
            for (k, &j) in cluster.independent.iter().enumerate() {
                ws.qdd[cluster.v + j] = ws.ydd[cluster.vy + k];
            }
            if self.steps.tree_acceleration {
                tree_accelerations(cluster, ws);
            }
        }
        if self.wants(Field::Lambda) {
            // τ_q of the motion less the given forces is what the loops supply
            let wrench = self.query.given.has(Field::Wrenches).then_some(ws.wrench.as_slice());
            let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
            algorithms::newton_euler(model, &tree, wrench, &mut ws.motion, &mut ws.loop_q);
            self.each_given_force(model, input, |v, tau| ws.loop_q[v] -= tau);
        }
        Ok(())
    }

    /// q̈ of the tree under its constraints.
    fn tree_forward_dynamics<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
    ) -> Result<(), Status> {
        let wrench = self.wrenches(model, ws, input).then_some(ws.wrench.as_slice());
        ws.qdd.fill(T::ZERO);
        let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
        algorithms::newton_euler(model, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        ws.loop_q.fill(T::ZERO);
        self.each_given_force(model, input, |v, tau| ws.loop_q[v] = tau);
        self.kkt(model, ws)
    }

    /// True where ÿ of the whole system balances the given forces along every independent motion up
    /// to rounding, or so nearly that M_y makes little of what is left.
    fn balanced<T: Scalar>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) -> bool {
        let wrench = self.query.given.has(Field::Wrenches).then_some(ws.wrench.as_slice());
        // q̈ = G ÿ + g: that of the system need not keep the loops closed
        let mut qdd = core::mem::take(&mut ws.start_rate);
        qdd.copy_from_slice(&ws.qdd);
        for &c in &model.closed_clusters {
            let cluster = &model.clusters[c];
            for &j in &cluster.dependent {
                let row = cluster.G(&ws.G).row(j).iter().zip(&cluster.independent);
                qdd[cluster.v + j] = row
                    .fold(ws.g[cluster.v + j], |sum, (g, i)| g.mul_add(ws.qdd[cluster.v + i], sum));
            }
        }
        let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &qdd };
        algorithms::newton_euler(model, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        ws.start_rate = qdd;
        let size = |tau: &[T]| {
            tau.iter().fold(T::ZERO, |size, x| T::select(size.lt(x.abs()), x.abs(), size))
        };
        let mut largest = size(&ws.tau_q);
        self.each_given_force(model, input, |v, tau| {
            largest = T::select(largest.lt(tau.abs()), tau.abs(), largest);
            ws.tau_q[v] -= tau;
        });
        to_independent(model, &ws.G, &ws.tau_q, &mut ws.ydd);
        if size(&ws.ydd).lt(largest * T::from_f64(BALANCE)) || largest == T::ZERO {
            return true;
        }
        let positive = algorithms::embedded_solve(model, ws);
        let given =
            model.order.vy_v.iter().fold(T::ZERO, |size, v| {
                T::select(size.lt(ws.qdd[*v].abs()), ws.qdd[*v].abs(), size)
            });
        positive && size(&ws.ydd).lt(given * T::from_f64(WORTH))
    }

    /// The given forces by internal tree velocity; a force on an independent is one on its joint.
    fn each_given_force<T: Scalar>(
        &self,
        model: &Model<T>,
        input: &[T],
        mut each: impl FnMut(usize, T),
    ) {
        let order = &model.order;
        for (field, order) in
            [(Field::TauU, &order.u_v), (Field::TauY, &order.vy_v), (Field::TauQ, &order.v)]
        {
            if let Some(slot) = self.given.slot(field) {
                input[slot.range()].iter().zip(order).for_each(|(tau, v)| each(*v, *tau));
                return;
            }
        }
    }

    /// Forces from one space to the others at the closed state.
    pub(super) fn map_forces<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        report: &mut RunReport<T>,
    ) -> Result<(), Status> {
        if self.wants_any(&[Field::TauY, Field::TauU, Field::TauUnactuated]) {
            self.given_forces(model, ws, input);
            if self.wants_any(&[Field::TauU, Field::TauUnactuated]) {
                report.warn_if(to_actuators(model, ws)?);
            }
        }
        Ok(())
    }

    /// C_y = Gᵀ (C + M g), with the wrenches on the left-hand side where they are to be counted.
    fn bias_force<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        with_wrenches: bool,
    ) {
        // q̈ = g
        let wrench =
            (with_wrenches && self.wrenches(model, ws, input)).then_some(ws.wrench.as_slice());
        let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.g };
        algorithms::newton_euler(model, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        to_independent(model, &ws.G, &ws.tau_q, &mut ws.C_y);
    }

    /// The given forces as τ_y.
    fn given_forces<T: Scalar>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) {
        let slot = |field| self.given.slot(field).map(|slot: &Slot| &input[slot.range()]);
        if let Some(tau) = slot(Field::TauY) {
            tau.iter().zip(&model.order.vy).for_each(|(x, k)| ws.tau_y[*k] = *x);
            return;
        }
        ws.tau_q.fill(T::ZERO);
        if let Some(tau) = slot(Field::TauU) {
            tau.iter().zip(&model.order.u_v).for_each(|(x, v)| ws.tau_q[*v] = *x);
        } else if let Some(tau) = slot(Field::TauQ) {
            tau.iter().zip(&model.order.v).for_each(|(x, v)| ws.tau_q[*v] = *x);
        }
        to_independent(model, &ws.G, &ws.tau_q, &mut ws.tau_y);
    }

    /// The given wrenches on their bodies; false where there are none.
    fn wrenches<T: Scalar>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) -> bool {
        let Some(slot) = self.given.slot(Field::Wrenches) else { return false };
        wrenches_on_bodies(
            model,
            ws,
            &self.wrench_bodies,
            &self.wrench_links,
            &input[slot.range()],
        );
        true
    }
}

/// Wrenches on links, `[n; f]` in world axes at their frames' origins, as those on bodies; `bodies`
/// carry the links, and their poses in their parents are known.
pub(crate) fn wrenches_on_bodies<T: Scalar>(
    model: &Model<T>,
    ws: &mut Workspace<T>,
    bodies: &[usize],
    links: &[usize],
    wrenches: &[T],
) {
    algorithms::world_poses(model, bodies, &ws.motion, &mut ws.world);
    ws.wrench.fill((zero(), zero()));
    for (link, wrench) in links.iter().zip(wrenches.chunks_exact(6)) {
        let frame = &model.frames[*link];
        let (n, f) = algorithms::frame_wrench(frame, &ws.world, wrench);
        ws.wrench[frame.body].0 += n;
        ws.wrench[frame.body].1 += f;
    }
}

/// τ_y = Gᵀ τ_q, cluster by cluster.
fn to_independent<T: Scalar>(model: &Model<T>, G: &[T], tau_q: &[T], tau_y: &mut [T]) {
    for cluster in &model.clusters {
        let m = cluster.n_vy;
        if cluster.is_serial() {
            tau_y[cluster.independents()].copy_from_slice(&tau_q[cluster.v..cluster.v + m]);
            continue;
        }
        let G = cluster.G(G);
        for k in 0..m {
            let mut tau = T::ZERO;
            for j in 0..cluster.n_v {
                tau = G[(j, k)].mul_add(tau_q[cluster.v + j], tau);
            }
            tau_y[cluster.vy + k] = tau;
        }
    }
}

/// Takes a force on the independents off the tree forces.
fn independents_subtract<T: Scalar>(model: &Model<T>, tau_y: &[T], tau_q: &mut [T]) {
    for cluster in &model.clusters {
        for (k, &j) in cluster.independent.iter().enumerate() {
            tau_q[cluster.v + j] -= tau_y[cluster.vy + k];
        }
    }
}

/// True where a joint's inertia is as good as gone, given the inverses of what is left of each in
/// internal order.
fn unequal<T: Scalar>(model: &Model<T>, inverses: impl Iterator<Item = T>) -> bool {
    inverses.zip(&model.inertia).fold(false, |unequal, (inverse, inertia)| {
        unequal | T::from_f64(UNEQUAL).lt(inverse * T::from_f64(*inertia))
    })
}
