//! From what is given to a closed state: q, q̇, q̈, G and g.

use sarrus_proto::{Field, Slot, Status};

use crate::closure::{Level, Local, Outcome, close};
use crate::linalg::solve_sound;
use crate::model::{Cluster, Model};
use crate::plan::run::Findings;
use crate::plan::{Plan, Space};
use crate::scalar::Scalar;
use crate::workspace::Workspace;

/// Newton steps from actuator to independent coordinates.
const STEPS: u32 = 60;
/// Longest of these steps, in radians or cluster lengths.
const LONGEST: f64 = 0.2;
/// Least pivot of G_u, against its largest entry, from which on actuators determine ten digits.
pub(super) const WEAK: f64 = 1e-5;
/// Largest deviation of a quaternion from unit length.
const UNIT: f64 = 1e-6;

impl Plan {
    /// Fills q, q̇, q̈, the turns of tied joints, G and g from the input.
    pub(super) fn close_state<T: Scalar>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        found: &mut Findings<T>,
    ) -> Result<(), Status> {
        let order = &model.order;
        let slot = |field| self.given.slot(field).map(|slot: &Slot| &input[slot.range()]);
        let scatter = |from: &[T], to: &mut [T], order: &[usize]| {
            from.iter().zip(order).for_each(|(x, i)| to[*i] = *x)
        };

        // where closures start: the guess, or the given q itself, or their own zero
        let start = slot(Field::Q).or(slot(Field::QGuess));
        match start {
            Some(start) => {
                scatter(start, &mut ws.start, &order.q);
                normalise_quaternions(model, &mut ws.start, |_| true)?;
            }
            None => ws.start.copy_from_slice(&model.zero),
        }

        // from actuators the guess moves on the way, and its velocity means nothing any more
        ws.tangent = false;
        if let (Some(rate), true) = (slot(Field::QdGuess), self.steps.position != Space::Actuation)
        {
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
        // of what was given; the dependents are not known yet
        if self.steps.position == Space::Independent {
            normalise_quaternions(model, &mut ws.q, |i| model.is_independent(i))?;
        }

        // velocities and accelerations of the independents; what is not given is zero
        ws.qd.fill(T::ZERO);
        ws.qdd.fill(T::ZERO);
        // the bias is zero where no velocity was given
        if self.steps.level < Level::Acceleration {
            ws.g.fill(T::ZERO);
        }
        match self.steps.velocity {
            Some(Space::Independent) => {
                scatter(slot(Field::Yd).unwrap_or(&[]), &mut ws.qd, &order.vy_v)
            }
            Some(Space::Tree) => scatter(slot(Field::Qd).unwrap_or(&[]), &mut ws.qd, &order.v),
            Some(Space::Actuation) => {
                scatter(slot(Field::Ud).unwrap_or(&[]), &mut ws.qd, &order.u_v)
            }
            None => {}
        }
        match self.steps.acceleration {
            Some(Space::Independent) => {
                scatter(slot(Field::Ydd).unwrap_or(&[]), &mut ws.qdd, &order.vy_v)
            }
            Some(Space::Tree) => scatter(slot(Field::Qdd).unwrap_or(&[]), &mut ws.qdd, &order.v),
            Some(Space::Actuation) => {
                scatter(slot(Field::Udd).unwrap_or(&[]), &mut ws.qdd, &order.u_v)
            }
            None => {}
        }

        for &c in &model.tied {
            let cluster = &model.clusters[c];
            self.close_cluster(model, cluster, ws, input, found)?;
            found.closed += 1;
            if self.steps.tree_acceleration && self.steps.level >= Level::Velocity {
                tree_accelerations(cluster, ws);
            }
        }
        if self.steps.position == Space::Actuation || self.actuated_rates() {
            self.check_unactuated(model)?;
        }
        Ok(())
    }

    fn actuated_rates(&self) -> bool {
        self.steps.velocity == Some(Space::Actuation)
            || self.steps.acceleration == Some(Space::Actuation)
    }

    /// Actuators can only tell the state of joints that they move; a free joint without one needs
    /// its coordinate otherwise.
    fn check_unactuated<T: Scalar>(&self, model: &Model<T>) -> Result<(), Status> {
        let guessed = self.given.slot(Field::QGuess).is_some();
        let driven = |cluster: &Cluster<T>| cluster.active.len() == cluster.n_vy;
        if guessed || model.clusters.iter().all(driven) {
            Ok(())
        } else {
            Err(Status::SingularActuation)
        }
    }

    /// Closes one cluster, from whatever space its numbers come.
    fn close_cluster<T: Scalar>(
        &self,
        model: &Model<T>,
        cluster: &Cluster<T>,
        ws: &mut Workspace<T>,
        input: &[T],
        found: &mut Findings<T>,
    ) -> Result<(), Status> {
        let given =
            |field| self.given.slot(field).map_or(&[] as &[T], |slot: &Slot| &input[slot.range()]);
        let bodies = &model.bodies[cluster.body..cluster.body + cluster.n];
        let actuated = self.steps.position == Space::Actuation;
        hold_idle(cluster, ws);
        let mut outcome = if actuated {
            from_actuators(cluster, bodies, ws, found)?
        } else {
            let level = if self.actuated_rates() { Level::Velocity } else { self.steps.level };
            close(cluster, bodies, &mut local(cluster, ws), level)
        };
        found.iterations += outcome.iterations;
        if outcome.status != Status::Ok {
            self.remember_failure(model, cluster, ws, actuated, found);
            return Err(outcome.status);
        }
        if self.actuated_rates() || actuated {
            // ẏ from u̇, then the bias, then ÿ from ü
            let mut near = false;
            if self.steps.velocity == Some(Space::Actuation) {
                near |= self.independent_rates(cluster, ws, given(Field::Ud), false)?;
            }
            if self.steps.level > Level::Position {
                outcome = self.close_again(cluster, bodies, ws);
                if outcome.status != Status::Ok {
                    return Err(outcome.status);
                }
            }
            if self.steps.acceleration == Some(Space::Actuation) {
                near |= self.independent_rates(cluster, ws, given(Field::Udd), true)?;
            }
            outcome.near |= near;
        }
        found.warn_if(self.steps.level > Level::Position && outcome.near);
        Ok(())
    }

    /// All levels at the closed pose that was just found.
    fn close_again<T: Scalar>(
        &self,
        cluster: &Cluster<T>,
        bodies: &[crate::model::Body<T>],
        ws: &mut Workspace<T>,
    ) -> Outcome {
        let at = cluster.q..cluster.q + cluster.n_q;
        ws.start[at.clone()].copy_from_slice(&ws.q[at]);
        close(cluster, bodies, &mut local(cluster, ws), self.steps.level)
    }

    /// ẏ = G_u⁻¹ u̇, or ÿ = G_u⁻¹ (ü − g_u), of one cluster, in place at its independents; true
    /// where the actuators nearly lose control.
    fn independent_rates<T: Scalar>(
        &self,
        cluster: &Cluster<T>,
        ws: &mut Workspace<T>,
        given: &[T],
        accelerations: bool,
    ) -> Result<bool, Status> {
        let m = cluster.n_vy;
        if cluster.active.len() != m {
            return Err(Status::SingularActuation);
        }
        let bias = accelerations && self.steps.level >= Level::Acceleration;
        for (r, &(u, j)) in cluster.active.iter().enumerate() {
            for k in 0..m {
                ws.dense[r * m + k] = ws.G[cluster.g + j * m + k];
            }
            // the closure has overwritten what stood at dependent actuators
            ws.dense_rhs[r] = if bias { given[u] - ws.g[cluster.v + j] } else { given[u] };
        }
        let solved =
            solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, 1).ok_or(Status::SingularActuation)?;
        for (k, &j) in cluster.independent.iter().enumerate() {
            let to = if accelerations { &mut ws.qdd } else { &mut ws.qd };
            to[cluster.v + j] = ws.dense_rhs[k];
        }
        Ok(solved.least.lt(T::from_f64(WEAK)))
    }
}

