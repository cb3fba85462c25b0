//! One step of a search: a quadratic program for each level.

use sarrus_proto::{Status, TaskParts};

use crate::algorithms::Links;
use crate::closure::Level;
use crate::linalg::{Optimum, Rows, dot};
use crate::plan::task::pose::{Way, Worth, parts_of, sigma_of};
use crate::workspace::{Search, TASK_ROWS, Workspace};

/// By how much dependent coordinates stay inside their bounds: linear steps meet them to rounding.
const INSIDE: f64 = 1e-11;
/// Step of the difference quotient that is the rate of `sigma_min`, and its distance inside.
const QUOTIENT: f64 = 1e-6;
/// Longest way of a step, in radians or lengths.
pub(super) const LONGEST: f64 = 1.0;
/// Least damping, and that for the square of an error.
const DAMPING: f64 = 1e-9;
const OF_ERROR: f64 = 1e-2;
/// Weight of bounds that cannot be met in one step.
const ELASTIC: f64 = 1e3;

/// The program of a pose.
#[derive(Clone, Copy)]
pub(super) struct Linear {
    /// Independents that move.
    pub(super) n: usize,
    /// Rows of the first level, and of dependent coordinates.
    first: usize,
    limits: usize,
}

/// A step, in `search.step`.
#[derive(Clone, Copy)]
pub(super) struct Step {
    /// The longest way of an independent, in radians or lengths.
    pub(super) size: f64,
    /// The largest multiplier of a bound of the first level.
    pub(super) multiplier: f64,
}

