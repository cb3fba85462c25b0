//! Computes a closed state from the given numbers: q, q̇, q̈, G and g.

use sarrus_proto::{Field, Slot, Status};

use crate::closure::{Level, Outcome, column_unit, largest_distance};
use crate::linalg::solve_sound;
use crate::mechanism::Cluster;
use crate::model::{ACTUATOR_STEPS, Model};
use crate::plan::run::{Pass, RunReport};
use crate::plan::{Plan, Space};
use crate::scalar::Real;
use crate::workspace::Workspace;

/// Longest of these steps, in radians or cluster lengths.
const LONGEST: f64 = 0.2;
/// Largest deviation of a quaternion from unit length.
const UNIT: f64 = 1e-6;

impl Plan {
    /// Fills the given coordinates, velocities and accelerations, and the start of closures, from
    /// the input.
    #[inline(always)]
    pub(super) fn set_state<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
    ) -> Result<(), Status> {
        let order = &model.order;
        let slot = |field| self.given.slot(field).map(|slot: &Slot| &input[slot.range()]);
        let scatter = |from: &[T], to: &mut [T], order: &[usize]| {
            from.iter().zip(order).for_each(|(x, i)| to[*i] = *x)
        };

        // start of closures: the guess, the given q itself, or their zero pose
        let start = slot(Field::Q).or(slot(Field::QGuess));
        let mut sound = Ok(());
        match start {
            _ if ws.resumes => {}
            Some(start) => {
                scatter(start, &mut ws.start, &order.q);
                sound = normalise_quaternions(&self.needed.quaternions, &mut ws.start);
            }
            None if self.starts_nowhere() => {}
            None => ws.start.copy_from_slice(&model.zero),
        }

        // from actuators the guess moves on the path, and its velocity means nothing any more
        ws.tangent = false;
        let leads = self.steps.position != Space::Actuation && !ws.resumes;
        if let (Some(rate), true) = (slot(Field::QdGuess), leads) {
            scatter(rate, &mut ws.start_rate, &order.v);
            ws.tangent = true;
        }

        // positions
        match self.steps.position {
            Space::Independent => scatter(slot(Field::Y).unwrap_or(&[]), &mut ws.q, &order.qy_q),
            Space::Tree => ws.q.copy_from_slice(&ws.start),
            Space::Actuation => {
                ws.q.copy_from_slice(&ws.start);
                scatter(slot(Field::U).unwrap_or(&[]), &mut ws.q, &order.u_q);
            }
        }
        // after the positions, so that a failure reports this request's
        sound?;
        // the dependents are not known yet
        if self.steps.position == Space::Independent {
            normalise_quaternions(&self.needed.independent_quaternions, &mut ws.q)?;
        }

        // velocities and accelerations of the independents, zero unless given
        if self.steps.rates {
            ws.qd.fill(T::ZERO);
            ws.qdd.fill(T::ZERO);
        }
        let rates = |field| slot(field).unwrap_or(&[]);
        match self.steps.velocity {
            Some(Space::Independent) => scatter(rates(Field::Yd), &mut ws.qd, &order.vy_v),
            Some(Space::Tree) => scatter(rates(Field::Qd), &mut ws.qd, &order.v),
            Some(Space::Actuation) => scatter(rates(Field::Ud), &mut ws.qd, &order.u_v),
            None => {}
        }
        match self.steps.acceleration {
            Some(Space::Independent) => scatter(rates(Field::Ydd), &mut ws.qdd, &order.vy_v),
            Some(Space::Tree) => scatter(rates(Field::Qdd), &mut ws.qdd, &order.v),
            Some(Space::Actuation) => scatter(rates(Field::Udd), &mut ws.qdd, &order.u_v),
            None => {}
        }
        Ok(())
    }

    /// Fills q, q̇, q̈, the cosines and sines of closed clusters, G and g from the given numbers;
    /// if `CLOSED`, `closed` holds the precomputed closure results.
    #[inline]
    pub(super) fn close_state<T: Real, const CLOSED: bool>(
        &self,
        Pass { model, ws, input, report }: Pass<'_, T>,
        closed: &[T],
    ) -> Result<(), Status> {
        if CLOSED {
            let gain = self.closed.restore(model, ws, closed);
            report.doubt.closure(gain, self.steps.level, 1.0);
        }
        for &c in &self.needed.scope.closed {
            let known =
                if CLOSED { self.closed.close(model, c, ws, self.steps.level) } else { None };
            let (gain, control) = match known {
                Some(closed) => (closed?, 1.0),
                None => self.close_cluster(c, Pass { model, ws, input, report })?,
            };
            report.doubt.closure(gain, self.steps.level, control);
            report.closed += 1;
            // the bias is zero where no velocity was given
            if self.steps.rates && self.steps.level < Level::Acceleration {
                ws.g[model.clusters[c].velocities()].fill(T::ZERO);
            }
            if self.steps.given_acceleration {
                tree_accelerations(&model.clusters[c], ws);
            }
        }
        // a robot at rest has rates of +0, without the sign of a product with zero
        if self.steps.rates && self.steps.velocity.is_none() {
            ws.qd.fill(T::ZERO);
        }
        if self.steps.position == Space::Actuation || self.actuated_rates() {
            self.check_unactuated(model)?;
        }
        let given = self.given.slot(Field::Qd).map(|slot: &Slot| &input[slot.range()]);
        if let (Some(given), true) = (given, self.steps.level > Level::Position) {
            // the velocities of closed loops alone can differ from the given ones
            for cluster in self.needed.scope.closed.iter().map(|c| &model.clusters[*c]) {
                for v in cluster.velocities() {
                    let off = given[model.order.v_external[v]] - ws.qd[v];
                    let off = off.abs().to_f64() / column_unit(cluster, v - cluster.v);
                    report.projection = report.projection.max(off);
                }
            }
        }
        Ok(())
    }

    /// No closure and no given q reads the start.
    pub(super) fn starts_nowhere(&self) -> bool {
        self.needed.scope.closed.is_empty() && self.steps.position == Space::Independent
    }

    fn actuated_rates(&self) -> bool {
        self.steps.velocity == Some(Space::Actuation)
            || self.steps.acceleration == Some(Space::Actuation)
    }

    /// Actuators determine the state of the joints that they move; a free joint without one needs
    /// its coordinate from the guess.
    fn check_unactuated<T: Real>(&self, model: &Model<T>) -> Result<(), Status> {
        let guessed = self.given.slot(Field::QGuess).is_some();
        let driven = |cluster: &Cluster<T>| cluster.active.len() == cluster.n_vy;
        if guessed || self.needed.coordinates.iter().map(|c| &model.clusters[*c]).all(driven) {
            Ok(())
        } else {
            Err(Status::SingularActuation)
        }
    }

    /// Closes one cluster from numbers of any space; returns its gain, and the part of their
    /// control that the actuators have there.
    #[inline]
    pub(super) fn close_cluster<T: Real>(
        &self,
        c: usize,
        Pass { model, ws, input, report }: Pass<'_, T>,
    ) -> Result<(f64, f64), Status> {
        let given =
            |field| self.given.slot(field).map_or(&[] as &[T], |slot: &Slot| &input[slot.range()]);
        let cluster = &model.clusters[c];
        let actuated = self.steps.position == Space::Actuation;
        hold_idle(cluster, ws);
        let (mut outcome, mut control) = if actuated {
            from_actuators(model, c, ws, report)?
        } else {
            let level = if self.actuated_rates() { Level::Jacobian } else { self.steps.level };
            let guess = self.given.slot(Field::Q).or(self.given.slot(Field::QGuess));
            (ws.close_from(model, c, level, guess.is_none() && !ws.resumes, false), 1.0)
        };
        report.iterations += outcome.iterations;
        if outcome.status != Status::Ok {
            self.remember_failure(model, c, ws, actuated, report);
            return Err(outcome.status);
        }
        if self.steps.position == Space::Tree {
            let start = &ws.start[cluster.coordinates()];
            let q = &ws.q[cluster.coordinates()];
            report.projection = report.projection.max(largest_distance(cluster, start, q));
        }
        if self.actuated_rates() || actuated {
            // ẏ from u̇, then the bias, then ÿ from ü
            if self.steps.velocity == Some(Space::Actuation) {
                control =
                    control.min(self.independent_rates(cluster, ws, given(Field::Ud), false)?);
            }
            if self.steps.level > Level::Position {
                outcome = self.close_again(model, c, ws);
                if outcome.status != Status::Ok {
                    return Err(outcome.status);
                }
            }
            if self.steps.acceleration == Some(Space::Actuation) {
                control =
                    control.min(self.independent_rates(cluster, ws, given(Field::Udd), true)?);
            }
        }
        report.open = report.open.max(outcome.open);
        Ok((outcome.gain, control))
    }

    /// All levels at the closed pose that was just found.
    fn close_again<T: Real>(&self, model: &Model<T>, c: usize, ws: &mut Workspace<T>) -> Outcome {
        let cluster = &model.clusters[c];
        let at = cluster.coordinates();
        ws.start[at.clone()].copy_from_slice(&ws.q[at]);
        ws.close(model, c, self.steps.level)
    }

    /// ẏ = G_u⁻¹ u̇, or ÿ = G_u⁻¹ (ü − g_u), of one cluster, in place at its independents; the part
    /// of their control that the actuators have there.
    fn independent_rates<T: Real>(
        &self,
        cluster: &Cluster<T>,
        ws: &mut Workspace<T>,
        given: &[T],
        accelerations: bool,
    ) -> Result<f64, Status> {
        let m = cluster.n_vy;
        if cluster.active.len() != m {
            return Err(Status::SingularActuation);
        }
        let bias = accelerations && self.steps.level >= Level::Acceleration;
        let G = cluster.G(&ws.G);
        for (r, &(u, j)) in cluster.active.iter().enumerate() {
            ws.dense[r * m..(r + 1) * m].copy_from_slice(G.row(j));
            // the closure has overwritten the dependent actuators
            ws.dense_rhs[r] = if bias { given[u] - ws.g[cluster.v + j] } else { given[u] };
        }
        let solved = solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, 1, cluster.least_authority)
            .ok_or(Status::SingularActuation)?;
        for (k, &j) in cluster.independent.iter().enumerate() {
            let to = if accelerations { &mut ws.qdd } else { &mut ws.qd };
            to[cluster.v + j] = ws.dense_rhs[k];
        }
        Ok(solved.least.to_f64())
    }
}

