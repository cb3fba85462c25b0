//! One step of a motion: the velocity or the acceleration that gives frames their twists or
//! accelerations within hard limits, with the forces of actuators and contacts.
//!
//! It is a quadratic program over the numbers of an ordinary request, in the external order:
//! x = (ÿ, f, τ) with the forces f of the held frames and τ of actuators of mechanisms that have
//! not as many of them as freedoms. The other ones follow, τ_u = G_u⁻ᵀ (M_y ÿ + C_y − Jᵀ f).

use sarrus_proto::{
    Answer, Field, FieldSet, Query, QueryError, Request, Slot, Status, TaskParts, Warnings,
};

use crate::linalg::{Optimum, dot, solve_sound};
use crate::model::{Method, Model};
use crate::plan::Plan;
use crate::plan::task::Tasks;
use crate::plan::task::step::{normal, solve};
use crate::scalar::{Real, all_finite};
use crate::workspace::{Search, TASK_ROWS, Workspace};

/// Weight of the way to the preferred velocity or acceleration, in radians or lengths, and of the
/// squares of forces.
const STAY: f64 = 1e-9;
const FORCE: f64 = 1e-12;
/// Numbers of a task: twist or acceleration, and weight.
const NUMBERS: usize = 7;
/// Bounds that contradict by less, relative to their size, are one.
const ALIKE: f64 = 1e-12;
/// The columns of [`Field::Binding`].
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const EFFORT: usize = 2;

/// The part of a model and a query that a step reads, by external numbers.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    /// The ordinary request whose numbers it reads.
    pub(super) inner: Plan,
    limited: Vec<Limited>,
    /// Mechanisms with as many actuators as freedoms, and the others that forces act on.
    even: Vec<Group>,
    uneven: Vec<Group>,
    /// First column of the actuators of `uneven`, and number of columns.
    forces: usize,
    width: usize,
}

/// A joint of one freedom with a limit.
#[derive(Clone, Copy, Debug)]
struct Limited {
    q: usize,
    v: usize,
    /// Its number in the workspace, and among the independents.
    internal: usize,
    independent: Option<usize>,
    velocity: f64,
}

/// The independents and the actuators of a mechanism, these with their tree velocities.
#[derive(Clone, Debug, Default)]
struct Group {
    y: Vec<usize>,
    u: Vec<(usize, usize)>,
    /// As of its cluster.
    least_authority: f64,
}

impl Motion {
    /// `None` for a request without a step.
    pub(super) fn of<C: Real>(
        model: &Model<C>,
        query: &Query,
        method: Method,
        single: &[Option<usize>],
    ) -> Result<Option<Motion>, QueryError> {
        use Field::*;
        let (request, given, want) = match Request::from_code(query.request) {
            Some(Request::DifferentialInverseKinematics) => (
                Request::Kinematics,
                FieldSet::of(&[Y, Q, U, QGuess]),
                FieldSet::of(&[Q, G, JacobianIndependent]),
            ),
            Some(Request::Step) => (
                Request::InverseDynamics,
                FieldSet::of(&[Y, Q, U, QGuess, Yd, Qd, Ud, QdGuess, Wrenches]),
                FieldSet::of(&[Q, Qd, G, GBias, MY, TauY, JacobianIndependent, JdYd]),
            ),
            _ => return Ok(None),
        };
        let with_com = match (query.given.has(ComTarget), request) {
            (false, _) => want,
            (true, Request::Kinematics) => want.with(ComJacobian),
            (true, _) => want.with(ComJacobian).with(ComBias),
        };
        let plain = Query::new(request, FieldSet(given.0 & query.given.0), with_com);
        let inner = Query {
            request: plain.request,
            given: plain.given,
            want: plain.want,
            tasks: plain.tasks,
            joints: plain.joints,
            n_joint_runs: 0,
            ..*query
        };
        let order = &model.order;
        let place = |of: &[usize], x: usize| of.iter().position(|y| *y == x);
        let velocity = |v: usize| model.limits.iter().find(|of| of.v == v).map(|of| of.velocity);
        let limited = (0..single.len()).filter_map(|v| {
            Some(Limited {
                q: place(&order.q, single[v]?)?,
                v: order.v_external[v],
                internal: v,
                independent: place(&order.vy_v, v),
                velocity: velocity(v).unwrap_or(f64::INFINITY),
            })
        });
        let mut groups = vec![Group::default(); model.clusters.len()];
        for (of, cluster) in groups.iter_mut().zip(&model.clusters) {
            of.least_authority = cluster.least_authority;
        }
        for (k, c) in model.independent_clusters().into_iter().enumerate() {
            groups[c].y.push(k);
        }
        for (u, c) in model.actuator_clusters().into_iter().enumerate() {
            groups[c].u.push((u, order.v_external[order.u_v[u]]));
        }
        let is_step = query.request == Request::Step as u32;
        let moved = groups.into_iter().filter(|of| is_step && !of.y.is_empty());
        let (even, uneven): (Vec<Group>, Vec<Group>) =
            moved.partition(|of| of.y.len() == of.u.len());
        let held = query.tasks.iter().filter(|parts| is_step && parts.contains(TaskParts::HELD));
        let forces = model.sizes().n_vy + held.map(|parts| rows_of(*parts).count()).sum::<usize>();
        let width = forces + uneven.iter().map(|of| of.u.len()).sum::<usize>();
        let inner = Plan::with_method(model, &inner, method)?;
        Ok(Some(Motion { inner, limited: limited.collect(), even, uneven, forces, width }))
    }

