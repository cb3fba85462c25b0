//! Accelerations under Baumgarte's stabilisation.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, ImplicitForm, Status, Warnings};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::assess::assess;
use crate::stress::harness::case::{At, Case, Cases};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::open_loops::{apart, off_loops, robots};

/// Stabilisation from none to stiff on loops that are open by a millionth.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("Baumgarte", "α = β, 1/s, at loops open by 1e-6");
    let mut values = vec![0.0];
    values.extend(sweep(effort, 0, 9, 3));
    for robot in robots()? {
        for &value in &values {
            let (q, qd) = off_loops(&robot, 1e-6)?;
            let model = &robot.compiled.model;
            let exact = &robot.compiled.exact;
            let tau = vec![0.0; qd.len()];
            let mut qdd = vec![0.0; qd.len()];
            let status = ImplicitForm::new(model).accelerations(
                model,
                &q,
                &qd,
                &tau,
                &[],
                (value, value),
                &mut qdd,
            );
            let wide = |x: &[f64]| x.iter().map(|x| Dd::from(*x)).collect::<Vec<Dd>>();
            let mut reference = vec![Dd::ZERO; qd.len()];
            let gains = (Dd::from(value), Dd::from(value));
            let same = ImplicitForm::new(exact).accelerations(
                exact,
                &wide(&q),
                &wide(&qd),
                &wide(&tau),
                &[],
                gains,
                &mut reference,
            );
            let error = match (status, same) {
                (Status::Ok, Status::Ok) => {
                    Some(apart(&qdd, &reference, &robot.units(Field::Qdd).unwrap_or_default()))
                }
                (Status::Ok, _) => Some(f64::INFINITY),
                _ => None,
            };
            let case = Case {
                status: status.name().to_owned(),
                error,
                assessment: assess(
                    status,
                    Warnings::NONE,
                    error.unwrap_or(f64::INFINITY),
                    qdd.iter().all(|x| x.is_nan()),
                ),
                ..cases.blank(&robot.name, At { value, method: "kkt" }, "q̈")
            };
            cases.all.push(case);
        }
    }
    Ok(())
}
