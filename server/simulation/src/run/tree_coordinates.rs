//! The loop over steps of the methods for comparison, in all tree coordinates.

use sarrus_dynamics::{Field, FieldSet, Model, Planned, Query, Request};

use super::output::{End, Run, Sample};
use super::settings::{Method, Settings, Stops};
use super::setup::Setup;
use super::start::Start;
use crate::error::{Outcome, SimulationError, answered};
use crate::methods::implicit_form::Form;
use crate::motion::elastic;
use crate::motion::energy::Meter;
use crate::motion::rates::Mechanism;

/// Simulates by one of the two methods.
pub(super) fn run(
    setup: &Setup<'_>,
    start: &Start,
    settings: &Settings,
    mut stops: Stops,
    progress: &mut dyn FnMut(f64),
) -> Outcome<Run> {
    let model = &setup.compiled.model;
    let (springs, inputs) = setup.checked()?;
    let what = "springs between motors and joints in a method for comparison";
    let fits = elastic::rotors(model, setup.description).1.is_empty();
    SimulationError::check_setting(what, 1.0, fits, "another method")?;
    let mut form = Form::new(model, setup.description, springs, inputs, settings.rate())?;
    let (mut x, correction) = closed(model, &form.mechanism, start)?;
    let mut meter = Meter::new(model, setup.description)?;
    let n_q = form.mechanism.sizes.n_q;
    let n_v = form.mechanism.sizes.n_v;
    let declared = setup.declared();
    let mut run = Run { correction, ..Run::default() };
    let mut t = 0.0;
    let mut sample = |form: &mut Form<'_>, run: &mut Run, t: f64, x: &[f64]| {
        let state = [&x[..n_q], &x[n_q..n_q + n_v]];
        let mut sample = Sample::new(t, state, &declared, x.get(n_q + n_v));
        // ẋ here measures the drift of the loops and the forces that the springs hold
        let mut rate = vec![0.0; x.len()];
        let _ = form.evaluate(t, x, &mut rate);
        let independents = [sample.y.as_slice(), &sample.yd];
        sample.energy = meter.measure(model, independents, state).unwrap_or_default();
        sample.energy.potential += form.stretched;
        sample.energy.residual = form.form.position_drift();
        run.samples.push(sample);
    };
    sample(&mut form, &mut run, t, &x);
    let end = settings.duration;
    let step = settings.step.unwrap_or(settings.duration);
    let mut sampled = 0_u64;
    while t < end {
        // kinks of forces and samples end a step; the last is a little longer than the others,
        // never a crumb
        let next_sample = settings.sample_after(sampled);
        let limit = stops.after(t, form.mechanism.next_kink(t).min(next_sample));
        let to = if t + 1.000_001 * step >= limit { limit } else { t + step };
        let stepped = form.step(t, to, &mut x, settings.method == Method::Projection);
        run.counts.evaluations += 4;
        if let Err(status) = stepped {
            run.counts.failed += 1;
            run.end = End::Failed(status);
            break;
        }
        (t, run.counts.steps) = (to, run.counts.steps + 1);
        progress(t);
        if settings.every.is_none() || t >= next_sample {
            sampled += 1;
            sample(&mut form, &mut run, t, &x);
        }
    }
    if run.last().is_none_or(|last| last.time < t) {
        sample(&mut form, &mut run, t, &x);
    }
    run.time = t;
    run.independents = model.independent_names().to_vec();
    Ok(run)
}

/// The closed state of a start.
fn closed(
    model: &Model<f64>,
    mechanism: &Mechanism,
    start: &Start,
) -> Outcome<(Vec<f64>, [f64; 2])> {
    let checked = start.check(model)?;
    use Field::*;
    let given = FieldSet::of(&[Y, Yd, QGuess]);
    let query = Query::new(Request::Kinematics, given, FieldSet::of(&[Q, Qd]));
    let mut planned = Planned::new(model, &query)?;
    planned.give(Y, &checked.y);
    planned.give(Yd, &checked.yd);
    planned.give(QGuess, &checked.guess);
    answered(planned.run(model).status)
        .map_err(|status| SimulationError::Start { status, detail: 0.0 })?;
    let mut x = [planned.get(Q), planned.get(Qd)].concat();
    x.extend(mechanism.works().then_some(0.0));
    Ok((x, checked.correction))
}
