//! Forces: inverse and forward dynamics, maps between the spaces, loop-closure forces.

use sarrus_proto::{Field, QueryOptions, Slot, Status};

use crate::algorithms::{self, TreeMotion};
use crate::closure::column_unit;
use crate::mechanism::{Cluster, Friction};
use crate::model::{Direct, Method, Model, Runs, Scope};
use crate::plan::Plan;
use crate::plan::actuation::{to_actuators, to_warn};
use crate::plan::diagnostics::digits::{ZERO, cancellation};
use crate::plan::needed::{OF_ACTUATORS, READ_TAU_U};
use crate::plan::run::{Pass, RunReport};
use crate::plan::state::tree_accelerations;
use crate::scalar::{BranchValue, Real};
use crate::spatial::zero;
use crate::workspace::Workspace;

/// Remainder, relative to the largest force, that counts as rounding.
const BALANCE: f64 = 1e-14;
/// Largest remainder relative to the largest ÿ, in a method that keeps ten digits.
const WORTH: f64 = 1e-10;
/// Fields of actuators that read C_y − Gᵀ Σ Jᵀ w.
const NET: [Field; 2] = [Field::TorqueVerticesNet, Field::TorqueSupportNet];

/// The largest of each over the independents: inertia / pivot, Σ |terms| / pivot, Σ |terms| /
/// inertia.
struct Divided<T> {
    inertia: T,
    terms: T,
    alone: T,
}

/// Ratio of inertia to articulated inertia in an ordinary robot; a chain of a hundred links has
/// more than five thousand without losing digits.
const PIVOTS: f64 = 200.0;
/// Acceleration below which a joint counts as still, relative to the one that its own forces would
/// cause alone.
const STILL: f64 = 1e-3;
/// Ratio of the forces of actuators to those along the independents where control is ordinary.
const CONTROL: f64 = 1000.0;
/// Difference of accelerations from those of their terms below which they are looked at one by one,
/// and part of it that ordinary robots have without losing digits.
const APART: f64 = 5e5;
const SPREAD: f64 = 100.0;
/// Error of the accelerations of an ordinary robot, in unit roundoffs.
const ROUNDINGS: f64 = 50.0;

impl Plan {
    /// τ_q = M q̈ + C − Σ Jᵀ w, τ_y = Gᵀ τ_q, τ_u from G_uᵀ τ_u = τ_y.
    pub(super) fn inverse_dynamics<T: Real>(&self, pass: Pass<'_, T>) -> Result<(), Status> {
        let Pass { model, ws, input, report } = pass;
        let scope = &self.needed.scope;
        if self.wants_any(&NET) {
            self.bias_force(model, ws, input, true);
            ws.C_net.copy_from_slice(&ws.C_y);
        }
        if self.wants(Field::CY) {
            ws.tau_terms.fill(T::ZERO);
            self.bias_force(model, ws, input, false);
            self.doubt_forces(&ws.tau_terms, &ws.C_y, report);
        }
        if self.steps.newton_euler {
            self.tree_forces(model, ws, input, (self.steps.rest, false, true));
            ws.tau_terms.fill(T::ZERO);
            to_independent(model, scope, &ws.G, &ws.tau_q, &mut ws.tau_y, &mut ws.tau_terms);
            self.doubt_forces(&ws.tau_terms, &ws.tau_y, report);
        }
        if self.wants_any(&READ_TAU_U) || self.wants_any(&OF_ACTUATORS) {
            report.doubt.times(to_actuators(model, scope, ws)?);
        } else if self.reads_forces() {
            to_warn(model, scope, ws);
        }
        if self.wants(Field::Lambda) {
            // the loops supply the forces of the tree beyond the actuators
            ws.loop_q.copy_from_slice(&ws.tau_q);
            model.order.u_v.iter().zip(&ws.tau_u).for_each(|(v, tau)| ws.loop_q[*v] -= *tau);
            independents_subtract(model, &ws.tau_rest, &mut ws.loop_q);
        }
        if self.steps.mass_matrix {
            algorithms::reduced_mass_matrix(model, scope, ws);
        }
        Ok(())
    }

