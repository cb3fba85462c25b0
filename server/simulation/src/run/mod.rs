//! From a start through a span of time.

mod implicit_form;
pub(crate) mod output;
pub(crate) mod settings;
pub(crate) mod start;
mod switching;

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Compiled, Model, Status};

use crate::coordinates::Coordinates;
use crate::error::SimulationError;
use crate::forces::inputs::{Input, OnTree};
use crate::forces::springs::{Spring, Springs};
use crate::methods::{Attempt, Stepper};
use crate::motion::energy::{Energy, Meter};
use crate::motion::engine::Engine;
use crate::run::output::{End, Event, EventKind, Run, Sample};
use crate::run::settings::Settings;
use crate::run::start::Start;
use crate::run::switching::{NEAR, Watch};

/// Distance to singularity below which double precision is not trusted with many digits.
const DELICATE: f64 = 3e-3;
/// Attempts after which the time has to have moved on by a part of the duration.
const STALLED: u64 = 2000;
const MOVED: f64 = 1e-5;
/// Switches of independents without a step between them.
const IN_VAIN: u32 = 2;

/// A robot with what hangs on it.
#[derive(Clone, Copy, Debug)]
pub struct Setup<'a> {
    /// What the robot's files say: masses for the energy, and what is compiled anew with other
    /// independents.
    pub description: &'a Description,
    /// The same, compiled.
    pub compiled: &'a Compiled,
    /// Springs and dampers between links.
    pub springs: &'a [Spring],
    /// What pushes the joints.
    pub inputs: &'a [Input],
}

impl Setup<'_> {
    /// Springs and inputs whose numbers can be used.
    pub(crate) fn checked(&self) -> Result<(Springs, Vec<OnTree>), SimulationError> {
        let model = &self.compiled.model;
        check_springs(self.springs, model)?;
        let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
        let inputs = self
            .inputs
            .iter()
            .map(|input| OnTree::new(input, model, &tree))
            .collect::<Result<_, _>>()?;
        Ok((Springs::new(self.springs), inputs))
    }

    /// Where the declared independents stand in q and q̇.
    pub(crate) fn declared(&self) -> (Vec<usize>, Vec<usize>) {
        let model = &self.compiled.model;
        let place = |names: &[String], of: &[String]| -> Vec<usize> {
            names.iter().filter_map(|name| of.iter().position(|other| other == name)).collect()
        };
        (
            place(model.independent_q_names(), model.tree_q_names()),
            place(model.independent_names(), model.tree_names()),
        )
    }
}

/// Simulates. `progress` is told the time that has been reached, after each step. Allocates as
/// samples need it.
///
/// # Errors
/// What is wrong with the start, the settings, the inputs or the springs. A state without an answer
/// on the way is no error: the run ends there, says so, and keeps what there is.
pub fn simulate(
    setup: &Setup<'_>,
    start: &Start,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Run, SimulationError> {
    settings.check()?;
    let once = |settings: &Settings, progress: &mut dyn FnMut(f64)| {
        if settings.method.is_implicit_form() {
            implicit_form::run(setup, start, settings, progress)
        } else {
            Simulator::new(setup, start, settings)?.run(progress)
        }
    };
    let mut run = once(settings, progress)?;
    if settings.estimate {
        let (settings, factor) = settings.finer();
        let other =
            once(&Settings { duration: run.time.max(f64::MIN_POSITIVE), ..settings }, &mut |_| ())?;
        let gap = |f: fn(&Sample) -> &[f64]| match (run.last(), other.last()) {
            (Some(a), Some(b)) if a.time == b.time => {
                f(a).iter().zip(f(b)).fold(0.0, |largest: f64, (a, b)| largest.max((a - b).abs()))
                    * factor
            }
            _ => f64::NAN,
        };
        run.error_estimate = Some([gap(|x| &x.y), gap(|x| &x.yd)]);
    }
    Ok(run)
}

/// A simulation under way.
struct Simulator<'a> {
    settings: &'a Settings,
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
    declared: (Vec<usize>, Vec<usize>),
}

