//! The loop over steps: one attempt after the other, switching of independents, samples.

use std::mem;

use sarrus_dynamics::Status;
use sarrus_dynamics::scalar::Dd;

use super::events::{Event, EventKind};
use super::output::{End, Run, Sample};
use super::settings::{Method, Settings, Stops};
use super::setup::Setup;
use super::start::Start;
use super::switching::{NEAR, Watch};
use crate::error::{Outcome, SimulationError};
use crate::methods::{Attempt, Stepper};
use crate::motion::elastic;
use crate::motion::energy::{Energy, Meter};
use crate::motion::engine::{Anchor, Engine};
use crate::motion::rates::Effects;

/// Distance to singularity below which double precision is not trusted with many digits.
const DELICATE: f64 = 3e-3;
/// Attempts after which the time has to have moved on by a part of the duration.
const STALLED: u64 = 2000;
const MOVED: f64 = 1e-5;
/// Depth in a stop that counts as touching it `[rad, m]`, and the shortest step of the search for
/// it, in parts of the duration.
const TOUCH: f64 = 1e-9;
const SHORTEST: f64 = 1e-12;
/// Switches of independents without a step between them.
const IN_VAIN: u32 = 2;

/// The outcome of a step.
enum Kept {
    Stays,
    /// It is made again, up to a contact or a row.
    Shorter,
    /// It came out elsewhere, at a singularity.
    Jumped,
}

/// A simulation under way.
pub(super) struct Simulator<'a> {
    settings: &'a Settings,
    stops: Stops,
    engine: Engine,
    stepper: Box<dyn Stepper>,
    meter: Meter<f64>,
    precise_meter: Option<Meter<Dd>>,
    watch: Option<Watch>,
    /// Distance to singularity at the last accepted state.
    near: Option<f64>,
    t: f64,
    x: Vec<f64>,
    run: Run,
    /// Where the declared independents stand in q and q̇.
    declared: [Vec<usize>; 2],
    /// When a joint comes to its stop, as far as that is known.
    contact: Option<f64>,
    /// Actuators at their limits at the last accepted state.
    cut: Vec<bool>,
}

