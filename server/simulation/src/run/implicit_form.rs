//! For comparison: all tree coordinates with the loops as constraints, by Runge and Kutta's method
//! with a fixed step.
//!
//! Baumgarte's stabilisation pulls the loops together while they drift apart; projection closes
//! them after each step. Springs between links are stretched as at the closed pose with the same
//! independents.

use sarrus_dynamics::{Field, FieldSet, ImplicitForm, Model, Query, Request, Status, Workspace};

use crate::error::SimulationError;
use crate::motion::energy::Meter;
use crate::motion::rates::Mechanism;
use crate::planned::Planned;
use crate::run::Setup;
use crate::run::output::{End, Run, Sample};
use crate::run::settings::{Method, Settings};
use crate::run::start::Start;

/// The right-hand side in x = [q; q̇; work].
struct Form<'a> {
    model: &'a Model<f64>,
    mechanism: Mechanism,
    form: ImplicitForm<f64>,
    /// Frames of the links that springs hang on.
    frames: Option<Planned<f64>>,
    workspace: Workspace<f64>,
    tau_q: Vec<f64>,
    wrenches: Vec<f64>,
    stretched: f64,
    rate: f64,
}

/// Simulates by one of the two methods.
pub(crate) fn run(
    setup: &Setup<'_>,
    start: &Start,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Run, SimulationError> {
    let model = &setup.compiled.model;
    let mut form = Form::new(setup, settings.rate())?;
    let (mut x, correction) = form.start(start)?;
    let mut meter = Meter::new(model, setup.description, &form.mechanism.q)?;
    let (n_q, n_v, declared) =
        (form.mechanism.sizes.n_q, form.mechanism.sizes.n_v, setup.declared());
    let mut run = Run::new(correction);
    let mut t = 0.0;
    let mut sample = |form: &mut Form<'_>, run: &mut Run, t: f64, x: &[f64]| {
        let pick = |from: &[f64], places: &[usize]| {
            places.iter().map(|place| from[*place]).collect::<Vec<f64>>()
        };
        let (q, qd) = (&x[..n_q], &x[n_q..n_q + n_v]);
        let (y, yd) = (pick(q, &declared.0), pick(qd, &declared.1));
        // ẋ here says how far the loops have drifted and what the springs hold
        let mut rate = vec![0.0; x.len()];
        form.evaluate(t, x, &mut rate);
        let mut energy = meter.measure(model, [&y, &yd], [q, qd]).unwrap_or_default();
        energy.potential += form.stretched;
        energy.residual = form.form.position_drift();
        run.samples.push(Sample {
            time: t,
            y,
            yd,
            q: q.to_vec(),
            qd: qd.to_vec(),
            energy,
            work: x.get(n_q + n_v).copied().unwrap_or(0.0),
        });
    };
    sample(&mut form, &mut run, t, &x);
    let (end, step) = (settings.duration, settings.step.unwrap_or(settings.duration));
    let mut sampled = 0_u64;
    while t < end {
        let next_sample =
            settings.every.map_or(end, |every| ((sampled + 1) as f64 * every).min(end));
        let next_sample = if next_sample > end - 1e-9 * end { end } else { next_sample };
        // kinks of forces and samples end a step; the last is a little longer than the others,
        // never a crumb
        let kinks = form
            .mechanism
            .inputs
            .iter()
            .flat_map(|input| input.kinks())
            .copied()
            .filter(|kink| *kink > t);
        let limit = kinks.fold(next_sample, f64::min);
        let to = if t + 1.000_001 * step >= limit { limit } else { t + step };
        let status = form.step(t, to, &mut x, settings.method);
        run.counts.evaluations += 4;
        if status != Status::Ok {
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

impl<'a> Form<'a> {
    fn new(setup: &Setup<'a>, rate: f64) -> Result<Form<'a>, SimulationError> {
        let model = &setup.compiled.model;
        let (springs, inputs) = setup.checked()?;
        let mechanism = Mechanism::new(model, setup.description, springs, inputs);
        let links = mechanism.springs.links.clone();
        let frames = if links.is_empty() {
            None
        } else {
            let (given, want) = (
                FieldSet::of(&[Field::Q, Field::Qd]),
                FieldSet::of(&[Field::FramePose, Field::FrameTwist]),
            );
            Some(Planned::new(
                model,
                &Query::new(Request::Kinematics, given, want).with_frames(&links),
            )?)
        };
        Ok(Form {
            form: ImplicitForm::with_wrenches(model, &links),
            workspace: Workspace::for_plans(model, frames.iter().map(Planned::plan)),
            frames,
            tau_q: vec![0.0; mechanism.sizes.n_v],
            wrenches: vec![0.0; 6 * links.len()],
            stretched: 0.0,
            mechanism,
            model,
            rate,
        })
    }

    /// The closed state of a start.
    fn start(&self, start: &Start) -> Result<(Vec<f64>, [f64; 2]), SimulationError> {
        let checked = start.check(self.model)?;
        let guess: &[Field] = if checked.guess.is_some() { &[Field::QGuess] } else { &[] };
        let given =
            guess.iter().fold(FieldSet::of(&[Field::Y, Field::Yd]), |set, field| set.with(*field));
        let mut asked = Planned::new(
            self.model,
            &Query::new(Request::Kinematics, given, FieldSet::of(&[Field::Q, Field::Qd])),
        )?;
        asked.give(Field::Y, &checked.y);
        asked.give(Field::Yd, &checked.yd);
        checked.guess.iter().for_each(|guess| asked.give(Field::QGuess, guess));
        let status =
            asked.run(self.model, &mut Workspace::for_plans(self.model, [asked.plan()])).status;
        if status != Status::Ok {
            return Err(SimulationError::Start { status, detail: 0.0 });
        }
        let mut x = [asked.get(Field::Q), asked.get(Field::Qd)].concat();
        x.extend(self.mechanism.works().then_some(0.0));
        Ok((x, checked.correction))
    }

    /// ẋ at t and x.
    fn evaluate(&mut self, t: f64, x: &[f64], rate: &mut [f64]) -> Status {
        let (n_q, n_v) = (self.mechanism.sizes.n_q, self.mechanism.sizes.n_v);
        if !x.iter().all(|x| x.is_finite()) {
            return Status::NonFiniteInput;
        }
        let mut unit = x[..n_q].to_vec();
        self.mechanism.q.normalise(&mut unit);
        let qd = &x[n_q..n_q + n_v];
        let mut loss = 0.0;
        if let Some(frames) = &mut self.frames {
            frames.give(Field::Q, &unit);
            frames.give(Field::Qd, qd);
            let status = frames.run(self.model, &mut self.workspace).status;
            if status != Status::Ok {
                return status;
            }
            let (poses, twists) = (frames.get(Field::FramePose), frames.get(Field::FrameTwist));
            let effect = self.mechanism.springs.wrenches(poses, twists, &mut self.wrenches);
            (self.stretched, loss) = (effect.energy, effect.loss);
        }
        self.tau_q.fill(0.0);
        self.mechanism.inputs.iter().for_each(|input| input.add(t, &unit, qd, &mut self.tau_q));
        self.mechanism.q.rate(&x[..n_q], &unit, qd, &mut rate[..n_q]);
        let rates = (self.rate, self.rate);
        let status = self.form.accelerations(
            self.model,
            &unit,
            qd,
            &self.tau_q,
            &self.wrenches,
            rates,
            &mut rate[n_q..n_q + n_v],
        );
        if let Some(work) = rate.get_mut(n_q + n_v) {
            *work = self.mechanism.power(qd, &self.tau_q, loss);
        }
        status
    }

    /// One step; x is that before it where it has no answer.
    fn step(&mut self, t: f64, to: f64, x: &mut Vec<f64>, method: Method) -> Status {
        let (n_q, n_v, n, h) =
            (self.mechanism.sizes.n_q, self.mechanism.sizes.n_v, x.len(), to - t);
        let mut stages = [vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]];
        for (k, part) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            let at: Vec<f64> = (0..n)
                .map(|i| x[i] + if k > 0 { part * h * stages[k - 1][i] } else { 0.0 })
                .collect();
            let status = self.evaluate(t + part * h, &at, &mut stages[k]);
            if status != Status::Ok {
                return status;
            }
        }
        let [a, b, c, d] = &stages;
        let mut next: Vec<f64> =
            (0..n).map(|i| x[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i])).collect();
        if !next.iter().all(|x| x.is_finite()) {
            return Status::NonFiniteInput;
        }
        self.mechanism.q.normalise(&mut next[..n_q]);
        if method == Method::Projection {
            let (q, rest) = next.split_at_mut(n_q);
            let status = self.form.project(self.model, q, &mut rest[..n_v]);
            if status != Status::Ok {
                return status;
            }
        }
        *x = next;
        Status::Ok
    }
}