impl<'a> Simulator<'a> {
    fn new(
        setup: &Setup<'_>,
        start: &Start,
        settings: &'a Settings,
    ) -> Result<Simulator<'a>, SimulationError> {
        let model = &setup.compiled.model;
        let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
        let start = start.check(model)?;
        let (springs, inputs) = setup.checked()?;
        let robot = (setup.description.clone(), setup.compiled.clone());
        let mut engine = Engine::new(robot, springs, inputs, start.guess.as_deref())?;
        engine.may_be_precise = settings.precise;
        // without a guess closures start from their own zero
        let mut x = [start.y, start.yd].concat();
        x.resize(engine.mechanism.n(), 0.0);
        let status = if start.guess.is_some() {
            engine.settle(0.0, &mut x)
        } else {
            engine.settle_from_zero(&mut x)?
        };
        if status != Status::Ok {
            return Err(SimulationError::Start { status, detail: 0.0 });
        }
        let declared = setup.declared();
        Ok(Simulator {
            meter: Meter::new(model, setup.description, &tree)?,
            precise_meter: None,
            watch: if settings.switching || settings.precise { Watch::new(model)? } else { None },
            near: None,
            stepper: settings.stepper()?,
            settings,
            t: 0.0,
            x,
            run: Run::new(start.correction),
            engine,
            declared,
        })
    }

    fn run(mut self, progress: &mut dyn FnMut(f64)) -> Result<Run, SimulationError> {
        let end = self.settings.duration;
        let mut sampled = 0;
        self.look(false)?;
        self.sample()?;
        let (mut attempts, mut in_vain, mut before) = (0, 0, 0.0);
        while self.t < end {
            attempts += 1;
            if attempts > self.settings.most_steps {
                self.run.end = End::TooManySteps;
                break;
            }
            if attempts % STALLED == 0 {
                if !self.settings.method.is_fixed()
                    && self.t - before < MOVED * end
                    && !self.look(true)?
                {
                    self.run.end = End::StepTooShort;
                    break;
                }
                before = self.t;
            }
            let next_sample =
                self.settings.every.map_or(end, |every| (f64::from(sampled) + 1.0) * every);
            // a crumb at the end is no interval of its own
            let next_sample = if next_sample > end - 1e-9 * end { end } else { next_sample };
            // near a singularity a step may turn out to be none
            let near = self.watch.is_some() && self.near.is_none_or(|near| near < NEAR);
            let kept = near.then(|| (self.t, self.x.clone(), self.engine.anchor.clone()));
            let limit = self.next_kink().min(next_sample);
            let failed = self.engine.counts.failed;
            match self.stepper.attempt(&mut self.engine, &mut self.t, &mut self.x, limit) {
                Attempt::Done => {
                    if let Some((t, x, anchor)) =
                        kept.filter(|(.., anchor)| self.engine.jumped(anchor))
                    {
                        (self.t, self.x, self.engine.anchor) = (t, x, anchor);
                        self.stepper.restart();
                        in_vain += 1;
                        if in_vain > IN_VAIN || !self.look(true)? {
                            self.run.end = End::Failed(
                                self.watch
                                    .as_ref()
                                    .map_or(Status::SingularIndependents, Watch::blame),
                            );
                            break;
                        }
                        continue;
                    }
                    in_vain = 0;
                    progress(self.t);
                    if self.engine.counts.failed > failed {
                        self.note_failure();
                    }
                    self.look(false)?;
                    if self.settings.every.is_none() || self.t >= next_sample {
                        sampled += u32::from(self.settings.every.is_some());
                        self.sample()?;
                    }
                }
                Attempt::Rejected => {}
                Attempt::Failed(status) => {
                    in_vain += 1;
                    if in_vain > IN_VAIN || !self.look(true)? {
                        self.run.end = End::Failed(status);
                        break;
                    }
                }
                Attempt::TooShort => {
                    in_vain += 1;
                    if in_vain > IN_VAIN || !self.look(true)? {
                        self.run.end = End::StepTooShort;
                        break;
                    }
                }
            }
        }
        if self.run.last().is_none_or(|sample| sample.time < self.t) {
            self.sample()?;
        }
        if self.stepper.finds_stiff() {
            self.run.events.push(Event { time: self.t, kind: EventKind::Stiff });
        }
        if let (false, Some(distance)) =
            (self.run.end.is_finished(), self.distance().filter(|near| *near < NEAR))
        {
            self.run
                .events
                .push(Event { time: self.t, kind: EventKind::NearSingular { distance } });
        }
        self.run.counts = self.engine.counts;
        self.run.time = self.t;
        self.run.independents = self.engine.compiled.model.independent_names().to_vec();
        Ok(self.run)
    }

    /// The next time at which a force has a kink.
    fn next_kink(&self) -> f64 {
        let kinks = self.engine.mechanism.inputs.iter().flat_map(|input| input.kinks());
        kinks.copied().filter(|time| *time > self.t).fold(f64::INFINITY, f64::min)
    }

    /// A step was taken back for want of an answer; one event for each kind of reason in a row.
    fn note_failure(&mut self) {
        let Some(status) = self.engine.last_failure else { return };
        let kind = EventKind::Shortened { status };
        if self.run.events.last().is_none_or(|event| event.kind != kind) {
            self.run.events.push(Event { time: self.t, kind });
        }
    }

    /// Distance to singularity, where it is watched.
    fn distance(&mut self) -> Option<f64> {
        self.watch.as_mut().and_then(|watch| watch.distance(&self.engine, &self.x, true))
    }

    /// Looks how near a singularity is; goes on with other independents if those in use are, and
    /// says whether it does.
    fn look(&mut self, pressed: bool) -> Result<bool, SimulationError> {
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
                let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
                (self.meter, self.precise_meter) =
                    (Meter::new(model, &self.engine.description, &tree)?, None);
                self.watch = Watch::new(model)?;
                self.stepper.restart();
                Ok(true)
            }
        }
    }

    /// Notes the settled state.
    fn sample(&mut self) -> Result<(), SimulationError> {
        let sizes = self.engine.mechanism.sizes;
        let anchor = &self.engine.anchor;
        let (y, yd) = (&self.x[..sizes.n_qy], &self.x[sizes.n_qy..sizes.n_qy + sizes.n_vy]);
        let (compiled, guess) = (&self.engine.compiled, [anchor.q.as_slice(), &anchor.qd]);
        let mut measured = Err(Status::NotConverged);
        if !(self.engine.is_delicate && self.settings.precise) {
            measured = self.meter.measure(&compiled.model, [y, yd], guess);
        }
        if measured.is_err() {
            if self.precise_meter.is_none() {
                let tree = &self.engine.mechanism.q;
                self.precise_meter =
                    Some(Meter::new(&compiled.exact, &self.engine.description, tree)?);
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
        let pick =
            |from: &[f64], places: &[usize]| places.iter().map(|place| from[*place]).collect();
        self.run.samples.push(Sample {
            time: self.t,
            y: pick(&anchor.q, &self.declared.0),
            yd: pick(&anchor.qd, &self.declared.1),
            q: anchor.q.clone(),
            qd: anchor.qd.clone(),
            energy,
            work: self.x.get(sizes.n_qy + sizes.n_vy).copied().unwrap_or(0.0),
        });
        Ok(())
    }
}

/// Springs end on links and have constants.
fn check_springs(springs: &[Spring], model: &Model<f64>) -> Result<(), SimulationError> {
    for (k, spring) in springs.iter().enumerate() {
        let fault =
            |found: String, expected| Err(SimulationError::Spring { spring: k, found, expected });
        for end in [&spring.from, &spring.to] {
            if end.link >= model.link_names().len() {
                return fault(format!("link number {}", end.link), "a link of the robot");
            }
            if !end.at.iter().all(|x| x.is_finite()) {
                return fault("a point that is not finite".to_owned(), "three numbers");
            }
        }
        for (what, constant) in [
            ("stiffness", spring.stiffness),
            ("damping", spring.damping),
            ("rest length", spring.rest),
        ] {
            if !(constant.is_finite() && constant >= 0.0) {
                return fault(format!("a {what} of {constant}"), "a number that is not negative");
            }
        }
    }
    Ok(())
}
