//! A search for positions: steps from the guess, then from other starts in a fixed order, within a
//! budget of operations. The same request takes the same steps, in process and in a server.

use sarrus_proto::{Answer, Field, MAX_SOLUTIONS, Slot, Status, Warnings};

use crate::model::Model;
use crate::plan::Plan;
use crate::plan::run::RunReport;
use crate::plan::task::Tasks;
use crate::plan::task::pose::{Way, Worth};
use crate::plan::task::step::LONGEST;
use crate::scalar::{Real, all_finite};
use crate::workspace::{Search, Workspace};

/// Largest error of an answer that is `ok`, and that at which a search ends.
const REACHED: f64 = 1e-9;
const CLOSE: f64 = 1e-10;
/// Budgets of a request that a search may spend, where it does not take its turn with others.
const BUDGETS: u64 = 16;
/// Starts, without and with `search` or where all solutions are wanted.
const STARTS: u32 = 100;
const MANY_STARTS: u32 = 400;
/// Poses among which a start is the best.
const DRAWS: u32 = 6;
/// Steps from one start, and from the best pose at the end.
const STEPS: u32 = 60;
const LAST_STEPS: u32 = 300;
/// Steps with little gain after which a start is given up, and the gain that is little.
const SLOW: u32 = 5;
const LITTLE: f64 = 0.02;
/// Shorter steps after one that gained nothing.
const TRIES: u32 = 10;
/// Weight of the first level beside the second in the comparison of poses on the way.
const FIRST: f64 = 1e4;
/// Distance of two solutions, in radians or metres.
const APART: f64 = 1e-6;
/// Distance to a bound that is active.
const ACTIVE: f64 = 1e-9;
/// A given bound beyond this is none.
const NONE: f64 = f64::MAX;

impl Plan {
    /// Answers a request with tasks, as [`Plan::run`].
    pub(in crate::plan) fn run_tasks(
        &self,
        tasks: &Tasks,
        model: &Model<f64>,
        ws: &mut Workspace<f64>,
        input: &[f64],
        output: &mut [f64],
    ) -> Answer {
        output.fill(f64::NAN);
        let refused = |status| Answer { status, warnings: Warnings::NONE };
        if let Err(status) = self.check_tasks(model, ws, input, output) {
            return refused(status);
        }
        let Some(mut search) = ws.search.take() else { return refused(Status::WrongSize) };
        if let Some(motion) = &tasks.motion {
            let answer = self.run_motion((tasks, motion), model, ws, &mut search, (input, output));
            ws.search = Some(search);
            return answer;
        }
        let clearance = 0.0;
        let mut way = Way { plan: self, tasks, model, input, clearance, iterations: 0 };
        way.clearance = way.given(Field::Clearance).map_or(0.0, |x| x[0]);
        ws.scratch.left = way.budget(ws);
        let mut report = RunReport::none();
        let found = way.search(ws, &mut search, &mut report, output);
        let answer = way.answer(ws, &search, &mut report, found, output);
        ws.search = Some(search);
        answer
    }

    /// Sizes, model and numbers of a request with tasks.
    fn check_tasks(
        &self,
        model: &Model<f64>,
        ws: &Workspace<f64>,
        input: &[f64],
        output: &[f64],
    ) -> Result<(), Status> {
        let fits = input.len() == self.given.len() && output.len() == self.want.len();
        if !fits || !ws.serves(self.needs()) {
            return Err(Status::WrongSize);
        }
        if model.meta.fingerprint != self.fingerprint || !ws.belongs_to(model) {
            return Err(Status::WrongModel);
        }
        if all_finite(input) { Ok(()) } else { Err(Status::NonFiniteInput) }
    }
}