/// Idle joints stand still; where, the closure reads off its start.
fn hold_idle<T: Scalar>(cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    for &v in &cluster.locked {
        ws.qd[cluster.v + v] = T::ZERO;
        ws.qdd[cluster.v + v] = T::ZERO;
    }
}

/// The workspace's numbers of one cluster.
pub(crate) fn local<'a, T: Scalar>(cluster: &Cluster<T>, ws: &'a mut Workspace<T>) -> Local<'a, T> {
    let (q, v) = (cluster.q..cluster.q + cluster.n_q, cluster.v..cluster.v + cluster.n_v);
    Local {
        start: &ws.start[q.clone()],
        tangent: ws.tangent.then_some(&ws.start_rate[v.clone()]),
        q: &mut ws.q[q],
        turn: &mut ws.turn[cluster.body..cluster.body + cluster.n],
        qd: &mut ws.qd[v.clone()],
        G: &mut ws.G[cluster.g..cluster.g + cluster.n_v * cluster.n_vy],
        g: &mut ws.g[v],
        scratch: &mut ws.scratch,
    }
}

/// q̈ = G ÿ + g of the dependents of one cluster.
pub(super) fn tree_accelerations<T: Scalar>(cluster: &Cluster<T>, ws: &mut Workspace<T>) {
    let m = cluster.n_vy;
    for &j in &cluster.dependent {
        let mut qdd = ws.g[cluster.v + j];
        for (k, &i) in cluster.independent.iter().enumerate() {
            qdd = ws.G[cluster.g + j * m + k].mul_add(ws.qdd[cluster.v + i], qdd);
        }
        ws.qdd[cluster.v + j] = qdd;
    }
}

