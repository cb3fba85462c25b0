//! One drawn robot at one state: every answer against the oracle.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::sync::Arc;

use sarrus_dynamics::description::{Description, Joint, JointKind, Row};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Answer, Batch, Compiled, Field, FieldSet, Lock, Method, Model, Plan, Query, QueryOptions,
    Request, Status, Warnings, Workspace, locked,
};

use sarrus_models::{Options, Source, load};

use super::algebra::{Matrix, eliminate};
use super::draw::{Drawn, Features, draw, pivot_at_zero};
use super::oracle::{Oracle, Pose};
use super::text::written;
use crate::seed::Seeded;
use Field::{
    CY, FrameAcc, FramePose, FrameTwist, GBias, KBias, Lambda, Limits, MY, NearestY, Q, QGuess, Qd,
    Qdd, Residual, TauQ, TauU, TauUnactuated, TauY, U, Ud, Udd, Y, Yd, Ydd,
};

/// Error by size up to which an answer without a warning is right.
const HELD: f64 = 1e-9;
/// Least pivot of a path on which the assembly counts as certain, and of a zero pose.
const REGULAR: f64 = 0.03;

/// Steps of a path, and those that decide about a difference.
const COARSE: f64 = 0.1;
const FINE: f64 = 3e-4;
/// States of each robot.
const STATES: usize = 4;

/// Features that meet, by name.
pub const PAIRS: &[(&str, Features)] = &[
    ("winding x limits x springs", Features { turns: true, limits: true, springs: true, ..NONE }),
    ("far x numerical x floating", Features { far: true, numerical: true, floating: true, ..NONE }),
    ("locks x redundant rows", Features { locks: true, redundant: true, limits: true, ..NONE }),
    ("mimic x loops x sizes", Features { mimic: true, sizes: true, springs: true, ..NONE }),
    (
        "actuators x redundant x floating",
        Features { actuators: true, redundant: true, floating: true, balls: true, ..NONE },
    ),
    (
        "files x mimic x springs",
        Features { files: true, mimic: true, springs: true, limits: true, ..NONE },
    ),
    (
        "files x floating x locks x far",
        Features { files: true, floating: true, far: true, locks: true, turns: true, ..NONE },
    ),
    (
        "winding x mimic x locks",
        Features { turns: true, mimic: true, locks: true, springs: true, limits: true, ..NONE },
    ),
    (
        "far x sizes x springs x turns",
        Features { far: true, sizes: true, springs: true, turns: true, ..NONE },
    ),
];

const NONE: Features = Features {
    turns: false,
    limits: false,
    springs: false,
    far: false,
    numerical: false,
    floating: false,
    mimic: false,
    locks: false,
    redundant: false,
    sizes: false,
    actuators: false,
    balls: false,
    files: false,
};

/// Outcomes of the cases.
#[derive(Default, Debug)]
pub struct Ledger {
    /// Cases, one robot at one state each.
    pub cases: u64,
    /// Answers that were compared.
    pub answers: u64,
    /// Answers by status and warning.
    pub outcomes: BTreeMap<String, u64>,
    /// Wrong answers without a word: pair, seed and field.
    pub silent: Vec<String>,
    /// Refusals where the path is regular.
    pub refused: Vec<String>,
}

impl Ledger {
    fn count(&mut self, what: &str) {
        *self.outcomes.entry(what.to_owned()).or_default() += 1;
    }
}

/// Runs the cases of a seed; false if it has none.
pub fn case(pair: &str, with: Features, seed: u64, ledger: &mut Ledger) -> bool {
    let mut seeded = Seeded::new(seed);
    let Some(drawn) = draw(with, Seeded::new(seed ^ 0x5eed)) else {
        ledger.count("no robot");
        return false;
    };
    let of = &drawn.description;
    let independent: Vec<usize> =
        of.submechanisms.iter().flat_map(|part| part.independent.iter().copied()).collect();
    if pivot_at_zero(&drawn, &independent) < REGULAR {
        ledger.count("singular at zero");
        return false;
    }
    let (compiled, read) = match compiled(&drawn, with, seed, ledger) {
        Ok(Some(compiled)) => compiled,
        Ok(None) => return false,
        Err(error) => {
            ledger.cases += 1;
            let first = error.lines().next().unwrap_or_default().to_owned();
            ledger.count("refused at load");
            ledger.refused.push(format!("{pair}, {seed}: {}: load: {first}", drawn.name));
            return true;
        }
    };
    let mut locks = Vec::new();
    let mut is_reduced = false;
    let mut model = compiled.model;
    if with.locks {
        let moving: Vec<usize> = (0..of.joints.len())
            .filter(|j| matches!(of.joints[*j].kind, JointKind::Revolute | JointKind::Prismatic))
            .collect();
        let n = 1 + seeded.below(2);
        for _ in 0..n {
            let from = if seeded.chance(0.8) { &independent } else { &moving };
            let j = from[seeded.below(from.len())];
            let one = matches!(of.joints[j].kind, JointKind::Revolute | JointKind::Prismatic);
            if one && locks.iter().all(|lock: &Lock| lock.joint != j) {
                let unit =
                    if of.joints[j].kind == JointKind::Prismatic { drawn.length } else { 1.0 };
                let x = seeded.within(-0.5, 0.5) * drawn.reach[j] * unit;
                locks.push(Lock { joint: j, position: Some(x) });
            }
        }
        // files may list the joints in another order
        let place = |lock: &Lock| {
            let name = &of.joints[lock.joint].name;
            let joint = read.joints.iter().position(|joint| joint.name == *name);
            Lock { joint: joint.unwrap_or(0), ..*lock }
        };
        match locked(&read, &locks.iter().map(place).collect::<Vec<_>>()) {
            Ok(found) => match Model::compile(&found.description) {
                Ok(compiled) => {
                    model = compiled.model;
                    is_reduced = true;
                }
                Err(error) => {
                    let words = error.to_string().lines().next().unwrap_or_default().to_owned();
                    ledger.cases += 1;
                    ledger.count("locked robot refused at load");
                    ledger.refused.push(format!("{pair}, {seed}: {}: locked: {words}", drawn.name));
                    return true;
                }
            },
            Err(_) => {
                ledger.count("lock refused");
                return false;
            }
        }
    }
    let names: Vec<&String> = of.joints.iter().map(|x| &x.name).collect();
    // independent joints as the model has them
    let mut left: Vec<usize> = Vec::new();
    for name in model.independent_names() {
        let name = name.split('/').next().unwrap_or_default();
        let j = names.iter().position(|x| x.as_str() == name).unwrap_or(0);
        if !left.contains(&j) {
            left.push(j);
        }
    }
    let held: Vec<usize> = locks.iter().map(|lock| lock.joint).collect();
    let held: Vec<usize> = held.into_iter().filter(|j| !left.contains(j)).collect();
    let oracle = Oracle::new(of, &left, &held, drawn.length);
    let judge = Judge {
        pair,
        seed,
        drawn: &drawn,
        of,
        oracle,
        model: &model,
        shared: Arc::new(model.clone()),
        held: locks.iter().filter_map(|lock| Some((lock.joint, lock.position?))).collect(),
        independent,
        is_reduced,
    };
    // files take longer to read than a state to judge
    for _ in 0..if with.files { 5 * STATES } else { STATES } {
        ledger.cases += 1;
        judge.state(with, &mut seeded, ledger);
    }
    true
}