impl<'a> Simulator<'a> {
    pub(super) fn new(
        setup: &Setup<'_>,
        start: &Start,
        settings: &'a Settings,
        stops: Stops,
    ) -> Outcome<Simulator<'a>> {
        let model = &setup.compiled.model;
        let start = start.check(model)?;
        let (springs, inputs) = setup.checked()?;
        let Settings { friction, limited, stops: stiffness, .. } = *settings;
        let mut robot = (setup.description.clone(), setup.compiled.clone());
        let (rotors, elastic) = elastic::rotors(model, setup.description);
        if !elastic.is_empty() {
            robot = elastic::parted(robot.0, &elastic)?;
        }
        let effects = Effects { friction, limited, stops: stiffness, rotors };
        let mut engine = Engine::new(robot, springs, inputs, effects, &start.guess)?;
        engine.may_be_precise = settings.precise;
        let mut x = [start.y, start.yd].concat();
        x.resize(engine.mechanism.n(), 0.0);
        let no_start = |status| SimulationError::Start { status, detail: 0.0 };
        engine.settle(0.0, &mut x).map_err(no_start)?;
        // no spring is stretched
        if !elastic.is_empty() {
            for (k, rotor) in engine.mechanism.effects.rotors.iter().enumerate() {
                let at = engine.mechanism.rotor(k);
                (x[at], x[at + 1]) = (engine.anchor.qd[rotor.v], engine.anchor.q[rotor.q]);
            }
            engine.settle(0.0, &mut x).map_err(no_start)?;
        }
        Ok(Simulator {
            meter: Meter::new(&engine.compiled.model, &engine.description)?,
            precise_meter: None,
            watch: if settings.switching || settings.precise { Watch::new(model)? } else { None },
            near: None,
            stepper: settings.stepper(),
            settings,
            stops,
            t: 0.0,
            x,
            run: Run { elastic, correction: start.correction, ..Run::default() },
            engine,
            declared: setup.declared(),
            contact: None,
            cut: vec![false; model.sizes().n_u],
        })
    }

    pub(super) fn run(mut self, progress: &mut dyn FnMut(f64)) -> Outcome<Run> {
        let end = self.settings.duration;
        let mut sampled = 0;
        self.look(false)?;
        self.sample()?;
        self.note_limits();
        let mut attempts = 0;
        let mut in_vain = 0;
        let mut before = 0.0;
        while self.t < end {
            attempts += 1;
            if attempts > self.settings.most_steps {
                self.run.end = End::TooManySteps;
                break;
            }
            if attempts % STALLED == 0 && self.stalls(mem::replace(&mut before, self.t))? {
                self.run.end = End::StepTooShort;
                break;
            }
            // near a singularity a step may turn out to be none
            let near = self.watch.is_some() && self.near.is_none_or(|near| near < NEAR);
            let keeps = near || self.has_rows_within() || self.settings.stops.is_some();
            let kept = keeps.then(|| (self.t, self.x.clone(), self.engine.anchor.clone()));
            let contact = self.contact.take().unwrap_or(f64::INFINITY);
            let row =
                if self.has_rows_within() { end } else { self.settings.sample_after(sampled) };
            let forced = self.engine.mechanism.next_kink(self.t).min(row).min(contact);
            let limit = self.stops.after(self.t, forced);
            let failed = self.engine.counts.failed;
            match self.stepper.attempt(&mut self.engine, &mut self.t, &mut self.x, limit) {
                Attempt::Done => match self.keep_step(kept, near, &mut sampled)? {
                    Kept::Stays => {
                        in_vain = 0;
                        progress(self.t);
                        if self.engine.counts.failed > failed {
                            self.note_failure();
                        }
                        self.note_limits();
                        self.look(false)?;
                        let is_row = self.t >= self.settings.sample_after(sampled);
                        if is_row || self.settings.every.is_none() {
                            sampled += u64::from(self.settings.every.is_some());
                            self.sample()?;
                        }
                    }
                    Kept::Jumped => {
                        in_vain += 1;
                        if in_vain > IN_VAIN || !self.look(true)? {
                            let blame = self.watch.as_ref().map(Watch::blame);
                            self.run.end =
                                End::Failed(blame.unwrap_or(Status::SingularIndependents));
                            break;
                        }
                    }
                    Kept::Shorter => {}
                },
                Attempt::Rejected => {}
                attempt @ (Attempt::Failed(_) | Attempt::TooShort) => {
                    in_vain += 1;
                    if in_vain > IN_VAIN || !self.look(true)? {
                        self.run.end = match attempt {
                            Attempt::Failed(status) => End::Failed(status),
                            _ => End::StepTooShort,
                        };
                        break;
                    }
                }
            }
        }
        self.finish()?;
        Ok(self.run)
    }

    /// True where rows do not end steps.
    fn has_rows_within(&self) -> bool {
        self.settings.method == Method::Dop853 && self.settings.every.is_some()
    }

    /// Samples the rows within a step from `before`, or takes it back.
    fn keep_step(
        &mut self,
        before: Option<(f64, Vec<f64>, Anchor)>,
        near: bool,
        sampled: &mut u64,
    ) -> Outcome<Kept> {
        let Some((t, x, anchor)) = before else { return Ok(Kept::Stays) };
        let contact = self.first_contact(t, &anchor);
        let jumped = contact.is_none() && near && self.engine.jumped(&anchor);
        if contact.is_none() && !jumped && self.sample_within(&anchor, sampled)? {
            return Ok(Kept::Stays);
        }
        (self.t, self.x, self.engine.anchor) = (t, x, anchor);
        self.stepper.restart();
        if jumped {
            return Ok(Kept::Jumped);
        }
        // a row without an answer is one that a step has to end at
        self.contact = contact.or_else(|| Some(self.settings.sample_after(*sampled)));
        Ok(Kept::Shorter)
    }

    /// Samples the rows within the last step, which began at this state; false where one of them
    /// has no answer.
    fn sample_within(&mut self, from: &Anchor, sampled: &mut u64) -> Outcome<bool> {
        if !self.has_rows_within() || self.settings.sample_after(*sampled) >= self.t {
            return Ok(true);
        }
        let anchor = mem::replace(&mut self.engine.anchor, from.clone());
        let after = (self.t, self.x.clone(), anchor);
        let mut is_fine = true;
        while is_fine && self.settings.sample_after(*sampled) < after.0 {
            self.t = self.settings.sample_after(*sampled);
            let x = self.stepper.within(self.t, [&from.rate, &after.2.rate]);
            is_fine = x.is_some_and(|x| {
                self.x = x;
                self.engine.settle(self.t, &mut self.x).is_ok()
            });
            if is_fine {
                self.sample()?;
                *sampled += 1;
            }
        }
        self.engine.take_failure();
        (self.t, self.x, self.engine.anchor) = after;
        Ok(is_fine)
    }

    /// True if the time stands still since `before` with any independents.
    fn stalls(&mut self, before: f64) -> Outcome<bool> {
        let moves = self.t - before >= MOVED * self.settings.duration;
        Ok(!moves && !self.settings.method.is_fixed() && !self.look(true)?)
    }

    /// Samples the end and notes events, counts and independents of the run.
    fn finish(&mut self) -> Outcome {
        if self.run.last().is_none_or(|sample| sample.time < self.t) {
            self.sample()?;
        }
        if self.stepper.finds_stiff() {
            self.run.events.push(Event { time: self.t, kind: EventKind::Stiff });
        }
        let near = self.distance().filter(|near| *near < NEAR && !self.run.end.is_finished());
        if let Some(distance) = near {
            let kind = EventKind::NearSingular(distance);
            self.run.events.push(Event { time: self.t, kind });
        }
        self.run.counts = self.engine.counts;
        self.run.time = self.t;
        self.run.independents = self.engine.compiled.model.independent_names().to_vec();
        Ok(())
    }

    /// A step was taken back for want of an answer; one event for each kind of reason in a row.
    fn note_failure(&mut self) {
        let Some(status) = self.engine.last_failure else { return };
        let kind = EventKind::Shortened(status);
        if self.run.events.last().is_none_or(|event| event.kind != kind) {
            self.run.events.push(Event { time: self.t, kind });
        }
    }

    /// The time within the last step, from t and a state, at which a joint first comes to its stop,
    /// unless the step ends there; then an event tells of it.
    fn first_contact(&mut self, t: f64, from: &Anchor) -> Option<f64> {
        let Engine { mechanism, anchor, compiled, .. } = &self.engine;
        let before = mechanism.beyond(&from.q, &from.qd);
        let after = mechanism.beyond(&anchor.q, &anchor.qd);
        let step = self.t - t;
        let mut first: Option<f64> = None;
        for (k, ([e0, v0], [e1, v1])) in before.into_iter().zip(after).enumerate() {
            if e0 > 0.0 || e1 <= 0.0 {
                continue;
            }
            // it touches at one end of the step
            let touches = [-e0 <= TOUCH, e1 <= TOUCH || step < self.settings.duration * SHORTEST];
            if touches != [false; 2] {
                let name = compiled.model.tree_names()[mechanism.stopped(k)].clone();
                let time = if touches[0] { t } else { self.t };
                self.run.events.push(Event { time, kind: EventKind::Stopped(name) });
                continue;
            }
            // the root of the cubic through both ends, by bisection
            let at = |s: f64| {
                let [a, b] = [step * v0, step * v1];
                let (square, rest) = (s * s, 1.0 - s);
                rest * rest * ((1.0 + 2.0 * s) * e0 + s * a)
                    + square * ((3.0 - 2.0 * s) * e1 - rest * b)
            };
            let mut ends = [0.0, 1.0];
            for _ in 0..60 {
                let middle = 0.5 * (ends[0] + ends[1]);
                ends[usize::from(at(middle) > 0.0)] = middle;
            }
            let time = t + step * ends[1];
            first = Some(first.map_or(time, |first| first.min(time)));
        }
        // a step that is no shorter would be the same
        first.filter(|time| *time > t && *time < self.t)
    }

    /// An event for each actuator that has come to its limits since the last accepted state.
    fn note_limits(&mut self) {
        if !self.settings.limited {
            return;
        }
        let Engine { compiled, mechanism, anchor, .. } = &self.engine;
        let model = &compiled.model;
        let mut now = vec![false; self.cut.len()];
        let mut tau_q = vec![0.0; mechanism.forced()];
        let state = (anchor.q.as_slice(), anchor.qd.as_slice());
        let at = (self.t, self.x.as_slice());
        mechanism.forces(model, at, state, &mut tau_q, |u, _, is_cut| now[u] = is_cut);
        for (u, name) in model.active_names().iter().enumerate() {
            if now[u] && !self.cut[u] {
                let kind = EventKind::Limited(name.clone());
                self.run.events.push(Event { time: self.t, kind });
            }
        }
        self.cut = now;
    }

    /// Distance to singularity, where it is watched.
    fn distance(&mut self) -> Option<f64> {
        self.watch.as_mut().and_then(|watch| watch.distance(&self.engine, &self.x, true))
    }

    /// Measures the distance to a singularity; switches to other independents if those in use are
    /// near one, and returns whether it did.
    fn look(&mut self, pressed: bool) -> Outcome<bool> {
        let Some(watch) = &mut self.watch else { return Ok(false) };
        let close = pressed || self.engine.is_delicate && self.settings.precise;
        let near = watch.distance(&self.engine, &self.x, close);
        self.near = near;
        self.engine.is_delicate = near.is_none_or(|near| near < DELICATE);
        let Some(near) = near.filter(|_| self.settings.switching) else { return Ok(false) };
        match watch.better(&self.engine, &self.x, near, pressed) {
            None => Ok(false),
            Some(Err(kind)) => {
                self.run.events.push(Event { time: self.t, kind });
                Ok(false)
            }
            Some(Ok(better)) => {
                self.run.events.push(Event { time: self.t, kind: better.event });
                (self.engine, self.x) = (better.engine, better.x);
                self.engine.may_be_precise = self.settings.precise;
                let model = &self.engine.compiled.model;
                (self.meter, self.precise_meter) =
                    (Meter::new(model, &self.engine.description)?, None);
                self.watch = Watch::new(model)?;
                self.stepper.restart();
                Ok(true)
            }
        }
    }

    /// Notes the settled state.
    fn sample(&mut self) -> Outcome {
        let sizes = self.engine.mechanism.sizes;
        let anchor = &self.engine.anchor;
        let y = &self.x[..sizes.n_qy];
        let yd = &self.x[sizes.n_qy..sizes.n_qy + sizes.n_vy];
        let compiled = &self.engine.compiled;
        let guess = [anchor.q.as_slice(), &anchor.qd];
        let mut measured = Err(Status::NotConverged);
        if !(self.engine.is_delicate && self.settings.precise) {
            measured = self.meter.measure(&compiled.model, [y, yd], guess);
        }
        if measured.is_err() {
            if self.precise_meter.is_none() {
                self.precise_meter = Some(Meter::new(&compiled.exact, &self.engine.description)?);
            }
            measured = self
                .precise_meter
                .as_mut()
                .map_or(measured, |meter| meter.measure(&compiled.exact, [y, yd], guess));
        }
        // a state that was settled has an energy, unless it overflows
        let nothing = Energy { kinetic: f64::NAN, potential: f64::NAN, residual: f64::NAN };
        let mut energy = measured.unwrap_or(nothing);
        energy.potential += anchor.springs.energy;
        let work = self.x.get(self.engine.mechanism.controlled());
        let mut sample = Sample::new(self.t, guess, &self.declared, work);
        for (k, rotor) in self.engine.mechanism.effects.rotors.iter().enumerate() {
            let at = self.engine.mechanism.rotor(k);
            let [kinetic, potential] = rotor.energy([self.x[at], self.x[at + 1]], guess[0]);
            (energy.kinetic, energy.potential) =
                (energy.kinetic + kinetic, energy.potential + potential);
            sample.theta.push(self.x[at + 1]);
        }
        self.run.samples.push(Sample { energy, ..sample });
        Ok(())
    }
}
