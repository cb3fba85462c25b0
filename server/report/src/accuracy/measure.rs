//! Measures errors and residuals of every method on every state, then times in alternating batches.

use std::time::Duration;

use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, ImplicitForm, Status};

use super::methods::Method;
use crate::Outcome;
use crate::measure::timing::{Timed, interleaved};
use crate::reference::{References, layout, worse};
use crate::robots::{Question, Robot};

impl Timed for &mut Method {
    fn name(&self) -> String {
        format!("{}, {}", self.series, self.label)
    }

    fn states(&self) -> usize {
        self.runner.states()
    }

    #[inline]
    fn call(&mut self, state: usize) -> Status {
        self.runner.call(state)
    }
}

/// Measures all methods of one robot; `shown` gets the fraction done.
pub(super) fn measure(
    robot: &Robot,
    methods: &mut [Method],
    references: &mut References<'_>,
    rounds: Duration,
    shown: impl Fn(f64),
) -> Outcome {
    for method in methods.iter_mut() {
        errors(robot, method, references)?;
    }
    // a method without an answer is not timed
    let mut fine: Vec<&mut Method> =
        methods.iter_mut().filter(|method| method.fault.is_none()).collect();
    let times = interleaved(&mut fine, rounds, shown)?;
    for (method, samples) in fine.into_iter().zip(times) {
        method.ns = samples.median();
    }
    Ok(())
}

fn errors(robot: &Robot, method: &mut Method, references: &mut References<'_>) -> Outcome {
    let Method { question, place, start, .. } = *method;
    let want = layout(robot, question);
    let exact = &robot.variants[place].compiled.exact;
    let mut form = (question == Question::State).then(|| ImplicitForm::new(exact));
    let mut worst = 0.0_f64;
    let mut residual = 0.0_f64;
    for state in 0..method.runner.states() {
        let status = method.runner.call(state);
        if status != Status::Ok {
            method.residual = form.is_some().then_some(f64::NAN);
            method.fault = Some(format!("{status} at state {state}"));
            return Ok(());
        }
        let answer = method.runner.answer();
        let error = references.error((question, place, start), &want, state, &answer)?;
        worst = worse(worst, error);
        if let (Some(form), Some(slot)) = (&mut form, want.slot(Field::Q)) {
            let q: Vec<Dd> = answer[slot.range()].iter().map(|x| Dd::from(*x)).collect();
            form.measure_drift(exact, &q, &vec![Dd::from(0.0); exact.sizes().n_v]);
            residual = residual.max(form.position_drift().hi());
        }
    }
    method.error = worst;
    method.residual = form.map(|_| residual);
    Ok(())
}
