//! The loops as constraints of tree coordinates, for comparison: drift held down by Baumgarte's terms or taken off by projection.

use sarrus_dynamics::{Field, FieldSet, ImplicitForm, Model, Plan, Request, Status, Wanted, Workspace};

use super::problems::Problem;

/// Baumgarte's α and β, in reciprocals of the step.
const STABILISATION: f64 = 0.2;

/// How the drift is held.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Baumgarte,
    Projection,
}

/// A problem that is made of nothing but a robot.
pub(super) struct Implicit;

impl Implicit {
    /// Springs, inputs and quaternions are left to the simulator.
    pub(super) fn of(problem: &Problem) -> Option<Implicit> {
        let sizes = problem.loaded.compiled.model.sizes();
        (problem.springs.is_empty() && problem.inputs.is_empty() && sizes.n_q == sizes.n_v).then_some(Implicit)
    }

    pub(super) fn kinds(&self) -> [Kind; 2] {
        [Kind::Baumgarte, Kind::Projection]
    }
}

impl Kind {
    pub(super) fn name(self) -> &'static str {
        match self {
            Kind::Baumgarte => "implicit form, Baumgarte, rk4",
            Kind::Projection => "implicit form, projection, rk4",
        }
    }

    /// y and ẏ at the end, by the classical method of Runge and Kutta on q and q̇.
    pub(super) fn run(self, problem: &Problem, step: f64) -> Result<[Vec<f64>; 2], Status> {
        let model = &problem.loaded.compiled.model;
        let n = model.sizes().n_v;
        let mut form = ImplicitForm::new(model);
        let rate = match self {
            Kind::Baumgarte => STABILISATION / step,
            Kind::Projection => 0.0,
        };
        let (mut q, mut qd) = closed(model, &problem.y, &problem.yd)?;
        let tau = vec![0.0; n];
        let steps = (problem.duration / step).round() as usize;
        let at = |x: &[f64], h: f64, k: &[f64]| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| h.mul_add(*k, *x)).collect() };
        for _ in 0..steps {
            let mut accelerations = |q: &[f64], qd: &[f64]| {
                let mut qdd = vec![0.0; n];
                match form.accelerations(model, q, qd, &tau, &[], (rate, rate), &mut qdd) {
                    Status::Ok => Ok(qdd),
                    status => Err(status),
                }
            };
            let a1 = accelerations(&q, &qd)?;
            let v2 = at(&qd, 0.5 * step, &a1);
            let a2 = accelerations(&at(&q, 0.5 * step, &qd), &v2)?;
            let v3 = at(&qd, 0.5 * step, &a2);
            let a3 = accelerations(&at(&q, 0.5 * step, &v2), &v3)?;
            let v4 = at(&qd, step, &a3);
            let a4 = accelerations(&at(&q, step, &v3), &v4)?;
            for i in 0..n {
                q[i] += step / 6.0 * (qd[i] + 2.0 * (v2[i] + v3[i]) + v4[i]);
                qd[i] += step / 6.0 * (a1[i] + 2.0 * (a2[i] + a3[i]) + a4[i]);
            }
            if matches!(self, Kind::Projection) {
                match form.project(model, &mut q, &mut qd) {
                    Status::Ok => {}
                    status => return Err(status),
                }
            }
        }
        let of = |x: &[f64]| {
            let place = |name: &String| model.tree_names().iter().position(|of| of == name);
            model.independent_names().iter().filter_map(|name| place(name).map(|k| x[k])).collect()
        };
        Ok([of(&q), of(&qd)])
    }
}

/// The tree state of independents.
fn closed(model: &Model<f64>, y: &[f64], yd: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Status> {
    let wanted = Wanted::new(Request::Kinematics, FieldSet::of(&[Field::Y, Field::Yd]), FieldSet::of(&[Field::Q, Field::Qd]));
    let plan = Plan::new(model, &wanted).map_err(|_| Status::BadRequest)?;
    let mut numbers = vec![0.0; plan.want().len()];
    let input: Vec<f64> = y.iter().chain(yd).copied().collect();
    let answer = plan.run(model, &mut Workspace::new(model), &input, &mut numbers);
    let (q, qd) = numbers.split_at(model.sizes().n_q);
    if answer.status == Status::Ok { Ok((q.to_vec(), qd.to_vec())) } else { Err(answer.status) }
}
