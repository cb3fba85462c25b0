//! Closures by Newton's method, separated from the rest of a plan.
//!
//! The number of Newton steps depends on the state, so a plan with such closures is no
//! straight-line code; the rest of the plan is. [`Plan::close`] closes these clusters alone and
//! appends their results to the given numbers; [`Plan::run_closed`] is the rest of the plan on
//! both. A closed form that replaces Newton's method in the cells of its table
//! ([`crate::closure::Seeds`]) belongs to the rest: [`Plan::close`] only checks whether the state
//! lies in such a cell, and looks up the seeds that the form starts from.

use sarrus_proto::{Answer, Field, Query, Status};

use crate::closure::{Closure, Formed, Level, Numerical};
use crate::mechanism::Motion;
use crate::model::{Model, Scope};
use crate::plan::diagnostics::digits::larger;
use crate::plan::run::{Pass, RunReport};
use crate::plan::state::hold_idle;
use crate::plan::{Plan, Space, Steps};
use crate::scalar::{BranchValue, Real, all_finite};
use crate::workspace::Workspace;

/// Numbers that [`Plan::close`] appends to the given ones.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClosedNumbers {
    /// Kinds of numbers: `gain`, `start`, `seed`, `q`, `cos_sin`, `G`, `qd` or `g_bias`.
    pub name: &'static str,
    /// Their tree coordinates or velocities, one row each.
    pub joints: Vec<String>,
    /// Numbers in a row.
    pub columns: usize,
}

/// The clusters that are closed separately, and the offsets of their results in the workspace.
#[derive(Clone, Debug, Default)]
pub(super) struct Closed {
    /// Closed by Newton's method.
    pub(super) by_newton: Vec<usize>,
    /// Closed by the closed form that replaces it.
    by_form: Vec<usize>,
    /// Start poses of the latter, for clusters with joints that make full turns, and seeds.
    start: Vec<usize>,
    seeds: Vec<usize>,
    /// Of the former: dependent coordinates, cosines and sines, and of dependent velocities the
    /// rows of G, q̇ and g.
    q: Vec<usize>,
    cos_sin: Vec<usize>,
    G: Vec<usize>,
    qd: Vec<usize>,
    g: Vec<usize>,
}

impl Closed {
    /// Closure results that a plan with these steps reads; none unless the independents are given.
    pub(super) fn new<C>(model: &Model<C>, query: &Query, scope: &Scope, steps: &Steps) -> Closed {
        let mut closed = Closed::default();
        let of_independents = [Some(steps.position), steps.velocity, steps.acceleration]
            .into_iter()
            .flatten()
            .all(|space| space == Space::Independent);
        if !of_independents {
            return closed;
        }
        let is_cold = !query.given.has(Field::QGuess);
        for &c in &scope.closed {
            let cluster = &model.clusters[c];
            let closure = &model.closures[c];
            if closure.is_closed_form() {
                continue;
            }
            if let Closure::Numerical(numerical) = closure
                && is_cold
                && let Some(form) = numerical.form()
            {
                closed.by_form.push(c);
                closed.seeds.extend(form.seeded().iter().map(|dof| cluster.q + dof.q));
                if !numerical.turns.is_empty() {
                    closed.start.extend(cluster.coordinates());
                }
                continue;
            }
            closed.by_newton.push(c);
            let q = (0..cluster.n_q).filter(|q| !cluster.independent_q.contains(q));
            closed.q.extend(q.map(|q| cluster.q + q));
            if steps.poses {
                let is_revolute = |i: &usize| model.bodies[*i].motion == Motion::Revolute;
                closed.cos_sin.extend(cluster.bodies().filter(is_revolute));
            }
            for &j in &cluster.dependent {
                let row = cluster.g_offset + j * cluster.n_vy;
                if steps.level >= Level::Jacobian {
                    closed.G.extend(row..row + cluster.n_vy);
                }
                if steps.level >= Level::Velocity {
                    closed.qd.push(cluster.v + j);
                }
                if steps.level >= Level::Acceleration {
                    closed.g.push(cluster.v + j);
                }
            }
        }
        closed
    }

    pub(super) fn len(&self) -> usize {
        let of_newton = self.q.len() + 2 * self.cos_sin.len() + self.G.len();
        let of_rates = self.qd.len() + self.g.len();
        let of_form = self.start.len() + self.seeds.len();
        usize::from(!self.by_newton.is_empty()) + of_form + of_newton + of_rates
    }