/// Finds the independents whose closure has the actuator coordinates that stand in q, by Newton's
/// method from the start.
fn from_actuators<T: Scalar>(
    cluster: &Cluster<T>,
    bodies: &[crate::model::Body<T>],
    ws: &mut Workspace<T>,
    found: &mut Findings<T>,
) -> Result<Outcome, Status> {
    let m = cluster.n_vy;
    if cluster.active.len() != m {
        // nothing measures this cluster: its independents are those of the guess
        let at = cluster.q..cluster.q + cluster.n_q;
        ws.q[at.clone()].copy_from_slice(&ws.start[at]);
        return Ok(close(cluster, bodies, &mut local(cluster, ws), Level::Velocity));
    }
    for (r, &(_, j)) in cluster.active.iter().enumerate() {
        ws.goal_u[r] = ws.q[cluster.q + cluster.freedoms[j].q];
    }
    if cluster.active.iter().zip(&cluster.independent).all(|((_, a), i)| a == i) {
        return Ok(close(cluster, bodies, &mut local(cluster, ws), Level::Velocity));
    }
    for &i in &cluster.independent_q {
        ws.q[cluster.q + i] = ws.start[cluster.q + i];
    }
    let tolerance = T::from_f64(0.1 * T::EPSILON.sqrt());
    let (mut sign, mut damping) = (T::ZERO, T::ONE);
    for k in 0..STEPS {
        let outcome = close(cluster, bodies, &mut local(cluster, ws), Level::Velocity);
        found.iterations += outcome.iterations + 1;
        for (r, &(_, j)) in cluster.active.iter().enumerate() {
            for k in 0..m {
                ws.dense[r * m + k] = ws.G[cluster.g + j * m + k];
            }
            ws.dense_rhs[r] = ws.goal_u[r] - ws.q[cluster.q + cluster.freedoms[j].q];
        }
        let solved = if outcome.status == Status::Ok {
            solve_sound(&mut ws.dense, &mut ws.dense_rhs, m, 1)
        } else {
            None
        };
        let at = cluster.q..cluster.q + cluster.n_q;
        let weak = solved.is_some_and(|solved| solved.least.lt(T::from_f64(WEAK)));
        match solved.map(|solved| solved.sign) {
            // another branch, or no pose at all: half the way from the last good one
            None if k == 0 => {
                return if outcome.status == Status::Ok {
                    Err(Status::SingularActuation)
                } else {
                    Ok(outcome)
                };
            }
            Some(det) if k == 0 || T::ZERO.lt(det * sign) => {
                (sign, damping) = (det, T::ONE);
                ws.start[at.clone()].copy_from_slice(&ws.q[at]);
                for (k, _) in cluster.independent.iter().enumerate() {
                    ws.step_y[k] = ws.dense_rhs[k];
                }
            }
            _ => damping *= T::from_f64(0.5),
        }
        // one step from the last good pose, no longer than allowed
        let mut size = T::ZERO;
        for (k, &j) in cluster.independent.iter().enumerate() {
            let unit = if cluster.freedoms[j].slides() { 1.0 / cluster.length } else { 1.0 };
            let step = ws.step_y[k].abs() * T::from_f64(unit);
            size = T::select(size.lt(step), step, size);
        }
        let longest = T::from_f64(LONGEST);
        let part = damping * T::select(longest.lt(size), longest / size, T::ONE);
        for &i in &cluster.independent_q {
            ws.q[cluster.q + i] = ws.start[cluster.q + i];
        }
        for (k, &j) in cluster.independent.iter().enumerate() {
            cluster.freedoms[j].advance(&mut ws.q[cluster.q..], ws.step_y[k] * part);
        }
        if size.lt(tolerance) {
            found.warn_if(weak);
            return Ok(close(cluster, bodies, &mut local(cluster, ws), Level::Velocity));
        }
    }
    Ok(Outcome::failed(Status::Unreachable, 0))
}

/// Quaternions within 1e-6 of unit length are normalised, others refused.
fn normalise_quaternions<T: Scalar>(
    model: &Model<T>,
    q: &mut [T],
    of: impl Fn(usize) -> bool,
) -> Result<(), Status> {
    for (_, body) in
        model.bodies.iter().enumerate().filter(|(i, body)| body.motion.n_q() > 1 && of(*i))
    {
        let of = &mut q[body.q + body.motion.n_q() - 4..body.q + body.motion.n_q()];
        let norm = of.iter().fold(T::ZERO, |sum, x| x.mul_add(*x, sum)).sqrt();
        if !(norm - T::ONE).abs().lt(T::from_f64(UNIT)) {
            return Err(Status::BadRequest);
        }
        for x in of {
            *x = *x / norm;
        }
    }
    Ok(())
}