    /// ÿ from M_y ÿ + C_y = τ_y, then q̈ = G ÿ + g; without loops tree and independent velocities
    /// are numbered alike.
    pub(super) fn forward_dynamics<T: Real>(&self, pass: Pass<'_, T>) -> Result<(), Status> {
        let Pass { model, ws, input, report } = pass;
        if model.is_massless {
            return Err(Status::MassNotPositive);
        }
        let scope = &self.needed.scope;
        ws.tau_terms.fill(T::ZERO);
        self.bias_force(model, ws, input, true);
        report.doubt.times(self.given_forces(model, ws, input));
        if self.wants_any(&NET) {
            ws.C_net.copy_from_slice(&ws.C_y);
        }
        for run in scope.independents.runs() {
            let forces = ws.tau_y[run.clone()].iter().zip(&ws.C_y[run.clone()]);
            ws.ydd[run].iter_mut().zip(forces).for_each(|(x, (tau, C))| *x = *tau - *C);
        }
        if self.wants(Field::CY) && self.feels_wrenches() {
            self.bias_force(model, ws, input, false);
        }
        if self.steps.mass_matrix {
            algorithms::reduced_mass_matrix(model, scope, ws);
        }
        // the whole system has no pivots to judge: those of the recursion are looked at
        if self.method == Method::Kkt {
            ws.ydd.fill(T::ZERO);
        }
        let positive = if self.method == Method::Projection {
            algorithms::projected_solve(model, scope, ws)
        } else {
            algorithms::embedded_solve(model, scope, ws)
        };
        let Divided { inertia, terms, alone } = self.divided(model, ws);
        let pivots = inertia / T::from_f64(PIVOTS);
        report.doubt.times(pivots.to_branch_value(BranchValue::Growth));
        if self.method == Method::Kkt {
            self.tree_forward_dynamics(model, ws, input)?;
            if !self.balanced(model, ws, input) {
                report.doubt.times(f64::INFINITY);
            }
            return Ok(());
        }
        if !positive {
            return Err(Status::MassNotPositive);
        }
        self.doubt_accelerations(model, ws, terms, alone, report);
        for run in scope.clusters.runs() {
            for cluster in &model.clusters[run] {
                for (k, &j) in cluster.independent.iter().enumerate() {
                    ws.qdd[cluster.v + j] = ws.ydd[cluster.vy + k];
                }
                if self.steps.found_acceleration {
                    tree_accelerations(cluster, ws);
                }
            }
        }
        if self.wants(Field::Lambda) {
            // the loops supply τ_q of the motion less the given forces
            let wrench = self.feels_wrenches().then_some(ws.wrench.as_slice());
            let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
            let motion = &mut ws.motion;
            let loop_q = &mut ws.loop_q;
            algorithms::newton_euler(model, scope, &tree, wrench, motion, loop_q);
            self.friction(model, &ws.qd, loop_q);
            self.each_given_force(model, input, |v, tau| ws.loop_q[v] -= tau);
        }
        Ok(())
    }

    /// Digits that accelerations lose, from the largest Σ |terms| / pivot and Σ |terms| / inertia.
    #[inline(always)]
    fn doubt_accelerations<T: Real>(
        &self,
        model: &Model<T>,
        ws: &Workspace<T>,
        terms: T,
        alone: T,
        report: &mut RunReport<T>,
    ) {
        let independents = &self.needed.scope.independents;
        let left = largest(independents, &ws.ydd);
        let (growth, zero) = cancellation(terms, left, T::from_f64(STILL) * alone);
        report.doubt.times(growth);
        let of_method = T::from_f64(model.growth_of(self.method) / ROUNDINGS);
        report.doubt.times(of_method.to_branch_value(BranchValue::Growth));
        report.doubt.acceleration = zero;
        let is_still = zero > 1.0 && report.doubt.is_large();
        if is_still || left.lt(terms * T::from_f64(1.0 / APART)) {
            // the largest forces may be those of another joint
            let alone = of_largest(independents, &ws.ydd, |k| {
                let own = T::from_f64(model.inertia[k]).larger(ws.uncoupled_diagonal[k]);
                if T::ZERO < own { ws.tau_terms[k] / own } else { T::ZERO }
            });
            let (own_growth, zero) = cancellation(terms, left, T::from_f64(STILL) * alone);
            report.doubt.times(own_growth / (SPREAD * growth.max(1.0)));
            report.doubt.acceleration = zero;
        }
    }

