//! Poses of a search: closed, with the errors of the tasks and the bounds that they break.

use nalgebra::Vector3;
use sarrus_proto::{Field, Slot, Status, TaskParts};

use crate::algorithms::{self, Links};
use crate::closure::dependents_range;
use crate::mechanism::turn;
use crate::model::Model;
use crate::plan::Plan;
use crate::plan::run::{Pass, RunReport};
use crate::plan::task::Tasks;
use crate::plan::task::errors::{Away, Target};
use crate::workspace::{Search, Workspace};

/// Work of a pose for each body, beside closures, in their operations.
const BODY: u64 = 150;

/// Weight of preferred coordinates beside tasks of the second level.
const LAST: f64 = 1e-8;

/// Errors and broken bounds of a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Worth {
    /// Half the sum of the weighted squares of the errors of each level.
    pub(super) cost: [f64; 2],
    /// The largest error of a task.
    pub(super) residual: f64,
    /// Sum of the distances beyond bounds.
    pub(super) broken: f64,
    pub(super) sigma_min: f64,
}

impl Worth {
    /// True where it is better by more than rounding.
    pub(super) fn is_better(&self, other: &Worth) -> bool {
        let [own, second] = self.cost;
        let [of_other, second_of_other] = other.cost;
        own < of_other * (1.0 - 1e-9) && own < of_other - 1e-24
            || own <= of_other && second < second_of_other
    }
}

/// A search on its model.
pub(super) struct Way<'a> {
    pub(super) plan: &'a Plan,
    pub(super) tasks: &'a Tasks,
    pub(super) model: &'a Model<f64>,
    pub(super) input: &'a [f64],
    /// 0 without one.
    pub(super) clearance: f64,
    pub(super) iterations: u32,
}

