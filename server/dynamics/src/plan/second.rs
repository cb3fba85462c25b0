//! Second derivatives along a direction v: central differences of the analytic first ones in
//! double-double, (D(x + h v) − D(x − h v)) / 2 h. With 32 digits, h² D‴ and the roundings over h
//! both stay far below the last digit of a double.

use sarrus_proto::{Answer, Field, FieldSet, Query, QueryError, Slot, Status, Warnings};

use crate::model::{Method, Model};
use crate::plan::Plan;
use crate::scalar::{Dd, Real, all_finite};
use crate::workspace::{Again, Workspace};

/// Largest part of a step, in radians or metres, m/s or rad/s, N or N m.
const STEP: f64 = 1e-10;
/// Most independents: a workspace for any plan has room for the derivatives on both sides.
const MOST: usize = 64;

/// The plan of the first derivatives, of all joints; `None` where no second ones are wanted.
pub(super) fn first<C: Real>(
    model: &Model<C>,
    query: &Query,
    method: Method,
) -> Result<Option<Plan>, QueryError> {
    let want: &[Field] = match () {
        () if query.want.has(Field::D2TauYV) => &[Field::DtauYDy, Field::DtauYDyd],
        () if query.want.has(Field::D2YddV) => &[Field::DyddDy, Field::DyddDyd, Field::DyddDtauU],
        () => return Ok(None),
    };
    if model.sizes().n_vy > MOST {
        let what = "independents with second derivatives";
        return Err(QueryError::TooMany { what, limit: MOST });
    }
    let of_second = FieldSet::of(&[Field::Direction, Field::Multipliers]);
    let given = query.given.without(of_second).with(Field::Yd);
    let query = Query { given, want: FieldSet::of(want), n_joint_runs: 0, n_frames: 0, ..*query };
    Plan::with_method(model, &query, method).map(Some)
}

impl Plan {
    /// Writes the second derivatives behind the answer to the rest. Allocates never.
    #[inline(never)]
    pub(super) fn add_second(
        &self,
        ws: &mut Workspace<f64>,
        input: &[f64],
        output: &mut [f64],
        answer: Answer,
    ) -> Answer {
        let mut status = Status::WrongSize;
        if let (Some(first), Some(probe)) = (&self.first, &mut ws.probe) {
            status = self.differences(first, &mut probe.exact, &ws.q, input, output);
        }
        if status == Status::Ok {
            return answer;
        }
        output.fill(f64::NAN);
        Answer { status, warnings: Warnings::NONE }
    }

    fn differences(
        &self,
        first: &Plan,
        probe: &mut Again<Dd>,
        q: &[f64],
        input: &[f64],
        output: &mut [f64],
    ) -> Status {
        let part = |field| self.given.slot(field).map(|slot: &Slot| &input[slot.range()]);
        let Some(direction) = part(Field::Direction) else { return Status::WrongSize };
        let n = probe.model.sizes().n_vy;
        let len = first.want.len();
        if probe.input.len() < first.given.len() || probe.output.len() < 2 * len {
            return Status::WrongSize;
        }
        let largest = direction.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let step = STEP / if largest > 0.0 { largest } else { 1.0 };
        if !step.is_normal() {
            return Status::NonFiniteInput;
        }
        for (at, step) in [(0, step), (len, -step)] {
            for slot in first.given.slots() {
                let along = match slot.field {
                    Field::Yd => &direction[n..2 * n],
                    Field::TauU => &direction[2 * n..],
                    _ => &[],
                };
                let own = part(slot.field).unwrap_or_default().iter().chain(&[0.0; MOST]);
                for (k, (to, x)) in probe.input[slot.range()].iter_mut().zip(own).enumerate() {
                    let change = along.get(k).map_or(Dd::ZERO, |v| Dd::from(*v) * Dd::from(step));
                    *to = Dd::from(*x) + change;
                }
            }
            probe.resume::<f64>(&[], q);
            let given = &mut probe.input[..first.given.len()];
            displace(&probe.model, &mut probe.workspace, first, &direction[..n], step, given);
            let found = &mut probe.output[at..at + len];
            let answer = first.run(&probe.model, &mut probe.workspace, given, found);
            if answer.status != Status::Ok {
                return answer.status;
            }
        }
        let order = &probe.model.order.vy_external;
        let (ahead, behind) = probe.output.split_at(len);
        let entry = |slot: &Slot, row: usize, column: usize| {
            let at = slot.offset + row * slot.columns + column;
            (ahead[at] - behind[at]) / Dd::from(2.0 * step)
        };
        let columns = || {
            let blocks = first.want.slots().iter();
            blocks.flat_map(|slot| (0..slot.columns).map(move |column| (slot, column)))
        };
        let Some(own) = self.want.slots().iter().find(|slot| slot.field.is_second()) else {
            return Status::WrongSize;
        };
        let out = &mut output[own.range()];
        match part(Field::Multipliers) {
            Some(mu) => out.iter_mut().zip(columns()).for_each(|(x, (slot, column))| {
                let rows = mu.iter().enumerate();
                let sum = rows.fold(Dd::ZERO, |sum, (row, mu)| {
                    entry(slot, row, column).mul_add(Dd::from(*mu), sum)
                });
                *x = sum.to_f64().plus_zero();
            }),
            None => {
                for (out, vy) in out.chunks_exact_mut(own.columns).zip(&self.needed.vy) {
                    for (x, (slot, column)) in out.iter_mut().zip(columns()) {
                        *x = entry(slot, order[*vy], column).to_f64().plus_zero();
                    }
                }
            }
        }
        if all_finite(out) { Status::Ok } else { Status::NonFiniteInput }
    }
}

/// y ← y ⊕ step v in the given numbers of a plan.
fn displace(
    model: &Model<Dd>,
    ws: &mut Workspace<Dd>,
    plan: &Plan,
    v: &[f64],
    step: f64,
    given: &mut [Dd],
) {
    let Some(slot) = plan.given.slot(Field::Y) else { return };
    let y = &mut given[slot.range()];
    y.iter().zip(&model.order.qy_q).for_each(|(x, q)| ws.q[*q] = *x);
    for cluster in &model.clusters {
        for (k, j) in cluster.independents().zip(&cluster.independent) {
            let along = Dd::from(v[model.order.vy_external[k]]) * Dd::from(step);
            cluster.dofs[*j].advance(&mut ws.q[cluster.q..], along);
        }
    }
    y.iter_mut().zip(&model.order.qy_q).for_each(|(x, q)| *x = ws.q[*q]);
}
