//! The errors of a case over its states, against references in double-double.

use sarrus_dynamics::{Field, FieldSet, Plan, Query, Request, Workspace};
use sarrus_report::Outcome;
use sarrus_report::reference::Reference;
use sarrus_report::robots::{Question, Start};

use crate::cases::Case;

/// The error of a case over all its states.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Errors {
    /// Largest and median error by size.
    pub(crate) worst: f64,
    pub(crate) median: f64,
    /// Forward dynamics: the largest ‖M_y ÿ + C_y − τ_y‖ / (‖M_y‖‖ÿ‖ + ‖C_y‖ + ‖τ_y‖), M_y and C_y
    /// in double-double.
    pub(crate) backward: Option<f64>,
    /// Newton steps of all blocks together: mean and largest.
    pub(crate) newton: Option<(f64, f64)>,
}

/// Measures a case on every state; a state without an answer is an error. `kept` holds the exact
/// answers of the case before: those to forward dynamics serve every method, those from a warm
/// start the cold one.
pub(crate) fn measure(case: &mut Case<'_>, kept: &mut Kept) -> Outcome<Errors> {
    let key = (
        case.robot.name,
        case.variant.closures,
        [case.question, Question::ForwardDynamics][case.question.is_forward() as usize],
    );
    if !kept.iter().any(|(of, _)| *of == key) {
        kept.retain(|((robot, closures, _), _)| (*robot, *closures) == (key.0, key.1));
        kept.push((key, Reference::new(case.robot, case.place, case.question, case.start)?));
    }
    let reference = kept
        .iter_mut()
        .find(|(of, _)| *of == key)
        .map(|(_, reference)| reference)
        .ok_or("no exact answers")?;
    let mut sizes = Vec::new();
    let mut backward: Option<f64> = None;
    for state in 0..case.inputs.len() {
        reference.compute(case.robot, state)?;
        case.answer(state)?;
        sizes.push(reference.error(case.plan.want(), state, &case.output));
        if case.question.is_forward() {
            let error = reference.backward_error(state, &case.output);
            backward = Some(backward.map_or(error, |worst| worst.max(error)));
        }
    }
    sizes.sort_unstable_by(f64::total_cmp);
    let worst = sizes.last().copied().unwrap_or(f64::NAN);
    let newton = if case.start == Start::None { None } else { Some(newton_steps(case)?) };
    Ok(Errors { worst, median: sizes[sizes.len() / 2], backward, newton })
}

/// Exact answers that may serve again: robot, how its loops are closed, question.
pub(crate) type Kept = Vec<((&'static str, &'static str, Question), Reference)>;

/// Mean and largest count of Newton steps of one call.
fn newton_steps(case: &Case<'_>) -> Outcome<(f64, f64)> {
    let model = &case.variant.compiled.model;
    let given = case.plan.query().given.0 & FieldSet::of(&[Field::Y, Field::QGuess]).0;
    let plan = Plan::new(
        model,
        &Query::new(Request::Kinematics, FieldSet(given), FieldSet::of(&[Field::Iterations])),
    )?;
    let mut workspace = Workspace::new(model);
    let mut sum = 0.0;
    let mut most = 0.0;
    for input in &case.inputs {
        let mut packed = vec![0.0; plan.given().len()];
        for slot in plan.given().slots() {
            if let Some(from) = case.plan.given().slot(slot.field) {
                packed[slot.range()].copy_from_slice(&input[from.range()]);
            }
        }
        let mut steps = [0.0];
        // a failed answer is NaN
        let _ = plan.run(model, &mut workspace, &packed, &mut steps);
        sum += steps[0];
        most = f64::max(most, steps[0]);
    }
    Ok((sum / case.inputs.len() as f64, most))
}