    /// True where the force of an actuator has no limit.
    fn has_no_limit<C>(&self, model: &Model<C>) -> bool {
        let mut actuators = self.even.iter().chain(&self.uneven).flat_map(|of| &of.u);
        actuators.any(|(u, _)| model.actuator_forces(*u, 0.0).is_none())
    }
}

/// Rows of a twist that a task is about.
fn rows_of(parts: TaskParts) -> impl Iterator<Item = usize> {
    let of = |part, rows: core::ops::Range<usize>| rows.filter(move |_| parts.contains(part));
    of(TaskParts::ORIENTATION, 0..3).chain(of(TaskParts::POSITION, 3..6))
}

impl Plan {
    /// Answers a request for one step of a motion, as [`Plan::run`].
    pub(super) fn run_motion(
        &self,
        (tasks, motion): (&Tasks, &Motion),
        model: &Model<f64>,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        (input, output): (&[f64], &mut [f64]),
    ) -> Answer {
        let mut numbers = core::mem::take(&mut search.numbers);
        let inner = &motion.inner;
        let (given, rest) = numbers.split_at_mut(inner.given.len());
        for slot in inner.given.slots() {
            if let Some(from) = self.given.slot(slot.field) {
                given[slot.range()].copy_from_slice(&input[from.range()]);
            }
        }
        let state = &mut rest[..inner.want.len()];
        let mut answer = inner.execute::<f64, false>(model, ws, given, state);
        if answer.status == Status::Ok {
            let program = Program { plan: self, tasks, motion, model, input, state };
            answer.status = program.answer(search, output).unwrap_or_else(|status| status);
            if motion.has_no_limit(model) {
                answer.warnings |= Warnings::NO_LIMIT;
            }
        }
        if !matches!(answer.status, Status::Ok | Status::Infeasible) {
            output.fill(f64::NAN);
        }
        if answer.status != Status::Ok {
            answer.warnings = Warnings::NONE;
        }
        search.numbers = numbers;
        answer
    }
}

/// The program of a state.
struct Program<'a> {
    plan: &'a Plan,
    tasks: &'a Tasks,
    motion: &'a Motion,
    model: &'a Model<f64>,
    input: &'a [f64],
    state: &'a [f64],
}

/// Rows of the program: those of the first level, equations, and all dense ones behind the first
/// level; the first row of the actuators of even mechanisms.
#[derive(Clone, Copy)]
struct Shape {
    first: usize,
    equal: usize,
    dense: usize,
    actuators: usize,
}