impl Tasks {
    /// The bounds of each joint of one freedom: the given ones of all spaces that it is in, else
    /// the model's.
    pub(super) fn bounds<'a>(
        &self,
        given: impl Fn(Field) -> Option<&'a [f64]>,
        search: &mut Search,
    ) -> Result<(), Status> {
        let spaces = [(Field::BoundsY, &self.y), (Field::BoundsU, &self.u)];
        for (field, joints) in spaces {
            let mut rows = given(field).unwrap_or_default().chunks_exact(2).zip(joints);
            // coordinates of free joints have no bounds
            if rows.any(|(of, joint)| joint.is_none() && (of[0] > -NONE || of[1] < NONE)) {
                return Err(Status::BadRequest);
            }
        }
        search.lower.copy_from_slice(&self.lower);
        search.upper.copy_from_slice(&self.upper);
        for &(_, v) in &self.bounded {
            let own = [self.lower[v], self.upper[v]];
            let of_spaces = spaces.iter().filter_map(|(field, joints)| {
                let row = joints.iter().position(|joint| *joint == Some(v))?;
                Some(given(*field).map_or(own, |of| [of[2 * row], of[2 * row + 1]]))
            });
            let both = of_spaces.reduce(|a, b| [a[0].max(b[0]), a[1].min(b[1])]);
            [search.lower[v], search.upper[v]] = both.unwrap_or(own);
        }
        Ok(())
    }
}