/// Idle joints stand still; where, the closure reads off its start.
pub(super) fn hold_idle<T: Real>(cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    for &v in &cluster.locked {
        ws.qd[cluster.v + v] = T::ZERO;
        ws.qdd[cluster.v + v] = T::ZERO;
    }
}

/// q̈ = G ÿ + g of the dependents of one cluster.
pub(super) fn tree_accelerations<T: Real>(cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    let G = cluster.G(&ws.G);
    let g = &ws.g[cluster.velocities()];
    let qdd = &mut ws.qdd[cluster.velocities()];
    for &j in &cluster.dependent {
        let row = G.row(j).iter().zip(&cluster.independent);
        qdd[j] = row.fold(g[j], |sum, (G_jk, &i)| G_jk.mul_add(qdd[i], sum));
    }
}

/// Finds the independents whose closure has the actuator coordinates that stand in q, by Newton's
/// method from the start; with the part of their control that the actuators have there.
fn from_actuators<T: Real>(
    model: &Model<T>,
    c: usize,
    ws: &mut Workspace<T>,
    report: &mut RunReport<T>,
) -> Result<(Outcome, f64), Status> {
    let cluster = &model.clusters[c];
    let m = cluster.n_vy;
    if cluster.active.len() != m {
        // nothing measures this cluster: its independents are those of the guess
        let at = cluster.coordinates();
        ws.q[at.clone()].copy_from_slice(&ws.start[at]);
        return Ok((ws.close(model, c, Level::Jacobian), 1.0));
    }
    for (r, &(_, j)) in cluster.active.iter().enumerate() {
        ws.goal_u[r] = ws.q[cluster.q + cluster.dofs[j].q];
    }
    if cluster.active.iter().zip(&cluster.independent).all(|((_, a), i)| a == i) {
        return Ok((ws.close(model, c, Level::Jacobian), 1.0));
    }
    for &i in &cluster.independent_q {
        ws.q[cluster.q + i] = ws.start[cluster.q + i];
    }
    let tolerance = T::from_f64(0.1 * T::EPSILON.sqrt());
    let mut sign = T::ZERO;
    let mut damping = T::ONE;
    for k in 0..ACTUATOR_STEPS {
        if ws.scratch.left == 0 {
            return Ok((Outcome::failed(Status::NotConverged, 0), 1.0));
        }
        let outcome = match k {
            0 => ws.close(model, c, Level::Jacobian),
            _ => ws.try_to_close(model, c, Level::Jacobian),
        };
        report.iterations += outcome.iterations + 1;
        let G = cluster.G(&ws.G);
        for (r, &(_, j)) in cluster.active.iter().enumerate() {
            ws.dense[r * m..(r + 1) * m].copy_from_slice(G.row(j));
            ws.dense_rhs[r] = ws.goal_u[r] - ws.q[cluster.q + cluster.dofs[j].q];
        }
        let least = cluster.least_authority;
        let solve = || solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, 1, least);
        let solved = (outcome.status == Status::Ok).then(solve).flatten();
        let at = cluster.coordinates();
        let control = solved.map_or(1.0, |solved| solved.least.to_f64());
        match solved.map(|solved| solved.sign) {
            // another branch, or no pose at all: half the path from the last good one
            None if k == 0 && outcome.status == Status::Ok => {
                return Err(Status::SingularActuation);
            }
            None if k == 0 => return Ok((outcome, 1.0)),
            Some(det) if k == 0 || T::ZERO.lt(det * sign) => {
                sign = det;
                damping = T::ONE;
                ws.start[at.clone()].copy_from_slice(&ws.q[at]);
                ws.step_y[..m].copy_from_slice(&ws.dense_rhs[..m]);
            }
            _ => damping *= T::from_f64(0.5),
        }
        // one step from the last good pose, no longer than allowed
        let mut size = T::ZERO;
        for (k, &j) in cluster.independent.iter().enumerate() {
            let unit = if cluster.dofs[j].slides() { 1.0 / cluster.length } else { 1.0 };
            let step = ws.step_y[k].abs() * T::from_f64(unit);
            size = T::select_lt(size, step, step, size);
        }
        let longest = T::from_f64(LONGEST);
        let part = damping * T::select_lt(longest, size, longest / size, T::ONE);
        for &i in &cluster.independent_q {
            ws.q[cluster.q + i] = ws.start[cluster.q + i];
        }
        for (k, &j) in cluster.independent.iter().enumerate() {
            cluster.dofs[j].advance(&mut ws.q[cluster.q..], ws.step_y[k] * part);
        }
        if size.lt(tolerance) {
            return Ok((ws.close(model, c, Level::Jacobian), control));
        }
    }
    Ok((Outcome::failed(Status::Unreachable, 0), 1.0))
}

/// Quaternions, by their first coordinates, within 1e-6 of unit length are normalised, others
/// refused.
fn normalise_quaternions<T: Real>(first: &[usize], q: &mut [T]) -> Result<(), Status> {
    for at in first {
        let quaternion = &mut q[*at..at + 4];
        let norm = quaternion.iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum)).sqrt();
        if !(norm - T::ONE).abs().lt(T::from_f64(UNIT)) {
            return Err(Status::BadRequest);
        }
        for x in quaternion {
            *x = *x / norm;
        }
    }
    Ok(())
}