impl Way<'_> {
    /// Jacobians of the tasks and rows of the bounds at the pose in the workspace, which `look` has
    /// just closed.
    pub(super) fn linearise(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        worth: &Worth,
    ) -> Result<Linear, Status> {
        let model = self.model;
        let n_vy = model.sizes().n_vy;
        // all independents where a bound is broken
        let n = if worth.broken > 0.0 { n_vy } else { self.tasks.moves.len() };
        match worth.broken > 0.0 {
            true => search.moves[..n].iter_mut().enumerate().for_each(|(k, of)| *of = k),
            false => search.moves[..n].copy_from_slice(&self.tasks.moves),
        }
        let Search { moves, J, of_frame, H, g, .. } = search;
        let moves = &moves[..n];
        let mut m = 0;
        let mut first = 0;
        for level in 0..2 {
            let begin = m;
            g[level][..n].fill(0.0);
            for k in 0..self.tasks.tasks.len() {
                let (link, parts) = self.tasks.tasks[k];
                if usize::from(parts.contains(TaskParts::SECOND)) != level {
                    continue;
                }
                let target = self.target(k)?;
                let away = self.away(ws, k, &target);
                let frame = &model.frames[link];
                let order = &model.order.vy_internal;
                self.plan.independent_jacobian(model, ws, frame, of_frame, order);
                for (part, error) in parts_of(parts, &away) {
                    let from = if part == TaskParts::POSITION { 3 } else { 0 };
                    for (c, of) in moves.iter().enumerate() {
                        let mut column = [0, 1, 2].map(|row| of_frame[(from + row) * n_vy + of]);
                        if part == TaskParts::AXIS {
                            // turns about the axis itself do not matter
                            let z = &away.z;
                            let along = (0..3).map(|i| column[i] * z[i]).sum::<f64>();
                            (0..3).for_each(|i| column[i] -= along * z[i]);
                        }
                        for (row, x) in column.iter().enumerate() {
                            J[(m + row) * n + c] = x * target.weight;
                            g[level][c] += x * error[row] * target.weight * target.weight;
                        }
                    }
                    m += 3;
                }
            }
            if let (0, Some(away)) = (level, self.com_away(ws)?) {
                self.com_jacobian(ws, of_frame);
                for row in 0..3 {
                    for (c, of) in moves.iter().enumerate() {
                        let x = of_frame[row * n_vy + of];
                        J[(m + row) * n + c] = x;
                        g[0][c] += x * away[row];
                    }
                }
                m += 3;
            }
            normal(&J[begin * n..m * n], &mut H[level], n);
            if level == 0 {
                first = m;
            }
        }
        self.each_preferred(ws, |k, weight, away| {
            if let Ok(c) = moves.binary_search(&k) {
                H[1][c * n + c] += weight;
                g[1][c] += weight * away;
            }
        });
        let limits = self.limit_rows(ws, search, n, worth);
        Ok(Linear { n, first, limits })
    }

    /// Jacobian of the centre of mass over the independents (3 × n_vy).
    fn com_jacobian(&self, ws: &mut Workspace<f64>, out: &mut [f64]) {
        let model = self.model;
        let n_vy = model.sizes().n_vy;
        let links = Links::of(model, &ws.world, &ws.motion);
        let mass = links.mass;
        out[..3 * n_vy].fill(0.0);
        links.columns(&mut ws.composite, |v, column| {
            let cluster = &model.clusters[model.cluster_of_v[v]];
            let G = cluster.G(&ws.G).row(v - cluster.v);
            for (k, g) in cluster.independents().zip(G) {
                for row in 0..3 {
                    out[row * n_vy + k] += column[3 + row] / mass * g;
                }
            }
        });
    }

    /// Rows of the dependent coordinates that may meet a bound, and of `sigma_min`; how many.
    fn limit_rows(
        &self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        n: usize,
        worth: &Worth,
    ) -> usize {
        let model = self.model;
        let tasks = self.tasks;
        let mut count = 0;
        for &(q, v) in &tasks.bounded {
            let cluster = &model.clusters[model.cluster_of_v[v]];
            let j = v - cluster.v;
            if !cluster.dependent.contains(&j) {
                continue;
            }
            let G = cluster.G(&ws.G).row(j);
            let row = &mut search.rows[(TASK_ROWS + count) * n..][..n];
            let mut reach = 0.0;
            for (x, &k) in row.iter_mut().zip(&search.moves) {
                let own = cluster.independents().contains(&k);
                *x = if own { G[k - cluster.vy] } else { 0.0 };
                reach += x.abs() * tasks.independents[k].unit * LONGEST;
            }
            let [lower, upper] = [&search.lower, &search.upper].map(|of| of[v]);
            let inside = |bound: f64| (INSIDE * bound.abs().max(1.0)).min(0.25 * (upper - lower));
            let below = lower + inside(lower) - ws.q[q];
            let above = upper - inside(upper) - ws.q[q];
            if reach > 0.0 && (below > -reach || above < reach) {
                search.limits[count] = [below, above];
                count += 1;
            }
        }
        if self.clearance > 0.0 && worth.sigma_min < 2.0 * self.clearance {
            let row = &mut search.rows[(TASK_ROWS + count) * n..][..n];
            let sigma_min = self.clearance_row(ws, &search.moves[..n], row);
            search.limits[count] = [self.clearance + QUOTIENT - sigma_min, f64::INFINITY];
            count += 1;
        }
        count
    }

    /// The rate of `sigma_min` over the independents that move.
    fn clearance_row(&self, ws: &mut Workspace<f64>, moves: &[usize], row: &mut [f64]) -> f64 {
        row.fill(0.0);
        let (Some(c), least) = self.sigma_min(ws) else { return 1.0 };
        let cluster = &self.model.clusters[c];
        let is_cold = self.plan.given.slot(sarrus_proto::Field::QGuess).is_none();
        for (x, &k) in row.iter_mut().zip(moves) {
            if !cluster.independents().contains(&k) {
                continue;
            }
            let of = &self.tasks.independents[k];
            let dof = &cluster.dofs[of.j];
            let h = QUOTIENT * of.unit;
            dof.advance(&mut ws.q[cluster.q..], h);
            let closed = ws.close_from(self.model, c, Level::Jacobian, is_cold, false).status;
            if closed == Status::Ok {
                *x = (sigma_of(self.model, c, ws) - least) / h;
            }
            dof.advance(&mut ws.q[cluster.q..], -h);
        }
        ws.close_from(self.model, c, Level::Jacobian, is_cold, false);
        least
    }

    /// The step of both levels, no longer than `radius`; `None` where rounding hides it.
    pub(super) fn step(
        &self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        linear: Linear,
        worth: &Worth,
        (radius, damping): (f64, f64),
    ) -> Option<Step> {
        let Linear { n, first, limits } = linear;
        let work = n * n * (n + limits + first);
        ws.scratch.spend(work as u64);
        let damped = |level: usize| damping * (DAMPING + OF_ERROR * worth.cost[level]);
        self.bounds(search, linear, 0, radius);
        self.set_program(search, n, 0, damped(0));
        let mut found = solve(search, n, [0, limits], 0);
        if matches!(found.0, Optimum::Contradicts(_)) {
            self.relax(search, n, limits, damped(0));
            found = solve(search, n, [0, limits], 0);
        }
        let (Optimum::Found, n_active) = found else { return None };
        let multiplier = search.program.largest_multiplier(n_active);
        search.step[..n].copy_from_slice(&search.program.x[..n]);
        if self.tasks.has_second {
            // the first level stays where it is
            let from = TASK_ROWS - first;
            search.rows[from * n..TASK_ROWS * n].copy_from_slice(&search.J[..first * n]);
            self.bounds(search, linear, first, radius);
            self.set_program(search, n, 1, damped(1));
            if let (Optimum::Found, _) = solve(search, n, [first, limits], first) {
                search.step[..n].copy_from_slice(&search.program.x[..n]);
            }
        }
        let units = search.moves.iter().map(|k| self.tasks.independents[*k].unit);
        let size = search.step[..n].iter().zip(units).map(|(x, unit)| x.abs() / unit);
        Some(Step { size: size.fold(0.0, f64::max), multiplier })
    }

    /// Bounds of the program: of each independent, of `equal` rows at the step so far, and of the
    /// limits, which ask for no more than a part of the way.
    fn bounds(&self, search: &mut Search, linear: Linear, equal: usize, radius: f64) {
        let n = linear.n;
        let Search { moves, base, lower, upper, rows, limits, row_lower, row_upper, step, .. } =
            search;
        for (c, k) in moves[..n].iter().enumerate() {
            let of = &self.tasks.independents[*k];
            let most = radius * of.unit;
            let (below, above) = of.single.map_or((-most, most), |(q, v)| {
                ((lower[v] - base[q]).max(-most), (upper[v] - base[q]).min(most))
            });
            (row_lower[c], row_upper[c]) = (below.min(0.0), above.max(0.0));
        }
        for i in 0..equal {
            let row = &rows[(TASK_ROWS - equal + i) * n..][..n];
            let at = dot(row, &step[..n]);
            (row_lower[n + i], row_upper[n + i]) = (at, at);
        }
        for (i, [below, above]) in limits[..linear.limits].iter().enumerate() {
            let row = &rows[(TASK_ROWS + i) * n..][..n];
            let units = moves.iter().map(|k| self.tasks.independents[*k].unit);
            let reach = 0.5 * radius * row.iter().zip(units).map(|(x, u)| x.abs() * u).sum::<f64>();
            row_lower[n + equal + i] = below.min(reach);
            row_upper[n + equal + i] = above.max(-reach);
        }
    }

    /// The damped program of a level.
    fn set_program(&self, search: &mut Search, n: usize, level: usize, damping: f64) {
        let Search { H, damped, g, damped_g, moves, .. } = search;
        damped[..n * n].copy_from_slice(&H[level][..n * n]);
        for (c, k) in moves[..n].iter().enumerate() {
            let unit = self.tasks.independents[*k].unit;
            damped[c * n + c] += damping / (unit * unit);
        }
        damped_g[..n].copy_from_slice(&g[level][..n]);
    }

    /// Rows that contradict become part of the costs: they get no worse, and as good as they can.
    fn relax(&self, search: &mut Search, n: usize, limits: usize, damping: f64) {
        self.set_program(search, n, 0, damping);
        let Search { damped, damped_g, rows, row_lower, row_upper, .. } = search;
        for i in 0..limits {
            let row = &rows[(TASK_ROWS + i) * n..][..n];
            let below = &mut row_lower[n + i];
            let above = &mut row_upper[n + i];
            let wanted = if *below > 0.0 { *below } else { above.min(0.0) };
            (*below, *above) = (below.min(0.0), above.max(0.0));
            if wanted == 0.0 {
                continue;
            }
            for a in 0..n {
                damped_g[a] += ELASTIC * wanted * row[a];
                for b in 0..=a {
                    damped[a * n + b] += ELASTIC * row[a] * row[b];
                }
            }
        }
    }
}

/// Solves the program of so many rows before and behind number [`TASK_ROWS`], the first `equal` of
/// them equations.
pub(super) fn solve(
    search: &mut Search,
    n: usize,
    [before, behind]: [usize; 2],
    equal: usize,
) -> (Optimum, usize) {
    let Search { damped, damped_g, rows, row_lower, row_upper, program, .. } = search;
    let of_program = Rows {
        dense: &rows[(TASK_ROWS - before) * n..(TASK_ROWS + behind) * n],
        lower: &row_lower[..n + before + behind],
        upper: &row_upper[..n + before + behind],
        equal,
    };
    program.solve(n, damped, damped_g, of_program)
}

/// JᵀJ, the lower triangle.
pub(super) fn normal(J: &[f64], H: &mut [f64], n: usize) {
    H[..n * n].fill(0.0);
    for row in J.chunks_exact(n.max(1)) {
        for (a, x) in row.iter().enumerate().filter(|(_, x)| **x != 0.0) {
            H[a * n..=a * n + a].iter_mut().zip(row).for_each(|(h, y)| *h = x.mul_add(*y, *h));
        }
    }
}