/// The robot compiled from its description, or from files in dialects.
fn compiled(
    drawn: &Drawn,
    with: Features,
    seed: u64,
    ledger: &mut Ledger,
) -> Result<Option<(Compiled, Description)>, String> {
    let of = &drawn.description;
    if !with.files {
        let compiled = Model::compile(of).map_err(|error| error.to_string())?;
        return Ok(Some((compiled, of.clone())));
    }
    let files = written(of, &mut Seeded::new(seed ^ 0xf11e));
    let urdf = files.urdf.into_bytes();
    let source = Source::Text { urdf, submechanisms: Some(files.yaml.into_bytes()) };
    let options = Options { gravity: of.gravity, ..Options::default() };
    let lenient = Options { lenient: true, ..options.clone() };
    match (load(&source, &options), files.drops) {
        (Ok(_), Some(drops)) => {
            ledger.silent.push(format!("{seed}: {}: {drops} is dropped", drawn.name));
            Ok(None)
        }
        (Ok(loaded), None) => Ok(Some((loaded.compiled, loaded.description))),
        (Err(error), None) => Err(error.to_string()),
        (Err(_), Some(_)) => match load(&source, &lenient) {
            Ok(loaded) if loaded.report.warnings.is_empty() => {
                ledger.silent.push(format!("{seed}: {}: dropped without a warning", drawn.name));
                Ok(None)
            }
            Ok(loaded) => Ok(Some((loaded.compiled, loaded.description))),
            Err(error) => Err(error.to_string()),
        },
    }
}

struct Judge<'a> {
    pair: &'a str,
    seed: u64,
    drawn: &'a Drawn,
    of: &'a Description,
    oracle: Oracle<'a>,
    model: &'a Model,
    shared: Arc<Model>,
    held: Vec<(usize, f64)>,
    /// Independent joints of the whole robot.
    independent: Vec<usize>,
    is_reduced: bool,
}

/// An answer and its numbers.
struct Asked {
    answer: Answer,
    plan: Plan,
    numbers: Vec<f64>,
}

impl Asked {
    fn get(&self, field: Field) -> &[f64] {
        self.plan.want().slot(field).map_or(&[], |slot| &self.numbers[slot.range()])
    }

    fn ok(&self) -> bool {
        self.answer.status == Status::Ok
    }

    fn warned(&self, warning: Warnings) -> bool {
        self.answer.warnings.contains(warning)
    }
}

/// The size of a list.
fn size(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |size: f64, x| if x.is_nan() { f64::INFINITY } else { size.max(x.abs()) })
}