    /// Copies the results from the workspace, in its order.
    pub(super) fn save<T: Real>(&self, ws: &Workspace<T>, gain: T, out: &mut [T]) {
        let gain = (!self.by_newton.is_empty()).then_some(gain);
        let start = self.start.iter().map(|i| ws.start[*i]);
        let q = self.seeds.iter().chain(&self.q).map(|i| ws.q[*i]);
        let mut at = 0;
        for x in gain.into_iter().chain(start).chain(q) {
            out[at] = x;
            at += 1;
        }
        for i in &self.cos_sin {
            (out[at], out[at + 1]) = ws.cos_sin[*i];
            at += 2;
        }
        for (places, from) in [(&self.G, &ws.G), (&self.qd, &ws.qd), (&self.g, &ws.g)] {
            for (x, i) in out[at..].iter_mut().zip(places) {
                *x = from[*i];
            }
            at += places.len();
        }
    }

    /// Puts it there again, with the rows of the independents; returns the gain.
    pub(super) fn restore<T: Real>(
        &self,
        model: &Model<T>,
        ws: &mut Workspace<T>,
        closed: &[T],
    ) -> f64 {
        let mut numbers = closed.iter().copied();
        let mut next = || numbers.next().unwrap_or(T::ZERO);
        let mut gain = 1.0;
        if !self.by_newton.is_empty() {
            gain = next().to_branch_value(BranchValue::Gain);
        }
        self.start.iter().for_each(|i| ws.start[*i] = next());
        self.seeds.iter().chain(&self.q).for_each(|i| ws.q[*i] = next());
        self.cos_sin.iter().for_each(|i| ws.cos_sin[*i] = (next(), next()));
        self.G.iter().for_each(|i| ws.G[*i] = next());
        self.qd.iter().for_each(|i| ws.qd[*i] = next());
        self.g.iter().for_each(|i| ws.g[*i] = next());
        for cluster in self.by_newton.iter().map(|c| &model.clusters[*c]) {
            for (k, &j) in cluster.independent.iter().enumerate() {
                let row = cluster.g_offset + j * cluster.n_vy;
                ws.G[row..row + cluster.n_vy].fill(T::ZERO);
                ws.G[row + k] = T::ONE;
                ws.g[cluster.v + j] = T::ZERO;
            }
        }
        gain
    }

    /// The gain of cluster c, where it was closed before, or is closed by the closed form that
    /// answers for Newton's method.
    pub(super) fn close<T: Real>(
        &self,
        model: &Model<T>,
        c: usize,
        ws: &mut Workspace<T>,
        level: Level,
    ) -> Option<Result<f64, Status>> {
        let cluster = &model.clusters[c];
        if self.by_newton.contains(&c) {
            hold_idle(cluster, ws);
            return Some(Ok(1.0));
        }
        let (_, form) = self.form_of(model, c)?;
        hold_idle(cluster, ws);
        let is_seed = |q: &usize| self.seeds.contains(q);
        for q in cluster.dependent_q.iter().map(|q| cluster.q + q).filter(|q| !is_seed(q)) {
            ws.q[q] = ws.start[q];
        }
        let bodies = model.bodies_of(cluster);
        let outcome = form.close(&mut ws.local(cluster, bodies), level);
        let is_closed = outcome.status == Status::Ok;
        Some(if is_closed { Ok(outcome.gain) } else { Err(outcome.status) })
    }

    /// The closed form that answers for Newton's method in cluster c.
    fn form_of<'a, T: Real>(
        &self,
        model: &'a Model<T>,
        c: usize,
    ) -> Option<(&'a Numerical<T>, &'a Formed<T>)> {
        match &model.closures[c] {
            Closure::Numerical(numerical) if self.by_form.contains(&c) => {
                Some((numerical, numerical.form()?))
            }
            _ => None,
        }
    }
}

impl Plan {
    /// True where [`Plan::close`] has something to close or to look at: some closure is by Newton's
    /// method, and the motion is given by the independents.
    #[inline]
    pub fn closes_apart(&self) -> bool {
        !self.closed.by_newton.is_empty() || !self.closed.by_form.is_empty()
    }