    /// Largest ratios to the pivots; a pivot is the articulated inertia.
    fn divided<T: Real>(&self, model: &Model<T>, ws: &Workspace<T>) -> Divided<T> {
        let mut largest = Divided { inertia: T::ONE, terms: T::ZERO, alone: T::ZERO };
        let mut of = |k: usize, inverse: T| {
            let own = T::larger(T::from_f64(model.inertia[k]), ws.uncoupled_diagonal[k]);
            let alone = if T::ZERO < own { ws.tau_terms[k] / own } else { T::ZERO };
            largest = Divided {
                inertia: T::larger(largest.inertia, inverse * own),
                terms: T::larger(largest.terms, inverse * ws.tau_terms[k]),
                alone: T::larger(largest.alone, alone),
            }
        };
        let scope = &self.needed.scope;
        if self.method == Method::Projection {
            for k in scope.independents.indices() {
                of(k, ws.factor[model.sparsity.diagonal_at(k)]);
            }
        } else {
            let mut independents = scope.independents.indices();
            let inverses = ws.embedding.inverses(model, &scope.clusters);
            // not a zip, which takes them one by one
            inverses
                .for_each(|inverse| independents.next().into_iter().for_each(|k| of(k, inverse)));
        }
        largest
    }

    /// q̈ of the tree under its constraints.
    fn tree_forward_dynamics<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
    ) -> Result<(), Status> {
        let scope = &self.needed.scope;
        let wrench = self.wrenches(model, ws, input).then_some(ws.wrench.as_slice());
        ws.qdd.fill(T::ZERO);
        let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd: &ws.qdd };
        algorithms::newton_euler(model, scope, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        self.friction(model, &ws.qd, &mut ws.tau_q);
        ws.loop_q.fill(T::ZERO);
        self.each_given_force(model, input, |v, tau| ws.loop_q[v] = tau);
        self.kkt(model, ws)
    }

    /// True where ÿ of the whole system balances the given forces along every independent motion up
    /// to rounding, or nearly enough for the remainder to be small against M_y ÿ.
    fn balanced<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) -> bool {
        let scope = &self.needed.scope;
        let wrench = self.feels_wrenches().then_some(ws.wrench.as_slice());
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
        algorithms::newton_euler(model, scope, &tree, wrench, &mut ws.motion, &mut ws.tau_q);
        self.friction(model, &ws.qd, &mut ws.tau_q);
        ws.start_rate = qdd;
        let of_all =
            |x: &[T]| x.iter().fold(T::ZERO, |most, x| T::select_lt(most, x.abs(), x.abs(), most));
        let mut largest = of_all(&ws.tau_q);
        self.each_given_force(model, input, |v, tau| {
            largest = T::select_lt(largest, tau.abs(), tau.abs(), largest);
            ws.tau_q[v] -= tau;
        });
        to_independent(model, scope, &ws.G, &ws.tau_q, &mut ws.ydd, &mut ws.tau_terms);
        if of_all(&ws.ydd).lt(largest * T::from_f64(BALANCE)) || largest == T::ZERO {
            return true;
        }
        let positive = algorithms::embedded_solve(model, scope, ws);
        let given =
            model.order.vy_v.iter().fold(T::ZERO, |size, v| {
                T::select_lt(size, ws.qdd[*v].abs(), ws.qdd[*v].abs(), size)
            });
        positive && of_all(&ws.ydd).lt(given * T::from_f64(WORTH))
    }

    /// The given forces by internal tree velocity; a force on an independent is one on its joint.
    pub(super) fn each_given_force<T: Real>(
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
    pub(super) fn map_forces<T: Real>(&self, pass: Pass<'_, T>) -> Result<(), Status> {
        let Pass { model, ws, input, report } = pass;
        if self.wants_any(&[Field::TauY, Field::TauU, Field::TauUnactuated]) || self.reads_forces()
        {
            ws.tau_terms.fill(T::ZERO);
            report.doubt.times(self.given_forces(model, ws, input));
            if self.wants_any(&READ_TAU_U) {
                report.doubt.times(to_actuators(model, &self.needed.scope, ws)?);
            } else if self.reads_forces() {
                to_warn(model, &self.needed.scope, ws);
            }
        }
        Ok(())
    }

    /// Forces on the tree: at rest those of gravity and springs, else with the acceleration g or
    /// q̈; less the wrenches where they are to be counted.
    fn tree_forces<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        (rests, at_bias, with_wrenches): (bool, bool, bool),
    ) {
        let scope = &self.needed.scope;
        let wrench =
            (with_wrenches && self.wrenches(model, ws, input)).then_some(ws.wrench.as_slice());
        let motion = &mut ws.motion;
        let tau_q = &mut ws.tau_q;
        if rests {
            algorithms::rest_forces(model, scope, &ws.q, wrench, motion, tau_q);
        } else {
            let qdd = if at_bias { &ws.g } else { &ws.qdd };
            let tree = TreeMotion { q: &ws.q, qd: &ws.qd, qdd };
            algorithms::newton_euler(model, scope, &tree, wrench, motion, tau_q);
            self.friction(model, &ws.qd, tau_q);
        }
    }

    /// C_y = Gᵀ (C + M g) of gravity and springs alone.
    pub(super) fn rest_bias<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>) {
        self.tree_forces(model, ws, &[], (true, true, false));
        self.bias_of_tree(model, ws);
    }

    /// C_y = Gᵀ (C + M g), with the wrenches on the left-hand side where they are to be counted.
    pub(super) fn bias_force<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        with_wrenches: bool,
    ) {
        self.tree_forces(model, ws, input, (self.steps.bias_at_rest, true, with_wrenches));
        self.bias_of_tree(model, ws);
    }

    fn bias_of_tree<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>) {
        let scope = &self.needed.scope;
        to_independent(model, scope, &ws.G, &ws.tau_q, &mut ws.C_y, &mut ws.tau_terms);
    }

    /// τ_y of the given forces less gravity, springs, dampers, friction and wrenches.
    pub(super) fn known_forces<T: Real>(&self, pass: Pass<'_, T>) -> Result<(), Status> {
        let Pass { model, ws, input, report } = pass;
        self.tree_forces(model, ws, input, (true, true, true));
        for damper in &model.terms.dampers {
            ws.tau_q[damper.v] = damper.damping.mul_add(ws.qd[damper.v], ws.tau_q[damper.v]);
        }
        self.friction(model, &ws.qd, &mut ws.tau_q);
        ws.tau_terms.fill(T::ZERO);
        self.bias_of_tree(model, ws);
        report.doubt.times(self.given_forces(model, ws, input));
        ws.tau_y.iter_mut().zip(&ws.C_y).for_each(|(tau, C)| *tau -= *C);
        Ok(())
    }

    /// τ += F tanh(q̇ / v₀) + d q̇, where it is asked.
    #[inline]
    pub(super) fn friction<T: Real>(&self, model: &Model<T>, qd: &[T], tau_q: &mut [T]) {
        if self.query.options.contains(QueryOptions::FRICTION) {
            add_friction(model, qd, tau_q);
        }
    }

    /// Digits that forces on the independents lose in the sums of their terms.
    fn doubt_forces<T: Real>(&self, terms: &[T], forces: &[T], report: &mut RunReport<T>) {
        let independents = &self.needed.scope.independents;
        let most = largest(independents, terms);
        let left = largest(independents, forces);
        let (growth, zero) = cancellation(most, left, T::from_f64(ZERO) * most);
        report.doubt.times(growth);
        report.doubt.force = zero;
        if zero > 1.0 {
            // the largest terms may be those of another force
            let of_left = of_largest(independents, forces, |k| terms[k]);
            report.doubt.force = cancellation(most, left, T::from_f64(ZERO) * of_left).1;
        }
    }

    /// The given forces as τ_y; returns the growth of roundings, of forces that hardly act along
    /// the independents.
    fn given_forces<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) -> f64 {
        let slot = |field| self.given.slot(field).map(|slot: &Slot| &input[slot.range()]);
        if let Some(tau) = slot(Field::TauY) {
            for (x, &k) in tau.iter().zip(&model.order.vy) {
                ws.tau_y[k] = *x;
                ws.tau_terms[k] += x.abs();
            }
            return 1.0;
        }
        ws.tau_q.fill(T::ZERO);
        if let Some(tau) = slot(Field::TauU) {
            tau.iter().zip(&model.order.u_v).for_each(|(x, v)| ws.tau_q[*v] = *x);
        } else if let Some(tau) = slot(Field::TauQ) {
            tau.iter().zip(&model.order.v).for_each(|(x, v)| ws.tau_q[*v] = *x);
        }
        let scope = &self.needed.scope;
        to_independent(model, scope, &ws.G, &ws.tau_q, &mut ws.tau_y, &mut ws.tau_terms);
        let of_actuators = slot(Field::TauU).is_some();
        let mut most = T::ONE;
        for cluster in scope.joined.iter().map(|c| &model.clusters[*c]) {
            most = most.larger(lost_control(cluster, ws, of_actuators));
        }
        most.to_branch_value(BranchValue::Growth)
    }

    /// True if wrenches are given on needed bodies.
    pub(super) fn feels_wrenches(&self) -> bool {
        !self.wrench_links.is_empty()
    }

    /// The given wrenches on their bodies; false where there are none.
    fn wrenches<T: Real>(&self, model: &Model<T>, ws: &mut Workspace<T>, input: &[T]) -> bool {
        let Some(slot) = self.given.slot(Field::Wrenches).filter(|_| self.feels_wrenches()) else {
            return false;
        };
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

#[inline(never)]
fn add_friction<T: Real>(model: &Model<T>, qd: &[T], tau_q: &mut [T]) {
    for &Friction { v, coulomb, viscous, per_speed } in &model.terms.frictions {
        let dry = coulomb * (qd[v] * per_speed).tanh();
        tau_q[v] += viscous.mul_add(qd[v], dry);
    }
}

/// Wrenches on links (place among the wrenches, link), `[n; f]` in world axes at their frames'
/// origins, as those on bodies; `bodies` carry the links, and their poses in their parents are
/// known.
pub(crate) fn wrenches_on_bodies<T: Real>(
    model: &Model<T>,
    ws: &mut Workspace<T>,
    bodies: &[usize],
    links: &[(usize, usize)],
    wrenches: &[T],
) {
    algorithms::world_poses(model, bodies, &ws.motion, &mut ws.world);
    ws.wrench.fill((zero(), zero()));
    for (k, link) in links {
        let wrench = &wrenches[6 * k..6 * k + 6];
        let frame = &model.frames[*link];
        let (n, f) = algorithms::frame_wrench(frame, &ws.world, wrench);
        ws.wrench[frame.body].0 += n;
        ws.wrench[frame.body].1 += f;
    }
}

/// τ_y = Gᵀ τ_q, answered cluster by cluster; adds Σ |terms| of each to `terms`.
fn to_independent<T: Real>(
    model: &Model<T>,
    scope: &Scope,
    G: &[T],
    tau_q: &[T],
    tau_y: &mut [T],
    terms: &mut [T],
) {
    for &Direct { v, vy, .. } in &scope.direct {
        let tau = tau_q[v];
        tau_y[vy] = tau;
        terms[vy] += tau.abs();
    }
    for cluster in scope.joined.iter().map(|c| &model.clusters[*c]) {
        let G = &G[cluster.block()];
        let tau_q = &tau_q[cluster.velocities()];
        let (tau_y, terms) =
            (&mut tau_y[cluster.independents()], &mut terms[cluster.independents()]);
        match cluster.n_vy {
            1 if T::UNROLLED => columns::<T, 1>(G, tau_q, tau_y, terms),
            2 if T::UNROLLED => columns::<T, 2>(G, tau_q, tau_y, terms),
            3 if T::UNROLLED => columns::<T, 3>(G, tau_q, tau_y, terms),
            6 if T::UNROLLED => columns::<T, 6>(G, tau_q, tau_y, terms),
            m => {
                for k in 0..m {
                    let column = G[k..].iter().step_by(m);
                    let mut tau = T::ZERO;
                    let mut sum = terms[k];
                    for (g, x) in column.zip(tau_q) {
                        tau = g.mul_add(*x, tau);
                        sum = g.abs().mul_add(x.abs(), sum);
                    }
                    (tau_y[k], terms[k]) = (tau, sum);
                }
            }
        }
    }
}

/// Reduced forces of one cluster with M independents, all columns of G at once.
#[inline(always)]
fn columns<T: Real, const M: usize>(G: &[T], tau_q: &[T], tau_y: &mut [T], terms: &mut [T]) {
    let mut tau = [T::ZERO; M];
    let mut sum = [T::ZERO; M];
    sum.copy_from_slice(terms);
    for (row, x) in G.as_chunks::<M>().0.iter().zip(tau_q) {
        for k in 0..M {
            tau[k] = row[k].mul_add(*x, tau[k]);
            sum[k] = row[k].abs().mul_add(x.abs(), sum[k]);
        }
    }
    tau_y.copy_from_slice(&tau);
    terms.copy_from_slice(&sum);
}

/// By how much the forces on the tree joints of a cluster, or on its actuators, are larger than
/// those along its independents that they make, in the units of their coordinates: the roundings of
/// G are those of its largest entries. Below an ordinary ratio 1.
#[inline(always)]
fn lost_control<T: Real>(cluster: &Cluster<T>, ws: &Workspace<T>, of_actuators: bool) -> T {
    let tau_y = &ws.tau_y[cluster.independents()];
    let tau_q = &ws.tau_q[cluster.velocities()];
    let along = tau_y.iter().fold(T::ZERO, |most: T, tau| most.larger(tau.abs()));
    let given = if of_actuators {
        cluster.active.iter().fold(T::ZERO, |most: T, (_, j)| most.larger(tau_q[*j].abs()))
    } else {
        tau_q.iter().fold(T::ZERO, |most: T, tau| most.larger(tau.abs()))
    };
    // a force of one newton may have a moment of as many as the length
    let longest = T::from_f64(cluster.length.max(1.0));
    if !(along * T::from_f64(CONTROL)).lt(given * longest) {
        return T::ONE;
    }
    let unit = |tau: T, j: usize| tau.abs() * T::from_f64(column_unit(cluster, j));
    let along = tau_y.iter().zip(&cluster.independent);
    let along = along.fold(T::ZERO, |most: T, (tau, j)| most.larger(unit(*tau, *j)));
    let acts = |j: &usize| !of_actuators || cluster.active.iter().any(|(_, of)| of == j);
    let given = (0..cluster.n_v).filter(acts).map(|j| unit(tau_q[j], j));
    given.fold(T::ZERO, T::larger) / along
}

/// Takes a force on the independents off the tree forces.
fn independents_subtract<T: Real>(model: &Model<T>, tau_y: &[T], tau_q: &mut [T]) {
    for cluster in &model.clusters {
        for (k, &j) in cluster.independent.iter().enumerate() {
            tau_q[cluster.v + j] -= tau_y[cluster.vy + k];
        }
    }
}

/// Largest absolute value at some places.
fn largest<T: Real>(places: &Runs, x: &[T]) -> T {
    let mut largest = T::ZERO;
    for run in places.runs() {
        for x in &x[run] {
            largest = largest.larger(x.abs());
        }
    }
    largest
}

/// The number of the place with the largest absolute value.
fn of_largest<T: Real>(places: &Runs, x: &[T], of: impl Fn(usize) -> T) -> T {
    let mut found = (-T::ONE, T::ZERO);
    for k in places.indices() {
        let (largest, number) = found;
        let own = x[k].abs();
        found = (largest.larger(own), T::select_lt(largest, own, of(k), number));
    }
    found.1
}