impl Way<'_> {
    /// Operations that a search may spend.
    fn budget(&self, ws: &Workspace<f64>) -> u64 {
        let turns = if ws.is_in_turns() { 1 } else { BUDGETS };
        ws.budget(self.plan.searches()).saturating_mul(turns)
    }

    /// Leaves the pose of the answer in the workspace; its status.
    fn search(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        report: &mut RunReport<f64>,
        output: &mut [f64],
    ) -> Result<Status, Status> {
        self.start(ws, search)?;
        let tasks = self.tasks;
        let contradicts = |(_, v): &(usize, usize)| search.lower[*v] > search.upper[*v];
        if tasks.bounded.iter().any(contradicts) {
            search.least.copy_from_slice(&search.guess);
            return Ok(Status::Infeasible);
        }
        for k in 0..tasks.tasks.len() {
            self.target(k)?;
        }
        let all = self.plan.want.slot(Field::Solutions).map(Slot::range);
        let is_long = all.is_some() || self.plan.searches();
        let is_guess = self.given(Field::YGuess).is_some();
        let mut best: Option<Worth> = None;
        let mut least = f64::INFINITY;
        let mut solutions = 0;
        for start in 0..if is_long { MANY_STARTS } else { STARTS } {
            let first = match start {
                0 => {
                    ws.q.copy_from_slice(&search.guess);
                    self.look(ws, search, report)
                }
                _ => self.other_start(ws, search, report, start),
            };
            let first = match first {
                Ok(worth) => worth,
                Err(status) if is_guess && start == 0 => return Err(status),
                Err(_) if ws.scratch.left == 0 => break,
                Err(status @ (Status::MassNotPositive | Status::NonFiniteInput)) => {
                    return Err(status);
                }
                Err(_) => continue,
            };
            let last = self.descend(ws, search, report, first, (&mut best, &mut least), STEPS)?;
            if last.is_none_or(|worth| !self.is_reached(&worth, CLOSE)) {
                if ws.scratch.left == 0 {
                    break;
                }
                continue;
            }
            let Some(range) = &all else { return Ok(Status::Ok) };
            if solutions < MAX_SOLUTIONS && self.add_solution(ws, &mut output[range.clone()]) {
                solutions += 1;
                // the first one is the answer
                if solutions == 1 {
                    search.first.copy_from_slice(&ws.q);
                }
            }
        }
        if solutions > 0 {
            search.best.copy_from_slice(&search.first);
        } else if ws.is_in_turns() && (ws.scratch.left == 0 || best.is_some()) {
            // the last steps are too many for a turn
            ws.scratch.left = 0;
            return Err(Status::NotConverged);
        }
        if best.is_none() {
            let is_closed = least < f64::INFINITY;
            return if is_closed { Ok(Status::Infeasible) } else { Err(Status::Unreachable) };
        }
        self.finish(ws, search, report, (&mut best, &mut least))
    }

    /// The last steps from the best pose, which have as much to spend, and that pose itself.
    fn finish(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        report: &mut RunReport<f64>,
        kept: (&mut Option<Worth>, &mut f64),
    ) -> Result<Status, Status> {
        let mut best = |way: &mut Self, ws: &mut Workspace<f64>, search: &Search| {
            ws.scratch.left = way.budget(ws);
            ws.q.copy_from_slice(&search.best);
            way.look(ws, search, report)
        };
        let mut worth = best(self, ws, search)?;
        if !self.is_reached(&worth, REACHED) {
            self.descend(ws, search, &mut RunReport::none(), worth, kept, LAST_STEPS)?;
            worth = best(self, ws, search)?;
        }
        Ok(if self.is_reached(&worth, REACHED) { Status::Ok } else { Status::NotReached })
    }

    /// Bounds, and the guess within those of the independents.
    fn start(&self, ws: &mut Workspace<f64>, search: &mut Search) -> Result<(), Status> {
        let order = &self.model.order;
        ws.q.copy_from_slice(&self.model.zero);
        if let Some(guess) = self.given(Field::YGuess) {
            guess.iter().zip(&order.qy_q).for_each(|(x, q)| ws.q[*q] = *x);
        }
        self.plan.set_state(self.model, ws, self.input)?;
        self.tasks.bounds(|field| self.given(field), search)?;
        self.bring_inside(ws, search);
        search.guess.copy_from_slice(&ws.q);
        Ok(())
    }

    /// Moves the independents in q to the nearest bound.
    fn bring_inside(&self, ws: &mut Workspace<f64>, search: &Search) {
        for (q, v) in self.tasks.independents.iter().filter_map(|of| of.single) {
            ws.q[q] = ws.q[q].min(search.upper[v]).max(search.lower[v]);
        }
    }

    /// Another start: the best one of some that are evenly spread over the bounds, nearer to the
    /// guess where they cannot be closed.
    fn other_start(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        report: &mut RunReport<f64>,
        start: u32,
    ) -> Result<Worth, Status> {
        let mut best: Option<Worth> = None;
        for draw in 0..DRAWS {
            for part in [1.0, 0.5, 0.2] {
                self.draw(ws, search, (start * DRAWS + draw, part));
                let outcome = self.look(ws, search, report);
                if let Ok(worth) = outcome
                    && best.is_none_or(|best| worth.cost[0] < best.cost[0])
                {
                    best = Some(worth);
                    search.base.copy_from_slice(&ws.q);
                }
                if outcome.is_ok() || ws.scratch.left == 0 {
                    break;
                }
            }
        }
        best.ok_or(Status::Unreachable)?;
        ws.q.copy_from_slice(&search.base);
        self.look(ws, search, report)
    }

    /// A pose into q, a part of the way from the guess to one anywhere within the bounds.
    fn draw(&self, ws: &mut Workspace<f64>, search: &Search, (draw, part): (u32, f64)) {
        ws.q.copy_from_slice(&search.guess);
        for &k in &self.tasks.moves {
            let of = self.tasks.independents[k];
            let cluster = &self.model.clusters[of.cluster];
            let spread = mixed(u64::from(draw) << 32 | k as u64);
            let way = match of.single {
                Some((q, v)) => {
                    let turn = core::f64::consts::TAU * of.unit;
                    let lower = search.lower[v].max(search.guess[q] - turn);
                    let upper = search.upper[v].min(search.guess[q] + turn);
                    (upper - lower).mul_add(spread, lower) - search.guess[q]
                }
                None => (spread - 0.5) * 2.0 * of.unit,
            };
            cluster.dofs[of.j].advance(&mut ws.q[cluster.q..], part * way);
        }
        self.bring_inside(ws, search);
    }

    /// Steps from the pose in the workspace, which `look` found worth `worth`, to the nearest
    /// optimum; the poses that break no bound, or the least, are kept. The last pose's worth, which
    /// stands in the workspace where it is reached.
    fn descend(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &mut Search,
        report: &mut RunReport<f64>,
        mut worth: Worth,
        (best, least): (&mut Option<Worth>, &mut f64),
        steps: u32,
    ) -> Result<Option<Worth>, Status> {
        search.base.copy_from_slice(&ws.q);
        keep(search, &worth, best, least);
        let first = if self.tasks.has_second { FIRST } else { 1.0 };
        let mut radius: f64 = 0.5 * LONGEST;
        let mut damping = 1.0;
        let mut penalty: f64 = 1e-3;
        let mut slow = 0;
        let mut is_settled = !self.tasks.has_second;
        for _ in 0..steps {
            if self.is_reached(&worth, CLOSE) && is_settled {
                return Ok(Some(worth));
            }
            let linear = self.linearise(ws, search, &worth)?;
            let mut accepted = None;
            for _ in 0..TRIES {
                let Some(step) = self.step(ws, search, linear, &worth, (radius, damping)) else {
                    break;
                };
                penalty = penalty.max(2.0 * first * step.multiplier);
                if step.size < 1e-14 {
                    break;
                }
                self.advance(ws, search, linear.n);
                self.iterations += 1;
                let merit =
                    |worth: &Worth| first * worth.cost[0] + worth.cost[1] + penalty * worth.broken;
                match self.look(ws, search, report) {
                    Ok(trial) if merit(&trial) < merit(&worth) => {
                        accepted = Some((trial, step, 1.0 - merit(&trial) / merit(&worth)));
                        break;
                    }
                    _ if ws.scratch.left == 0 => return Ok(None),
                    _ => {
                        radius = step.size.min(radius) * 0.25;
                        damping *= 4.0;
                    }
                }
            }
            let Some((trial, step, gain)) = accepted else {
                // nothing is gained here any more
                let is_reached = self.is_reached(&worth, CLOSE);
                if is_reached {
                    ws.q.copy_from_slice(&search.base);
                    worth = self.look(ws, search, report)?;
                }
                return Ok(Some(worth));
            };
            worth = trial;
            search.base.copy_from_slice(&ws.q);
            keep(search, &worth, best, least);
            radius = (2.0 * radius).min(LONGEST);
            damping = (0.25 * damping).max(1.0);
            is_settled = !self.tasks.has_second || step.size < 1e-9 || gain < 1e-12;
            slow = if gain < LITTLE { slow + 1 } else { 0 };
            let is_patient = steps == LAST_STEPS || self.is_reached(&worth, CLOSE);
            if slow > SLOW && !is_patient || gain < 1e-15 {
                break;
            }
        }
        Ok(Some(worth))
    }

    /// The pose a step from the base, into q.
    fn advance(&self, ws: &mut Workspace<f64>, search: &Search, n: usize) {
        ws.q.copy_from_slice(&search.base);
        for (x, &k) in search.step[..n].iter().zip(&search.moves) {
            let of = self.tasks.independents[k];
            let cluster = &self.model.clusters[of.cluster];
            cluster.dofs[of.j].advance(&mut ws.q[cluster.q..], *x);
        }
        self.bring_inside(ws, search);
    }

    fn is_reached(&self, worth: &Worth, tolerance: f64) -> bool {
        worth.residual <= tolerance && worth.broken == 0.0
    }

    /// Adds the pose in the workspace to the solutions, if it is another one.
    fn add_solution(&self, ws: &Workspace<f64>, solutions: &mut [f64]) -> bool {
        let order = &self.model.order.qy_q;
        for known in solutions.chunks_exact_mut(order.len().max(1)) {
            if known.iter().any(|x| x.is_nan()) {
                known.iter_mut().zip(order).for_each(|(x, q)| *x = ws.q[*q].plus_zero());
                return true;
            }
            if known.iter().zip(order).all(|(x, q)| (x - ws.q[*q]).abs() < APART) {
                return false;
            }
        }
        false
    }

    /// Writes the answer.
    fn answer(
        &self,
        ws: &mut Workspace<f64>,
        search: &Search,
        report: &mut RunReport<f64>,
        found: Result<Status, Status>,
        output: &mut [f64],
    ) -> Answer {
        let plan = self.plan;
        report.iterations = self.iterations;
        let status = match found {
            Ok(status @ (Status::Ok | Status::NotReached)) => {
                match plan.write(self.model, ws, report, self.input, output) {
                    Ok(()) => status,
                    Err(failed) => failed,
                }
            }
            Ok(status) | Err(status) => status,
        };
        let slot = |field| plan.want.slot(field).map(Slot::range);
        if !matches!(status, Status::Ok | Status::NotReached) {
            output.fill(f64::NAN);
            if let Some(range) = slot(Field::Iterations) {
                output[range].fill(f64::from(self.iterations));
            }
            if let (Some(range), Status::Infeasible) = (slot(Field::Binding), status) {
                self.write_binding(&search.least, search, f64::NAN, &mut output[range]);
            }
            return Answer { status, warnings: Warnings::NONE };
        }
        if let Some(range) = slot(Field::TaskResidual) {
            let out = &mut output[range];
            out.fill(f64::NAN);
            for (k, x) in (0..self.tasks.tasks.len()).zip(out.iter_mut()) {
                let target = self.target(k);
                *x =
                    target.map_or(f64::NAN, |of| self.away(ws, k, &of).size(self.tasks.tasks[k].1));
            }
            if let (Some(last), Ok(Some(away))) = (out.last_mut(), self.com_away(ws)) {
                *last = away.norm();
            }
        }
        if let Some(range) = slot(Field::Binding) {
            let sigma_min = if self.clearance > 0.0 { self.sigma_min(ws).1 } else { f64::NAN };
            self.write_binding(&ws.q, search, sigma_min, &mut output[range]);
        }
        let mut warnings = plan.limits(self.model, ws);
        if report.open > plan.query.loop_tolerance.bound() {
            warnings |= Warnings::LOOP_OPEN;
        }
        Answer { status, warnings }
    }

    /// Which bounds are active, or broken.
    fn write_binding(&self, q: &[f64], search: &Search, sigma_min: f64, out: &mut [f64]) {
        out.fill(0.0);
        for &(of, v) in &self.tasks.bounded {
            let [lower, upper] = [&search.lower, &search.upper].map(|of| of[v]);
            let near = |bound: f64| ACTIVE * bound.abs().max(1.0);
            let row = 3 * self.model.order.v_external[v];
            if q[of] >= upper - near(upper) || lower > upper {
                out[row] = 1.0;
            } else if q[of] <= lower + near(lower) {
                out[row] = -1.0;
            }
        }
        // a distance is near where its rate is known to no more
        if sigma_min <= self.clearance + 1e-5 {
            out[3 * self.tasks.lower.len()] = -1.0;
        }
    }
}

/// Keeps the pose at the base where it is the best one that breaks no bound, or breaks them least.
fn keep(search: &mut Search, worth: &Worth, best: &mut Option<Worth>, least: &mut f64) {
    if worth.broken == 0.0 && best.is_none_or(|best| worth.is_better(&best)) {
        *best = Some(*worth);
        search.best.copy_from_slice(&search.base);
    } else if worth.broken > 0.0 && worth.broken < *least {
        *least = worth.broken;
        search.least.copy_from_slice(&search.base);
    }
}

/// A number in [0, 1) from the bits of another (splitmix64 by Steele, Lea and Flood 2014).
fn mixed(x: u64) -> f64 {
    let x = x.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ x >> 31) >> 11) as f64 / (1_u64 << 53) as f64
}