impl<'a> Way<'a> {
    pub(super) fn given(&self, field: Field) -> Option<&'a [f64]> {
        self.plan.given.slot(field).map(|slot: &Slot| &self.input[slot.range()])
    }

    /// The targets of the tasks.
    pub(super) fn target(&self, k: usize) -> Result<Target, Status> {
        let (_, parts) = self.tasks.tasks[k];
        let numbers = self.given(Field::TaskTarget).unwrap_or_default();
        let n = numbers.len() / self.tasks.tasks.len().max(1);
        Target::of(parts, &numbers[k * n..(k + 1) * n])
    }

    /// Closes the loops at the independents that stand in q, from the same start as any request;
    /// poses of the bodies, errors and broken bounds.
    pub(super) fn look(
        &mut self,
        ws: &mut Workspace<f64>,
        search: &Search,
        report: &mut RunReport<f64>,
    ) -> Result<Worth, Status> {
        let Way { plan, model, input, .. } = *self;
        let scope = &plan.needed.scope;
        *report = RunReport::none();
        if !ws.scratch.spend(BODY * model.bodies.len() as u64) {
            return Err(Status::NotConverged);
        }
        match self.given(Field::QGuess) {
            Some(guess) => guess.iter().zip(&model.order.q).for_each(|(x, q)| ws.start[*q] = *x),
            None => ws.start.copy_from_slice(&model.zero),
        }
        for &c in &scope.closed {
            plan.close_cluster(c, Pass { model, ws, input, report })?;
            report.closed += 1;
        }
        turn(&scope.free, &ws.q, &mut ws.cos_sin);
        algorithms::joint_poses(model, &scope.posed, &ws.q, &ws.cos_sin, &mut ws.motion);
        algorithms::world_poses(model, &plan.frame_bodies, &ws.motion, &mut ws.world);

        let mut worth = Worth { cost: [0.0; 2], residual: 0.0, broken: 0.0, sigma_min: 1.0 };
        for k in 0..self.tasks.tasks.len() {
            let (_, parts) = self.tasks.tasks[k];
            let target = self.target(k)?;
            let away = self.away(ws, k, &target);
            worth.residual = worth.residual.max(away.size(parts));
            let level = usize::from(parts.contains(TaskParts::SECOND));
            for (_, x) in parts_of(parts, &away) {
                worth.cost[level] += 0.5 * (*x * target.weight).norm_squared();
            }
        }
        if let Some(away) = self.com_away(ws)? {
            worth.residual = worth.residual.max(away.norm());
            worth.cost[0] += 0.5 * away.norm_squared();
        }
        self.each_preferred(ws, |_, weight, away| worth.cost[1] += 0.5 * weight * away * away);
        for &(q, v) in &self.tasks.bounded {
            let below = search.lower[v] - ws.q[q];
            let above = ws.q[q] - search.upper[v];
            worth.broken += below.max(above).max(0.0);
        }
        if self.clearance > 0.0 {
            worth.sigma_min = self.sigma_min(ws).1;
            worth.broken += (self.clearance - worth.sigma_min).max(0.0);
        }
        match worth.cost.iter().all(|x| x.is_finite()) {
            true => Ok(worth),
            false => Err(Status::NonFiniteInput),
        }
    }

    pub(super) fn away(&self, ws: &Workspace<f64>, k: usize, target: &Target) -> Away {
        let (link, _) = self.tasks.tasks[k];
        let view = self.plan.view(self.model);
        target.away(&view.pose(&self.model.frames[link], &ws.world))
    }

    /// The way of the centre of mass to its target, if it has one.
    ///
    /// # Errors
    /// [`Status::MassNotPositive`] for a robot without mass.
    pub(super) fn com_away(&self, ws: &Workspace<f64>) -> Result<Option<Vector3<f64>>, Status> {
        let Some(target) = self.given(Field::ComTarget) else { return Ok(None) };
        let links = Links::of(self.model, &ws.world, &ws.motion);
        match links.mass > 0.0 {
            true => Ok(Some(Vector3::from_column_slice(target) - links.com())),
            false => Err(Status::MassNotPositive),
        }
    }

    /// Calls `each(independent, weight, way to the preferred coordinate)` of single joints.
    pub(super) fn each_preferred(
        &self,
        ws: &Workspace<f64>,
        mut each: impl FnMut(usize, f64, f64),
    ) {
        let Some(preferred) = self.given(Field::YPreferred) else { return };
        let is_last = self.tasks.tasks.iter().any(|(_, parts)| parts.contains(TaskParts::SECOND));
        let weight = if is_last { LAST } else { 1.0 };
        for (k, of) in self.tasks.independents.iter().enumerate() {
            let Some((q, v)) = of.single else { continue };
            let row = self.tasks.y.iter().position(|other| *other == Some(v));
            if let Some(y) = row.and_then(|row| preferred.get(row)) {
                each(k, weight / (of.unit * of.unit), y - ws.q[q]);
            }
        }
    }

    /// The cluster that is nearest to a singularity, and how near.
    pub(super) fn sigma_min(&self, ws: &mut Workspace<f64>) -> (Option<usize>, f64) {
        let mut least = (None, 1.0);
        for &c in &self.model.closed_clusters {
            let of = sigma_of(self.model, c, ws);
            if least.0.is_none() || of < least.1 {
                least = (Some(c), of);
            }
        }
        least
    }
}

/// The distance of a closed cluster to singularity.
pub(super) fn sigma_of(model: &Model<f64>, c: usize, ws: &mut Workspace<f64>) -> f64 {
    let cluster = &model.clusters[c];
    ws.constraint_jacobian(cluster, model.bodies_of(cluster));
    dependents_range(cluster, &mut ws.scratch).1
}

/// The parts of a task with their errors, in the order of their rows.
pub(super) fn parts_of(
    parts: TaskParts,
    away: &Away,
) -> impl Iterator<Item = (TaskParts, &Vector3<f64>)> {
    let all = [
        (TaskParts::POSITION, &away.way),
        (TaskParts::ORIENTATION, &away.turn),
        (TaskParts::AXIS, &away.tilt),
    ];
    all.into_iter().filter(move |(part, _)| parts.contains(*part))
}