    /// How many numbers [`Plan::close`] puts behind the given ones.
    pub fn closed_len(&self) -> usize {
        self.closed.len()
    }

    /// Which numbers [`Plan::close`] puts behind the given ones. Allocates.
    pub fn closed_numbers<C>(&self, model: &Model<C>) -> Vec<ClosedNumbers> {
        let meta = &model.meta;
        let of_v = |v: usize| meta.tree[model.order.v_external[v]].clone();
        let of_q = |q: usize| {
            let row = model.order.q.iter().position(|internal| *internal == q);
            row.map(|row| meta.tree_q[row].clone()).unwrap_or_default()
        };
        let closed = &self.closed;
        let mut list = Vec::new();
        let mut add = |name, joints: Vec<String>, columns| {
            if !joints.is_empty() {
                list.push(ClosedNumbers { name, joints, columns });
            }
        };
        let is_by_newton = !closed.by_newton.is_empty();
        add("gain", is_by_newton.then(|| "all".to_owned()).into_iter().collect(), 1);
        add("start", closed.start.iter().map(|q| of_q(*q)).collect(), 1);
        add("seed", closed.seeds.iter().map(|q| of_q(*q)).collect(), 1);
        add("q", closed.q.iter().map(|q| of_q(*q)).collect(), 1);
        let of_body = |i: &usize| of_v(model.bodies[*i].v);
        add("cos_sin", closed.cos_sin.iter().map(of_body).collect(), 2);
        for cluster in closed.by_newton.iter().map(|c| &model.clusters[*c]) {
            let rows = cluster.dependent.iter().map(|j| of_v(cluster.v + j));
            if !closed.G.is_empty() {
                add("G", rows.collect(), cluster.n_vy);
            }
        }
        add("qd", closed.qd.iter().map(|v| of_v(*v)).collect(), 1);
        add("g_bias", closed.g.iter().map(|v| of_v(*v)).collect(), 1);
        list
    }

    /// Closes the clusters of Newton's method: returns the given numbers, followed by the closure
    /// results for [`Plan::run_closed`]; `None` after a failure, which only [`Plan::run`] answers.
    /// Allocates never.
    pub fn close<'a>(
        &self,
        model: &Model<f64>,
        workspace: &'a mut Workspace<f64>,
        input: &[f64],
    ) -> Option<&'a [f64]> {
        let ws = workspace;
        let given = self.given.len();
        let len = self.given.len() + self.closed.len();
        let fits = input.len() == given && ws.closed.len() >= len && ws.serves(self.needs());
        let is_ours = model.meta.fingerprint == self.fingerprint && ws.belongs_to(model);
        if !fits || !is_ours || !all_finite(input) {
            return None;
        }
        ws.scratch.left = ws.budget(self.searches());
        self.set_state(model, ws, input).ok()?;
        for &c in &self.closed.by_form {
            let cluster = &model.clusters[c];
            let (numerical, _) = self.closed.form_of(model, c)?;
            ws.bring_start(cluster, numerical);
            let at = cluster.coordinates();
            numerical.begin_form(&ws.start[at.clone()], &mut ws.q[at])?;
        }
        let report = &mut RunReport::none();
        let mut most = 1.0;
        for &c in &self.closed.by_newton {
            let (gain, _) = self.close_cluster(c, Pass { model, ws, input, report }).ok()?;
            // NaN stays
            most = larger(most, gain);
        }
        if report.open > self.query.loop_tolerance.bound() {
            return None;
        }
        let mut numbers = core::mem::take(&mut ws.closed);
        numbers[..given].copy_from_slice(input);
        self.closed.save(ws, most, &mut numbers[given..len]);
        ws.closed = numbers;
        Some(&ws.closed[..len])
    }

    /// The rest of [`Plan::run`] on the result of [`Plan::close`]: for [`crate::STRAIGHT_FIELDS`],
    /// and with the same bits if it is `ok`. If it fails, [`Plan::run`] may have an answer. It
    /// omits the warnings of states that [`Plan::close`] refuses. Allocates never.
    pub fn run_closed<T: Real>(
        &self,
        model: &Model<T>,
        workspace: &mut Workspace<T>,
        input: &[T],
        output: &mut [T],
    ) -> Answer {
        self.execute::<T, true>(model, workspace, input, output)
    }
}