impl Program<'_> {
    fn of(&self, field: Field) -> &[f64] {
        self.motion.inner.want.slot(field).map_or(&[], |slot: &Slot| &self.state[slot.range()])
    }

    fn given(&self, field: Field) -> &[f64] {
        self.plan.given.slot(field).map_or(&[], |slot: &Slot| &self.input[slot.range()])
    }

    fn is_step(&self) -> bool {
        self.plan.request == Request::Step
    }

    /// Wanted motion and weight of a task.
    fn wanted(&self, k: usize) -> &[f64] {
        &self.given(Field::TaskMotion)[NUMBERS * k..NUMBERS * (k + 1)]
    }

    /// Row of a frame's Jacobian, and the wanted J ẏ or J ÿ.
    fn task_row(&self, k: usize, row: usize) -> (&[f64], f64) {
        let n = self.model.sizes().n_vy;
        let bias = self.of(Field::JdYd).get(6 * k + row).copied().unwrap_or(0.0);
        let J = &self.of(Field::JacobianIndependent)[(6 * k + row) * n..][..n];
        (J, self.wanted(k)[row] - bias)
    }

    /// The same of the centre of mass.
    fn com_row(&self, row: usize) -> Option<(&[f64], f64)> {
        let n = self.model.sizes().n_vy;
        let wanted = self.given(Field::ComTarget).get(row)?;
        let bias = self.of(Field::ComBias).get(row).copied().unwrap_or(0.0);
        Some((&self.of(Field::ComJacobian)[row * n..][..n], wanted - bias))
    }

    fn held(&self) -> impl Iterator<Item = (usize, TaskParts)> {
        let all = self.tasks.tasks.iter().map(|(_, parts)| *parts).enumerate();
        all.filter(|(_, parts)| parts.contains(TaskParts::HELD))
    }

    fn free(&self, level: usize) -> impl Iterator<Item = (usize, TaskParts)> {
        let all = self.tasks.tasks.iter().map(|(_, parts)| *parts).enumerate();
        all.filter(move |(_, parts)| {
            !parts.contains(TaskParts::HELD)
                && usize::from(parts.contains(TaskParts::SECOND)) == level
        })
    }

    /// Solves the program and writes the answer.
    fn answer(&self, search: &mut Search, output: &mut [f64]) -> Result<Status, Status> {
        let N = self.motion.width;
        let given = |field| self.plan.given.slot(field).map(|slot| &self.input[slot.range()]);
        self.tasks.bounds(given, search)?;
        let dt = self.given(Field::Dt)[0];
        let weighs = |(k, _): (usize, TaskParts)| self.wanted(k)[NUMBERS - 1] > 0.0;
        if (dt.is_nan() || dt <= 0.0) || !self.free(0).chain(self.free(1)).all(weighs) {
            return Err(Status::BadRequest);
        }
        let first = self.costs(search);
        let equal = self.equations(search);
        let limits = self.limits(search, equal, dt);
        let dense = self.actuators(search, limits)?;
        let shape = Shape { first, equal, dense, actuators: limits };
        if let Some(row) = self.contradiction(search, N + dense) {
            self.write_binding(search, shape, Some(row), output);
            return Ok(Status::Infeasible);
        }
        self.set_level(search, 0);
        match solve(search, N, [0, dense], equal) {
            (Optimum::Found, _) => {}
            (Optimum::Contradicts(_), _) => {
                self.write_binding(search, shape, None, output);
                return Ok(Status::Infeasible);
            }
            (Optimum::Failed, _) => return Err(Status::NotConverged),
        }
        search.step[..N].copy_from_slice(&search.program.x[..N]);
        if self.tasks.has_second {
            self.second(search, shape);
        }
        if !all_finite(&search.step[..N]) {
            return Err(Status::NonFiniteInput);
        }
        self.write(search, shape, output);
        self.write_binding(search, shape, None, output);
        Ok(Status::Ok)
    }

    /// JᵀJ and Jᵀ of the wanted motion of each level; the rows of the first.
    fn costs(&self, search: &mut Search) -> usize {
        let N = self.motion.width;
        let n = self.model.sizes().n_vy;
        let mut m = 0;
        let mut first = 0;
        let preferred = if self.is_step() { Field::Ydd } else { Field::Yd };
        let preferred = self.given(preferred);
        for level in 0..2 {
            let begin = m;
            let Search { J, H, g, .. } = search;
            g[level][..N].fill(0.0);
            let mut add = |(line, wanted): (&[f64], f64), weight: f64| {
                let row = &mut J[m * N..(m + 1) * N];
                row.fill(0.0);
                for ((x, of), g) in row.iter_mut().zip(line).zip(&mut g[level]) {
                    *x = weight * of;
                    *g += weight * weight * wanted * of;
                }
                m += 1;
            };
            for (k, parts) in self.free(level) {
                let weight = self.wanted(k)[NUMBERS - 1].sqrt();
                rows_of(parts).for_each(|row| add(self.task_row(k, row), weight));
            }
            if level == 0 {
                (0..3).filter_map(|row| self.com_row(row)).for_each(|of| add(of, 1.0));
                first = m;
            }
            normal(&J[begin * N..m * N], &mut H[level], N);
            for c in 0..N {
                let of = self.model.order.vy.get(c).map(|k| self.tasks.independents[*k].unit);
                let stay = of.map_or(FORCE, |unit| STAY / (unit * unit));
                H[level][c * N + c] += stay;
                if let Some(x) = preferred.get(c).filter(|_| c < n) {
                    g[level][c] += stay * x;
                }
            }
        }
        first
    }

    /// Row i of M_y ÿ − Jᵀ f.
    fn dynamics(&self, i: usize, row: &mut [f64]) {
        let n = self.model.sizes().n_vy;
        row.fill(0.0);
        row[..n].copy_from_slice(&self.of(Field::MY)[i * n..][..n]);
        let held = self.held().flat_map(|(k, parts)| rows_of(parts).map(move |row| (k, row)));
        for (x, (k, of)) in row[n..].iter_mut().zip(held) {
            *x = -self.task_row(k, of).0[i];
        }
    }

    /// Held frames, and independents without an own actuator; their number.
    fn equations(&self, search: &mut Search) -> usize {
        let N = self.motion.width;
        let n = self.model.sizes().n_vy;
        let mut count = 0;
        let Search { rows, row_lower, row_upper, joints, .. } = search;
        let mut next = |value: f64, fill: &mut dyn FnMut(&mut [f64])| {
            fill(&mut rows[(TASK_ROWS + count) * N..][..N]);
            row_lower[N + count] = value;
            row_upper[N + count] = value;
            joints[N + count] = None;
            count += 1;
        };
        for (k, parts) in self.held() {
            for of in rows_of(parts) {
                let (line, value) = self.task_row(k, of);
                next(value, &mut |row| {
                    row.fill(0.0);
                    row[..n].copy_from_slice(line);
                });
            }
        }
        let mut column = self.motion.forces;
        for group in &self.motion.uneven {
            for &i in &group.y {
                next(-self.of(Field::TauY)[i], &mut |row| {
                    self.dynamics(i, row);
                    for (x, (_, v)) in row[column..].iter_mut().zip(&group.u) {
                        *x = -self.of(Field::G)[v * n + i];
                    }
                });
            }
            column += group.u.len();
        }
        count
    }

    /// Bounds of the joints, behind so many rows; the rows so far.
    fn limits(&self, search: &mut Search, from: usize, dt: f64) -> usize {
        let N = self.motion.width;
        let n = self.model.sizes().n_vy;
        let mut count = from;
        search.row_lower[..N].fill(f64::NEG_INFINITY);
        search.row_upper[..N].fill(f64::INFINITY);
        search.joints[..N].fill(None);
        for of in &self.motion.limited {
            let q = self.of(Field::Q)[of.q];
            let stroke = [search.lower[of.internal] - q, search.upper[of.internal] - q];
            let speed = [-of.velocity, of.velocity];
            let [stroke, speed] = if self.is_step() {
                let qd = self.of(Field::Qd)[of.v];
                let bias = self.of(Field::GBias)[of.v];
                [
                    stroke.map(|x| 2.0 * (x - dt * qd) / (dt * dt) - bias),
                    speed.map(|x| (x - qd) / dt - bias),
                ]
            } else {
                [stroke.map(|x| x / dt), speed]
            };
            let columns = [
                if stroke[0] > speed[0] { POSITION } else { VELOCITY },
                if stroke[1] < speed[1] { POSITION } else { VELOCITY },
            ];
            let bounds = [stroke[0].max(speed[0]), stroke[1].min(speed[1])];
            if bounds == [f64::NEG_INFINITY, f64::INFINITY] {
                continue;
            }
            let at = of.independent.unwrap_or(N + count);
            if of.independent.is_none() {
                let row = &mut search.rows[(TASK_ROWS + count) * N..][..N];
                row.fill(0.0);
                row[..n].copy_from_slice(&self.of(Field::G)[of.v * n..][..n]);
                count += 1;
            }
            [search.row_lower[at], search.row_upper[at]] = bounds;
            search.joints[at] = Some((of.v, columns));
        }
        count
    }

    /// Least and greatest force of an actuator; infinite without a limit.
    fn forces_of(&self, u: usize, v: usize) -> [f64; 2] {
        let none = [f64::NEG_INFINITY, f64::INFINITY];
        self.model.actuator_forces(u, self.of(Field::Qd)[v]).unwrap_or(none)
    }

    /// Bounds of the actuators' forces, behind so many rows; the rows so far.
    fn actuators(&self, search: &mut Search, from: usize) -> Result<usize, Status> {
        let N = self.motion.width;
        let n = self.model.sizes().n_vy;
        let mut count = from;
        let Search { rows, row_lower, row_upper, joints, block, solved, constant, .. } = search;
        for group in &self.motion.even {
            let p = group.y.len();
            for (i, &y) in group.y.iter().enumerate() {
                for (r, (_, v)) in group.u.iter().enumerate() {
                    block[i * p + r] = self.of(Field::G)[v * n + y];
                }
                let line = &mut solved[i * (N + 1)..(i + 1) * (N + 1)];
                self.dynamics(y, &mut line[..N]);
                line[N] = self.of(Field::TauY)[y];
            }
            if solve_sound(
                &mut block[..p * p],
                &mut solved[..p * (N + 1)],
                p,
                N + 1,
                group.least_authority,
            )
            .is_none()
            {
                return Err(Status::SingularActuation);
            }
            for (line, &(u, v)) in solved.chunks_exact(N + 1).zip(&group.u) {
                rows[(TASK_ROWS + count) * N..][..N].copy_from_slice(&line[..N]);
                constant[u] = line[N];
                let [lower, upper] = self.forces_of(u, v);
                [row_lower[N + count], row_upper[N + count]] = [lower - line[N], upper - line[N]];
                joints[N + count] = Some((v, [EFFORT; 2]));
                count += 1;
            }
        }
        let uneven = self.motion.uneven.iter().flat_map(|of| &of.u);
        for (c, &(u, v)) in (self.motion.forces..N).zip(uneven) {
            [row_lower[c], row_upper[c]] = self.forces_of(u, v);
            joints[c] = Some((v, [EFFORT; 2]));
        }
        Ok(count)
    }

    /// A row whose bounds leave nothing, but for rounding.
    fn contradiction(&self, search: &mut Search, rows: usize) -> Option<usize> {
        for row in 0..rows {
            let [lower, upper] = [search.row_lower[row], search.row_upper[row]];
            if lower > upper {
                if lower - upper > ALIKE * lower.abs().max(upper.abs()) {
                    return Some(row);
                }
                search.row_lower[row] = upper;
            }
        }
        None
    }

    fn set_level(&self, search: &mut Search, level: usize) {
        let N = self.motion.width;
        let Search { H, damped, g, damped_g, .. } = search;
        damped[..N * N].copy_from_slice(&H[level][..N * N]);
        damped_g[..N].copy_from_slice(&g[level][..N]);
    }

    /// The second level, where the first one stays as it is.
    fn second(&self, search: &mut Search, shape: Shape) {
        let N = self.motion.width;
        let Shape { first, equal, dense, .. } = shape;
        let from = TASK_ROWS - first;
        let Search { rows, J, row_lower, row_upper, step, .. } = search;
        rows[from * N..TASK_ROWS * N].copy_from_slice(&J[..first * N]);
        row_lower.copy_within(N..N + dense, N + first);
        row_upper.copy_within(N..N + dense, N + first);
        for i in 0..first {
            let at = dot(&rows[(from + i) * N..][..N], step);
            [row_lower[N + i], row_upper[N + i]] = [at, at];
        }
        self.set_level(search, 1);
        let found = solve(search, N, [first, dense], first + equal);
        if found.0 == Optimum::Found {
            let Search { program, step, .. } = search;
            step[..N].copy_from_slice(&program.x[..N]);
            // the sides of the rows behind the first level
            program.side.copy_within(N + first..N + first + dense, N);
        }
    }

    /// Writes all but the active bounds.
    fn write(&self, search: &Search, shape: Shape, output: &mut [f64]) {
        let N = self.motion.width;
        let n = self.model.sizes().n_vy;
        let x = &search.step[..N];
        let slot = |field| self.plan.want.slot(field).map(Slot::range);
        let moved = if self.is_step() { Field::Ydd } else { Field::Yd };
        if let Some(range) = slot(moved) {
            output[range].iter_mut().zip(x).for_each(|(to, x)| *to = x.plus_zero());
        }
        if let Some(range) = slot(Field::TauU) {
            let out = &mut output[range];
            let even = self.motion.even.iter().flat_map(|of| &of.u);
            for (row, (u, _)) in (shape.actuators..shape.dense).zip(even) {
                let row = &search.rows[(TASK_ROWS + row) * N..][..N];
                out[*u] = (dot(row, x) + search.constant[*u]).plus_zero();
            }
            let uneven = self.motion.uneven.iter().flat_map(|of| &of.u);
            for (x, (u, _)) in x[self.motion.forces..].iter().zip(uneven) {
                out[*u] = x.plus_zero();
            }
        }
        if let Some(range) = slot(Field::ContactForces) {
            let out = &mut output[range];
            let held = self.held().flat_map(|(k, parts)| rows_of(parts).map(move |row| (k, row)));
            self.held().for_each(|(k, _)| out[6 * k..6 * (k + 1)].fill(0.0));
            for (x, (k, row)) in x[n..self.motion.forces].iter().zip(held) {
                out[6 * k + row] = x.plus_zero();
            }
        }
        if let Some(range) = slot(Field::TaskResidual) {
            let out = &mut output[range];
            let off = |(line, wanted): (&[f64], f64)| (dot(line, x) - wanted).powi(2);
            for (k, parts) in self.free(0).chain(self.free(1)) {
                let of = |rows: core::ops::Range<usize>| {
                    let asked = rows_of(parts).filter(|row| rows.contains(row));
                    asked.map(|row| off(self.task_row(k, row))).sum::<f64>().sqrt()
                };
                out[k] = of(0..3).max(of(3..6));
            }
            let of_com = (0..3).filter_map(|row| self.com_row(row)).map(off);
            if let (Some(last), true) = (out.last_mut(), !self.given(Field::ComTarget).is_empty()) {
                *last = of_com.sum::<f64>().sqrt();
            }
        }
    }

    /// Writes the bounds that the program met, or those of a row that contradict.
    fn write_binding(&self, search: &Search, of: Shape, row: Option<usize>, output: &mut [f64]) {
        let N = self.motion.width;
        let Some(range) = self.plan.want.slot(Field::Binding).map(Slot::range) else { return };
        let out = &mut output[range];
        out.fill(0.0);
        let mut mark = |row, side| mark(search, row, side, out);
        match row {
            Some(row) => [-1, 1].into_iter().for_each(|side| mark(row, side)),
            None => (0..N)
                .chain(N + of.equal..N + of.dense)
                .for_each(|row| mark(row, search.program.side[row])),
        }
    }
}

/// Marks an active bound of a row.
fn mark(search: &Search, row: usize, side: i8, out: &mut [f64]) {
    if let (Some((v, columns)), true) = (search.joints[row], side != 0) {
        out[3 * v + columns[usize::from(side > 0)]] = f64::from(side);
    }
}