impl Judge<'_> {
    fn ask(
        &self,
        request: Request,
        method: Option<Method>,
        given: &[(Field, &[f64])],
        want: &[Field],
        frames: &[u16],
    ) -> Option<Asked> {
        let set = given.iter().fold(FieldSet::EMPTY, |set, (field, _)| set.with(*field));
        let query = Query::new(request, set, FieldSet::of(want)).with_options(QueryOptions::SEARCH);
        self.run(&query.with_frames(frames), method, given)
    }

    fn run(
        &self,
        query: &Query,
        method: Option<Method>,
        given: &[(Field, &[f64])],
    ) -> Option<Asked> {
        let plan = match method {
            Some(method) => Plan::with_method(self.model, query, method).ok()?,
            None => Plan::new(self.model, query).ok()?,
        };
        let mut input = vec![0.0; plan.given().len()];
        for (field, numbers) in given {
            input[plan.given().slot(*field)?.range()].copy_from_slice(numbers);
        }
        let mut numbers = vec![0.0; plan.want().len()];
        let mut workspace = Workspace::for_plans(self.model, [&plan]);
        let answer = plan.run(self.model, &mut workspace, &input, &mut numbers);
        Some(Asked { answer, plan, numbers })
    }

    /// Factors that make velocities of these names radians.
    fn units(&self, names: &[String]) -> Vec<f64> {
        let slides = |name: &String| {
            let of = |joint: &&Joint| joint.name == *name;
            let joint = self.of.joints.iter().find(of);
            joint.is_some_and(|joint| joint.kind == JointKind::Prismatic)
                || ["/x", "/y", "/z", "/tx", "/ty", "/tz"].iter().any(|end| name.ends_with(end))
        };
        let unit = |name| if slides(name) { 1.0 / self.drawn.length } else { 1.0 };
        names.iter().map(unit).collect()
    }

    /// Size of a row as it is declared; zero of a coupling.
    fn declared(&self, name: &str) -> f64 {
        let length = self.drawn.length;
        let size_of = |row: &Row| size(&row.axis[..3]).max(size(&row.axis[3..]) * length);
        let mut cuts = self.of.submechanisms.iter().flat_map(|part| &part.loops);
        let Some((cut, row)) = name.split_once('/') else { return 0.0 };
        let Some(cut) = cuts.find(|of| of.name == cut) else { return 0.0 };
        // a file may name the rows after its cut joint
        let own = cut.rows.iter().find(|of| of.name == row).map(size_of);
        own.unwrap_or_else(|| cut.rows.iter().map(size_of).fold(0.0, f64::max))
    }

    fn report(&self, ledger: &mut Ledger, what: &str, error: f64) {
        let words =
            format!("{}, {}: {}: {what}: {error:.1e}", self.pair, self.seed, self.drawn.name);
        ledger.silent.push(words);
    }

    /// Compares a field by its size.
    fn compare(
        &self,
        ledger: &mut Ledger,
        asked: &Asked,
        what: &str,
        numbers: &[f64],
        exact: &[Dd],
        units: &[f64],
        least: f64,
    ) {
        if numbers.len() != exact.len() {
            self.report(
                ledger,
                &format!("{what} has {} numbers of {}", numbers.len(), exact.len()),
                1.0,
            );
            return;
        }
        ledger.answers += 1;
        let mut worst = 0.0_f64;
        let mut largest = least;
        for ((x, exact), unit) in numbers.iter().zip(exact).zip(units) {
            let off = ((Dd::from(*x) - *exact).to_f64() * unit).abs();
            worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
            largest = largest.max((exact.to_f64() * unit).abs());
        }
        let error = if worst == 0.0 { 0.0 } else { worst / largest };
        let warned = asked.warned(Warnings::ILL_CONDITIONED);
        if error > HELD && !(warned && error.is_finite()) {
            let words = asked.answer.warnings.names().collect::<Vec<_>>().join(" ");
            self.report(ledger, &format!("{what} [{words}]"), error);
        }
    }

    /// The pose that a path from the zero pose leads to: locked joints first, of the whole robot,
    /// then the independents that are left; and the least pivot on the way.
    fn path(&self, zero: &[f64], targets: &[(usize, f64)], step: f64) -> Option<(Vec<f64>, f64)> {
        let mut start = (zero.to_vec(), 1.0);
        if !self.held.is_empty() {
            let whole = Oracle::new(self.of, &self.independent, &[], self.drawn.length);
            let locks: Vec<(usize, f64)> = self
                .held
                .iter()
                .filter(|(j, _)| self.independent.contains(j))
                .map(|(j, x)| (whole.coordinate(*j), *x))
                .collect();
            if locks.len() < self.held.len() {
                return None;
            }
            start = whole.follow(zero, &locks, step)?;
        }
        let (q, pivot) = self.oracle.follow(&start.0, targets, step)?;
        Some((q, start.1.min(pivot)))
    }

    fn state(&self, with: Features, seeded: &mut Seeded, ledger: &mut Ledger) {
        let of = self.of;
        let oracle = &self.oracle;
        let model = self.model;
        let length = self.drawn.length;
        let unit = |j: usize| if of.joints[j].kind == JointKind::Prismatic { length } else { 1.0 };

        // targets of the independents that are left
        let zero: Vec<f64> = oracle.zero();
        let mut targets: Vec<(usize, f64)> = Vec::new();
        let mut y = Vec::new();
        let mut seen = Vec::new();
        for name in model.independent_q_names() {
            let base = name.split('/').next().unwrap_or_default();
            let j = of.joints.iter().position(|x| x.name == base).unwrap_or(0);
            if seen.contains(&j) {
                continue;
            }
            seen.push(j);
            let q = oracle.coordinate(j);
            match of.joints[j].kind {
                JointKind::Spherical | JointKind::Floating => {
                    let floats = of.joints[j].kind == JointKind::Floating;
                    if floats {
                        let far = if with.far { 10f64.powf(seeded.within(0.0, 6.0)) } else { 1.0 };
                        y.extend(seeded.vector(far * length));
                    }
                    let quaternion = [(); 4].map(|()| seeded.within(-1.0, 1.0) + 0.3);
                    let n = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
                    y.extend(quaternion.map(|x| x / n));
                    let first = y.len() - if floats { 7 } else { 4 };
                    targets.extend(y[first..].iter().enumerate().map(|(k, x)| (q + k, *x)));
                }
                _ => {
                    let far = if with.turns && seeded.chance(0.5) { 10.0 } else { 1.0 };
                    let x = seeded.within(-1.0, 1.0) * self.drawn.reach[j] * unit(j) * far;
                    y.push(x);
                    targets.push((q, x));
                }
            }
        }
        let units_y = self.units(model.independent_names());
        let yd: Vec<f64> = units_y.iter().map(|u| seeded.within(-2.0, 2.0) / u).collect();
        let ydd: Vec<f64> = units_y.iter().map(|u| seeded.within(-4.0, 4.0) / u).collect();

        // the path: locked joints first, of the whole robot, then the rest
        let path = self.path(&zero, &targets, COARSE);
        let regular = path.as_ref().is_some_and(|(_, pivot)| *pivot > REGULAR);

        let frames = [(model.link_names().len() - 1) as u16, (model.link_names().len() / 2) as u16];
        let motion: [(Field, &[f64]); 3] = [(Y, &y), (Yd, &yd), (Ydd, &ydd)];
        let want = [
            Q,
            Qd,
            Qdd,
            U,
            Ud,
            Udd,
            Field::G,
            GBias,
            Field::K,
            KBias,
            MY,
            CY,
            TauY,
            TauQ,
            FramePose,
            FrameTwist,
            FrameAcc,
            Limits,
            Residual,
        ];
        let Some(asked) = self.ask(Request::InverseDynamics, None, &motion, &want, &frames) else {
            ledger.count("no plan");
            self.report(ledger, "no plan", 1.0);
            return;
        };
        ledger.count(asked.answer.status.name());
        for name in asked.answer.warnings.names() {
            ledger.count(name);
        }
        if !asked.ok() {
            // a coarse path may miss a singular pose between two steps
            let finely = || self.path(&zero, &targets, FINE).is_some_and(|(_, x)| x > REGULAR);
            if regular && finely() {
                ledger.refused.push(format!(
                    "{}, {}: {}: {} at a regular pose",
                    self.pair,
                    self.seed,
                    self.drawn.name,
                    asked.answer.status.name()
                ));
            }
            if asked.answer.status == Status::Unreachable {
                self.nearest(&y, ledger);
            }
            return;
        }

        // q of the answer in the order of the oracle, polished
        let (q_names, v_names) = oracle.names();
        let at = |names: &[String], within: &[String]| -> Vec<usize> {
            let place = |name: &String| within.iter().position(|x| x == name).unwrap_or(0);
            names.iter().map(place).collect()
        };
        let of_q = at(model.tree_q_names(), &q_names);
        let of_v = at(model.tree_names(), &v_names);
        let mut near: Vec<f64> = match &path {
            Some((q, _)) => q.clone(),
            None => zero.clone(),
        };
        self.held.iter().for_each(|(j, x)| near[oracle.coordinate(*j)] = *x);
        of_q.iter().zip(asked.get(Q)).for_each(|(i, x)| near[*i] = *x);
        let mut exact: Vec<Dd> = near.iter().map(|x| Dd::from(*x)).collect();
        let of_independents = oracle.independent_q();
        of_independents.iter().zip(&y).for_each(|(i, y)| exact[*i] = Dd::from(*y));
        let Some((_, pivot)) = oracle.close(&mut exact, 12) else {
            // joints that are gone may stand elsewhere than the path says
            if self.is_reduced && !regular {
                ledger.count("not judged");
            } else if asked.warned(Warnings::ILL_CONDITIONED) || asked.warned(Warnings::LOOP_OPEN) {
                ledger.count("warned, no reference");
            } else {
                self.report(ledger, "q is not near a closed pose", f64::INFINITY);
            }
            return;
        };
        let rates = oracle.rates(&exact, &yd.iter().map(|x| Dd::from(*x)).collect::<Vec<_>>());
        if pivot < 1e-7 || rates.pivot < 1e-7 {
            ledger.count("singular, not judged");
            return;
        }
        let dd = |x: &[f64]| -> Vec<Dd> { x.iter().map(|x| Dd::from(*x)).collect() };
        let pick =
            |of: &[Dd], places: &[usize]| -> Vec<Dd> { places.iter().map(|i| of[*i]).collect() };
        let n_y = yd.len();
        let units_q = self.units(model.tree_q_names());
        let units_v = self.units(model.tree_names());
        let inverse = |units: &[f64]| -> Vec<f64> { units.iter().map(|u| 1.0 / u).collect() };
        let qd = oracle.rate(&rates.G, &dd(&yd));
        let qdd: Vec<Dd> =
            oracle.rate(&rates.G, &dd(&ydd)).iter().zip(&rates.g).map(|(x, g)| *x + *g).collect();
        let speed = size(&yd.iter().zip(&units_y).map(|(x, u)| x * u).collect::<Vec<_>>());
        let acceleration = size(&ydd.iter().zip(&units_y).map(|(x, u)| x * u).collect::<Vec<_>>())
            .max(speed * speed);

        self.compare(ledger, &asked, "q", asked.get(Q), &pick(&exact, &of_q), &units_q, 1e-4);
        self.compare(
            ledger,
            &asked,
            "qd",
            asked.get(Qd),
            &pick(&qd, &of_v),
            &units_v,
            1e-6 * speed,
        );
        self.compare(
            ledger,
            &asked,
            "qdd",
            asked.get(Qdd),
            &pick(&qdd, &of_v),
            &units_v,
            1e-6 * acceleration,
        );
        self.compare(
            ledger,
            &asked,
            "g",
            asked.get(GBias),
            &pick(&rates.g, &of_v),
            &units_v,
            // rounding of terms that cancel in mechanisms that move without bias
            1e-2 * speed * speed,
        );
        let G: Vec<Dd> =
            of_v.iter().flat_map(|v| rates.G[v * n_y..(v + 1) * n_y].to_vec()).collect();
        let units_G: Vec<f64> =
            units_v.iter().flat_map(|u| units_y.iter().map(move |y| u / y)).collect();
        self.compare(ledger, &asked, "G", asked.get(Field::G), &G, &units_G, 1e-6);

        let units_G_all: Vec<f64> = G.iter().zip(&units_G).map(|(g, u)| g.to_f64() * u).collect();

        // assembly and whole turns
        let other = |path: &[f64]| {
            let single = model.independent_names().len() == 1;
            of_q.iter().enumerate().find(|(k, i)| {
                let name = &q_names[**i];
                let slides =
                    |joint: &Joint| joint.name == *name && joint.kind == JointKind::Prismatic;
                let mut apart = asked.get(Q)[*k] - path[**i];
                if !single && !of.joints.iter().any(slides) {
                    apart -= TAU * (apart / TAU).round();
                }
                let apart = (apart * units_q[*k]).abs();
                !name.contains('/') && apart > 1e-3 * path[**i].abs().max(1.0)
            })
        };
        if regular
            && path.as_ref().is_some_and(|(path, _)| other(path).is_some())
            && let Some((fine, pivot)) = self.path(&zero, &targets, FINE)
            && pivot > REGULAR
            && let Some((_, i)) = other(&fine)
        {
            self.report(ledger, &format!("{} of another assembly or turn", q_names[*i]), 1.0);
        }

        // dynamics
        let poses = oracle.poses(&exact);
        let tree = oracle.forces(&exact, &poses, &qd, &qdd);
        let project = |tau: &[Dd]| -> Vec<Dd> {
            (0..n_y)
                .map(|k| {
                    (0..tau.len()).fold(Dd::ZERO, |sum, v| sum + rates.G[v * n_y + k] * tau[v])
                })
                .collect()
        };
        let tau_y = project(&tree);
        let c_y = project(&oracle.forces(&exact, &poses, &qd, &rates.g));
        let mut M = Matrix::new(n_y, n_y);
        for k in 0..n_y {
            let mut e = vec![Dd::ZERO; n_y];
            e[k] = Dd::ONE;
            let mut one: Vec<Dd> = oracle.rate(&rates.G, &e);
            one.iter_mut().zip(&rates.g).for_each(|(x, g)| *x += *g);
            let column = project(&oracle.forces(&exact, &poses, &qd, &one));
            (0..n_y).for_each(|i| *M.at(i, k) = column[i] - c_y[i]);
        }
        let units_M: Vec<f64> =
            units_y.iter().flat_map(|a| units_y.iter().map(move |b| 1.0 / (a * b))).collect();
        let forces_y = inverse(&units_y);
        self.compare(
            ledger,
            &asked,
            "tau_q",
            asked.get(TauQ),
            &pick(&tree, &of_v),
            &inverse(&units_v),
            0.0,
        );
        self.compare(ledger, &asked, "tau_y", asked.get(TauY), &tau_y, &forces_y, 0.0);
        self.compare(ledger, &asked, "C_y", asked.get(CY), &c_y, &forces_y, 0.0);
        self.compare(ledger, &asked, "M_y", asked.get(MY), M.numbers(), &units_M, 0.0);

        // frames
        let links = oracle.links(&poses, &qd, &qdd);
        for (k, frame) in frames.iter().enumerate() {
            let name = &model.link_names()[usize::from(*frame)];
            let link = of.links.iter().position(|link| link.name == *name).unwrap_or(0);
            let x = &links[link];
            let pose = asked.get(FramePose);
            let inv = 1.0 / length;
            self.compare(
                ledger,
                &asked,
                "position",
                &pose[7 * k..7 * k + 3],
                &x.p,
                &[inv; 3],
                1e-4,
            );
            let twist = asked.get(FrameTwist);
            let [w, d] = [x.w, x.d];
            let all: Vec<Dd> = w.into_iter().chain(d).collect();
            let units = [1.0, 1.0, 1.0, inv, inv, inv];
            self.compare(
                ledger,
                &asked,
                "twist",
                &twist[6 * k..6 * k + 6],
                &all,
                &units,
                1e-2 * speed,
            );
            let all: Vec<Dd> = x.a.into_iter().chain(x.e).collect();
            let acc = asked.get(FrameAcc);
            self.compare(
                ledger,
                &asked,
                "acc",
                &acc[6 * k..6 * k + 6],
                &all,
                &units,
                1e-2 * acceleration,
            );
        }

        self.pushed(&motion, frames[0], &poses, &rates.G, &tau_y, seeded, ledger);

        // K G = 0 and K q̈ = k
        let K = asked.get(Field::K);
        let n_v = of_v.len();
        let of_qdd = of_v.iter().zip(&units_v).fold(acceleration, |m: f64, (v, u)| {
            m.max((qdd[*v].to_f64() * u).abs()).max((rates.g[*v].to_f64() * u).abs())
        });
        for (r, row) in K.chunks(n_v.max(1)).enumerate() {
            let mut worst = 0.0_f64;
            let mut most = 0.0_f64;
            for c in 0..n_y {
                let terms = row.iter().zip(&of_v).map(|(k, v)| Dd::from(*k) * rates.G[v * n_y + c]);
                let mut sum = Dd::ZERO;
                let mut abs = 0.0;
                terms.for_each(|x| {
                    sum += x;
                    abs += x.to_f64().abs();
                });
                worst = worst.max(sum.to_f64().abs() * 1.0 / units_y[c]);
                most = most.max(abs / units_y[c]);
            }
            // a row that every motion satisfies is rounding
            let largest = size(&row.iter().zip(&units_v).map(|(k, u)| k / u).collect::<Vec<_>>());
            let of_G = size(&units_G_all).max(1.0);
            let row_size = largest.max(self.declared(&model.loop_names()[r])) * of_G;
            let error = worst / most.max(1e-6 * row_size);
            if worst > 0.0
                && error > HELD
                && !asked.warned(Warnings::ILL_CONDITIONED)
                && !asked.warned(Warnings::LOOP_OPEN)
            {
                self.report(ledger, &format!("K G of row {}", model.loop_names()[r]), error);
            }
            let along: Vec<Dd> =
                row.iter().zip(&of_v).map(|(k, v)| Dd::from(*k) * qdd[*v]).collect();
            let sum = along.iter().fold(Dd::ZERO, |sum, x| sum + *x);
            let most = along.iter().fold(0.0, |m: f64, x| m + x.to_f64().abs());
            let off = (sum - Dd::from(asked.get(KBias)[r])).to_f64().abs();
            let error = off / most.max(1e-4 * row_size * of_qdd);
            if off > 0.0
                && error > HELD
                && !asked.warned(Warnings::ILL_CONDITIONED)
                && !asked.warned(Warnings::LOOP_OPEN)
            {
                self.report(ledger, &format!("K qdd of row {}", model.loop_names()[r]), error);
            }
        }
        // rows as they were described
        if !self.is_reduced && K.len() == oracle.n_rows() * n_v && with.redundant {
            let exact_K = oracle.jacobian(&poses);
            // cuts come before couplings of their part; only robots without couplings are compared
            if of.joints.iter().all(|joint| joint.coupling.is_none()) {
                for r in 0..oracle.n_rows() {
                    let row: Vec<Dd> = of_v.iter().map(|v| exact_K.get(r, *v)).collect();
                    let units = inverse(&units_v);
                    let least = 1e-6 * self.declared(&model.loop_names()[r]);
                    let row_of_K = &K[r * n_v..(r + 1) * n_v];
                    self.compare(ledger, &asked, "row of K", row_of_K, &row, &units, least);
                }
            }
        }

        // limits
        let limits = asked.get(Limits);
        let mut exceeded = false;
        let mut doubtful = false;
        for (k, name) in model.tree_names().iter().enumerate() {
            let Some(joint) = of.joints.iter().find(|joint| joint.name == *name) else { continue };
            let Some(limit) = joint.limits else { continue };
            let i = q_names.iter().position(|x| x == name).unwrap_or(0);
            let x = exact[i].to_f64();
            let v = qd[of_v[k]].to_f64();
            for (column, x, low, high) in
                [(0, x, limit.lower, limit.upper), (1, v, -limit.velocity, limit.velocity)]
            {
                let by = if x < low {
                    x - low
                } else if x > high {
                    x - high
                } else {
                    0.0
                };
                let near = |a: f64| (x - a).abs() < 1e-9 * (x.abs() + 1.0);
                doubtful |= near(low) || near(high);
                exceeded |= by != 0.0;
                let off = (limits[3 * k + column] - by).abs();
                if off > 1e-8 * (x.abs().max(1.0))
                    && !near(low)
                    && !near(high)
                    && !asked.warned(Warnings::ILL_CONDITIONED)
                {
                    self.report(ledger, &format!("limit {column} of {name}"), off);
                }
            }
        }
        let warned = asked.warned(Warnings::LIMITS_EXCEEDED);
        if exceeded != warned && !doubtful {
            self.report(ledger, &format!("limits exceeded {exceeded}, warned {warned}"), 1.0);
        }

        self.actuators(&motion, &rates.G, &tau_y, &tree, &of_v, &units_v, ledger);
        self.forward(&motion, &rates.G, &M, &c_y, &units_y, &tau_y, seeded, ledger);
        self.given_q(&asked, &units_q, seeded, ledger);
        self.given_u(&asked, ledger);
        self.abreast(&motion, ledger);
    }

    /// A wrench on a link takes Gᵀ Jᵀ w off the forces; J moves the link.
    fn pushed(
        &self,
        motion: &[(Field, &[f64]); 3],
        frame: u16,
        poses: &[Pose<Dd>],
        G: &[Dd],
        tau_y: &[Dd],
        seeded: &mut Seeded,
        ledger: &mut Ledger,
    ) {
        let n = tau_y.len();
        let name = &self.model.link_names()[usize::from(frame)];
        let link = self.of.links.iter().position(|link| link.name == *name).unwrap_or(0);
        let still = vec![Dd::ZERO; self.oracle.n_v()];
        // moments and forces of the size of the others
        let units_y = self.units(self.model.independent_names());
        let most =
            tau_y.iter().zip(&units_y).fold(0.0, |m: f64, (x, u)| m.max((x.to_f64() / u).abs()));
        let inv = 1.0 / self.drawn.length;
        let wrench: Vec<f64> = (0..6)
            .map(|k| seeded.within(-1.0, 1.0) * most * if k < 3 { 1.0 } else { inv })
            .collect();
        let mut exact = tau_y.to_vec();
        let mut J = Matrix::new(6, n);
        for k in 0..n {
            let mut e = vec![Dd::ZERO; n];
            e[k] = Dd::ONE;
            let x = self.oracle.links(poses, &self.oracle.rate(G, &e), &still)[link];
            for (i, v) in x.w.into_iter().chain(x.d).enumerate() {
                *J.at(i, k) = v;
                exact[k] += -(v * Dd::from(wrench[i]));
            }
        }
        let query = |want: &[Field], given: &[(Field, &[f64])]| {
            let set = given.iter().fold(FieldSet::EMPTY, |set, (field, _)| set.with(*field));
            let query = Query::new(Request::InverseDynamics, set, FieldSet::of(want));
            query.with_wrenches(&[frame]).with_frames(&[frame]).with_options(QueryOptions::SEARCH)
        };
        let given = [motion[0], motion[1], motion[2], (Field::Wrenches, wrench.as_slice())];
        let query = query(&[TauY, Field::JacobianIndependent], &given);
        let Some(asked) = self.run(&query, None, &given) else {
            ledger.count("no plan with wrenches");
            return;
        };
        if !asked.ok() {
            ledger.count(&format!("pushed: {}", asked.answer.status.name()));
            return;
        }
        let units: Vec<f64> = units_y.iter().map(|u| 1.0 / u).collect();
        self.compare(ledger, &asked, "tau_y with a wrench", asked.get(TauY), &exact, &units, most);
        let rows = [1.0, 1.0, 1.0, inv, inv, inv];
        let units: Vec<f64> =
            rows.iter().flat_map(|a| units_y.iter().map(move |b| a / b)).collect();
        let numbers = asked.get(Field::JacobianIndependent);
        self.compare(ledger, &asked, "J_y", numbers, J.numbers(), &units, 1e-2);
    }

    /// G_uᵀ τ_u + τ_unactuated = τ_y, and M q̈ + C = τ + Kᵀ λ.
    fn actuators(
        &self,
        motion: &[(Field, &[f64]); 3],
        G: &[Dd],
        tau_y: &[Dd],
        tree: &[Dd],
        of_v: &[usize],
        units_v: &[f64],
        ledger: &mut Ledger,
    ) {
        let model = self.model;
        let want = [TauU, TauUnactuated, Lambda, Field::K];
        let n_y = tau_y.len();
        let Some(asked) = self.ask(Request::InverseDynamics, None, motion, &want, &[]) else {
            ledger.count("no plan for actuators");
            return;
        };
        ledger.count(&format!("actuators: {}", asked.answer.status.name()));
        if !asked.ok() {
            return;
        }
        let (_, v_names) = self.oracle.names();
        let v_of = |name: &String| v_names.iter().position(|x| x == name).unwrap_or(0);
        let active: Vec<usize> = model.active_names().iter().map(v_of).collect();
        let mut sum: Vec<Dd> = asked.get(TauUnactuated).iter().map(|x| Dd::from(*x)).collect();
        for (u, v) in asked.get(TauU).iter().zip(&active) {
            (0..n_y).for_each(|k| sum[k] += G[v * n_y + k] * Dd::from(*u));
        }
        let units: Vec<f64> =
            self.units(model.independent_names()).iter().map(|u| 1.0 / u).collect();
        // forces of actuators that nearly cancel keep the digits of the largest
        let most = asked.get(TauU).iter().zip(&active).fold(0.0, |m: f64, (u, v)| {
            (0..n_y).fold(m, |m, k| m.max((G[v * n_y + k].to_f64() * u * units[k]).abs()))
        });
        let numbers: Vec<f64> = sum.iter().map(|x| x.to_f64()).collect();
        self.compare(ledger, &asked, "tau_y from tau_u", &numbers, tau_y, &units, most);

        // the rest of the tree's forces is that of the loops
        let n_v = of_v.len();
        let mut rest: Vec<Dd> = of_v.iter().map(|v| tree[*v]).collect();
        let mut most =
            size(&rest.iter().zip(units_v).map(|(x, u)| x.to_f64() / u).collect::<Vec<_>>());
        let place = |v: &usize| of_v.iter().position(|x| x == v);
        for (u, v) in asked.get(TauU).iter().zip(&active) {
            if let Some(k) = place(v) {
                rest[k] += -Dd::from(*u);
                most = most.max((u / units_v[k]).abs());
            }
        }
        let independents = self.oracle.independents();
        for (x, v) in asked.get(TauUnactuated).iter().zip(&independents) {
            if let Some(k) = place(v) {
                rest[k] += -Dd::from(*x);
            }
        }
        let mut sum = vec![Dd::ZERO; n_v];
        for (row, lambda) in asked.get(Field::K).chunks(n_v.max(1)).zip(asked.get(Lambda)) {
            for k in 0..n_v {
                sum[k] += Dd::from(row[k]) * Dd::from(*lambda);
                most = most.max((row[k] * lambda / units_v[k]).abs());
            }
        }
        let numbers: Vec<f64> = sum.iter().map(|x| x.to_f64()).collect();
        let units: Vec<f64> = units_v.iter().map(|u| 1.0 / u).collect();
        self.compare(ledger, &asked, "K^T lambda", &numbers, &rest, &units, most);
    }

    fn forward(
        &self,
        motion: &[(Field, &[f64]); 3],
        G: &[Dd],
        M: &Matrix<Dd>,
        c_y: &[Dd],
        units_y: &[f64],
        tau_y: &[Dd],
        seeded: &mut Seeded,
        ledger: &mut Ledger,
    ) {
        let n = c_y.len();
        let scale: Vec<f64> = (0..n).map(|i| 1.0 / M.get(i, i).to_f64().abs().sqrt()).collect();
        let solved = |tau: &[Dd]| -> Option<Vec<Dd>> {
            let mut A = Matrix::new(n, n);
            let mut B = Matrix::new(n, 1);
            for i in 0..n {
                for j in 0..n {
                    *A.at(i, j) = M.get(i, j) * Dd::from(scale[i]) * Dd::from(scale[j]);
                }
                *B.at(i, 0) = (tau[i] - c_y[i]) * Dd::from(scale[i]);
            }
            let (x, pivot) = eliminate(A, B);
            let ydd = (0..n).map(|i| x.get(i, 0) * Dd::from(scale[i])).collect();
            (pivot > 1e-12).then_some(ydd)
        };
        let tau: Vec<f64> =
            tau_y.iter().map(|x| x.to_f64() * (1.0 + seeded.within(-0.5, 0.5))).collect();
        let Some(exact) = solved(&tau.iter().map(|x| Dd::from(*x)).collect::<Vec<_>>()) else {
            ledger.count("M_y is singular");
            return;
        };
        let (_, v_names) = self.oracle.names();
        let v_of = |name: &String| v_names.iter().position(|x| x == name).unwrap_or(0);
        let active: Vec<usize> = self.model.active_names().iter().map(v_of).collect();
        let most = size(&tau.iter().zip(units_y).map(|(x, u)| x / u).collect::<Vec<_>>());
        let units_u = self.units(self.model.active_names());
        let tau_u: Vec<f64> = units_u.iter().map(|u| seeded.within(-1.0, 1.0) * most * u).collect();
        let mut of_u = vec![Dd::ZERO; n];
        for (u, v) in tau_u.iter().zip(&active) {
            (0..n).for_each(|k| of_u[k] += G[v * n + k] * Dd::from(*u));
        }
        let from_u = solved(&of_u).unwrap_or_default();
        for method in Method::ALL {
            for (field, tau, exact) in [(TauY, &tau, &exact), (TauU, &tau_u, &from_u)] {
                if tau.is_empty() {
                    continue;
                }
                let given: [(Field, &[f64]); 3] = [motion[0], motion[1], (field, tau)];
                let request = Request::ForwardDynamics;
                let Some(asked) = self.ask(request, Some(method), &given, &[Ydd], &[]) else {
                    continue;
                };
                let name = format!("ydd by {} from {}", method.name(), field.name());
                ledger.count(&format!("{name}: {}", asked.answer.status.name()));
                if asked.ok() {
                    self.compare(ledger, &asked, &name, asked.get(Ydd), exact, units_y, 0.0);
                }
            }
        }
    }

    /// A given q with other turns keeps them.
    fn given_q(&self, asked: &Asked, units: &[f64], seeded: &mut Seeded, ledger: &mut Ledger) {
        let model = self.model;
        let independent = model.independent_names();
        let coupled = |name: &String| {
            self.of.joints.iter().any(|joint| {
                joint.coupling.as_ref().is_some_and(|coupling| {
                    joint.name == *name
                        || coupling.terms.iter().any(|(k, _)| self.of.joints[*k].name == *name)
                })
            })
        };
        let mut q = asked.get(Q).to_vec();
        for (k, name) in model.tree_q_names().iter().enumerate() {
            let dependent = !independent.contains(name) && !coupled(name);
            let turns = |joint: &Joint| joint.name == *name && joint.kind == JointKind::Revolute;
            if dependent && self.of.joints.iter().any(turns) && seeded.chance(0.5) {
                q[k] += TAU * (seeded.below(7) as f64 - 3.0);
            }
        }
        let qd = asked.get(Qd).to_vec();
        let qdd = asked.get(Qdd).to_vec();
        let given: [(Field, &[f64]); 3] = [(Q, &q), (Qd, &qd), (Qdd, &qdd)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Q, Qd, Qdd], &[]) else {
            return;
        };
        ledger.count(&format!("given q: {}", again.answer.status.name()));
        if !again.ok() {
            if !asked.warned(Warnings::ILL_CONDITIONED) {
                ledger.refused.push(format!(
                    "{}, {}: {}: given q: {}",
                    self.pair,
                    self.seed,
                    self.drawn.name,
                    again.answer.status.name()
                ));
            }
            return;
        }
        let exact: Vec<Dd> = q.iter().map(|x| Dd::from(*x)).collect();
        if asked.warned(Warnings::ILL_CONDITIONED) {
            return;
        }
        self.compare(ledger, &again, "q given", again.get(Q), &exact, units, 1.0);

        // and so does a guess
        let y: Vec<f64> = model
            .independent_q_names()
            .iter()
            .filter_map(|name| Some(q[model.tree_q_names().iter().position(|x| x == name)?]))
            .collect();
        let given: [(Field, &[f64]); 2] = [(Y, &y), (QGuess, &q)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Q], &[]) else { return };
        ledger.count(&format!("guess: {}", again.answer.status.name()));
        if again.ok() {
            self.compare(ledger, &again, "q from a guess", again.get(Q), &exact, units, 1.0);
        } else {
            ledger.refused.push(format!(
                "{}, {}: {}: guess: {}",
                self.pair,
                self.seed,
                self.drawn.name,
                again.answer.status.name()
            ));
        }
    }

    /// States side by side have the bits of one alone.
    fn abreast(&self, motion: &[(Field, &[f64]); 3], ledger: &mut Ledger) {
        const ROWS: usize = 5;
        let want = [Q, Qd, Qdd, TauY, Limits, FramePose];
        let query =
            Query::new(Request::InverseDynamics, FieldSet::of(&[Y, Yd, Ydd]), FieldSet::of(&want));
        let query = query.with_options(QueryOptions::SEARCH).with_frames(&[0]);
        let Ok(plan) = Plan::new(self.model, &query) else { return };
        let mut batch = Batch::new(&self.shared, &plan);
        let n_in = plan.given().len();
        let n_out = plan.want().len();
        let mut input = vec![0.0; ROWS * n_in];
        for (row, input) in input.chunks_mut(n_in.max(1)).enumerate() {
            let part = 1.0 - 0.2 * row as f64;
            for (field, numbers) in motion {
                let Some(slot) = plan.given().slot(*field) else { return };
                // the quaternions of all rows are those of the state
                let part = if *field == Y && self.has_quaternions() { 1.0 } else { part };
                input[slot.range()].iter_mut().zip(*numbers).for_each(|(to, x)| *to = part * x);
            }
        }
        let unknown = Answer { status: Status::UnknownRequest, warnings: Warnings::NONE };
        let mut output = vec![0.0; ROWS * n_out];
        let mut answers = [unknown; ROWS];
        batch.run(&input, &mut output, &mut answers);
        let mut workspace = Workspace::for_plans(self.model, [&plan]);
        let mut alone = vec![0.0; n_out];
        let bits = |x: &f64| if x.is_nan() { u64::MAX } else { x.to_bits() };
        for row in 0..ROWS {
            let input = &input[row * n_in..][..n_in];
            let answer = plan.run(self.model, &mut workspace, input, &mut alone);
            let same = output[row * n_out..][..n_out].iter().map(bits).eq(alone.iter().map(bits));
            if answer != answers[row] || !same {
                self.report(ledger, &format!("row {row} of a batch differs"), 1.0);
            }
        }
    }

    fn has_quaternions(&self) -> bool {
        let sizes = self.model.sizes();
        sizes.n_qy > sizes.n_vy
    }

    /// u of an answer leads to a pose with this u.
    fn given_u(&self, asked: &Asked, ledger: &mut Ledger) {
        let model = self.model;
        if model.sizes().n_u != model.sizes().n_qy || model.sizes().n_u == 0 {
            return;
        }
        let u = asked.get(U).to_vec();
        let guess = asked.get(Q).to_vec();
        let given: [(Field, &[f64]); 2] = [(U, &u), (QGuess, &guess)];
        let Some(again) = self.ask(Request::Kinematics, None, &given, &[Y, U], &[]) else { return };
        ledger.count(&format!("given u: {}", again.answer.status.name()));
        if again.ok() {
            let units = self.units(model.active_names());
            let exact: Vec<Dd> = u.iter().map(|x| Dd::from(*x)).collect();
            self.compare(ledger, &again, "u given", again.get(U), &exact, &units, 1.0);
        }
    }

    /// The nearest y is answered.
    fn nearest(&self, y: &[f64], ledger: &mut Ledger) {
        let Some(asked) = self.ask(Request::Kinematics, None, &[(Y, y)], &[NearestY], &[]) else {
            return;
        };
        let nearest = asked.get(NearestY).to_vec();
        if asked.ok() || nearest.iter().any(|x| x.is_nan()) {
            ledger.count("no nearest y");
            return;
        }
        let there = self.ask(Request::Kinematics, None, &[(Y, &nearest)], &[Q], &[]);
        if there.is_some_and(|there| !there.ok()) {
            self.report(ledger, "the nearest y has no answer", 1.0);
        } else {
            ledger.count("nearest y answered");
        }
    }
}
