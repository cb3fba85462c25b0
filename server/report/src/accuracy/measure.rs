//! Errors and residuals of every method on every state, then times in batches that take turns.

use std::time::Duration;

use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, ImplicitForm, Status};

use super::methods::Method;
use crate::Outcome;
use crate::measure::timing::{Timed, interleaved};
use crate::reference::{References, layout, worse};
use crate::robots::{Question, Robot};

/// Time and error of a method with one setting.
#[derive(Clone, Debug)]
pub(super) struct Measured {
    pub(super) question: Question,
    pub(super) series: String,
    pub(super) label: String,
    pub(super) default: bool,
    /// Median of a call.
    pub(super) ns: f64,
    /// The worst of all states; NaN where some state has no answer.
    pub(super) error: f64,
    /// The largest |φ| of q, where q was question.
    pub(super) residual: Option<f64>,
    /// Why there is no answer.
    pub(super) fault: Option<String>,
}

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

/// Measures all methods of one robot; `shown` learns the share that is done.
pub(super) fn measure(
    robot: &Robot,
    methods: &mut [Method],
    references: &mut References<'_>,
    rounds: Duration,
    shown: impl Fn(f64),
) -> Outcome<Vec<Measured>> {
    let mut measured = Vec::new();
    for method in methods.iter_mut() {
        measured.push(errors(robot, method, references)?);
    }
    // a method that does not answer is not timed
    let fine = |of: &Measured| of.fault.is_none();
    let timed = methods.iter_mut().zip(&measured).filter(|(_, of)| fine(of));
    let mut runs: Vec<&mut Method> = timed.map(|(method, _)| method).collect();
    let times = interleaved(&mut runs, rounds, shown)?;
    for (of, samples) in measured.iter_mut().filter(|of| fine(of)).zip(times) {
        of.ns = samples.median();
    }
    Ok(measured)
}

fn errors(
    robot: &Robot,
    method: &mut Method,
    references: &mut References<'_>,
) -> Outcome<Measured> {
    let Method { question, place, start, .. } = *method;
    let want = layout(robot, question);
    let exact = &robot.variants[place].compiled.exact;
    let mut form = (question == Question::State).then(|| ImplicitForm::new(exact));
    let mut worst = 0.0_f64;
    let mut residual = 0.0_f64;
    let mut fault = None;
    for state in 0..method.runner.states() {
        let status = method.runner.call(state);
        if status != Status::Ok {
            fault = Some(format!("{status} at state {state}"));
            break;
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
    let nan = |x: f64| if fault.is_some() { f64::NAN } else { x };
    Ok(Measured {
        question,
        series: method.series.clone(),
        label: method.label.clone(),
        default: method.default,
        ns: f64::NAN,
        error: nan(worst),
        residual: form.is_some().then(|| nan(residual)),
        fault,
    })
}
