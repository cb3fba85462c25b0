//! One drawn robot at one state: every answer against the oracle.

mod again;
mod forces;
mod simulated;
mod state;
mod sums;

use std::collections::BTreeMap;
use std::sync::Arc;

use sarrus_dynamics::description::{Description, Joint, JointKind, Row};
use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{
    Answer, Compiled, Field, FieldSet, Lock, Method, Model, Plan, Query, QueryOptions, Request,
    Status, Warnings, Workspace, locked,
};
use sarrus_models::{Options, Source, load};

use super::draw::{Drawn, Features, draw, pivot_at_zero};
use super::oracle::Oracle;
use super::text::written;
use crate::seed::Seeded;

/// Error by size up to which an answer without a warning is right.
const HELD: f64 = 1e-9;
/// Least pivot of a path on which the assembly counts as certain, and of a zero pose.
const REGULAR: f64 = 0.03;

/// Steps of a path, and those that decide about a difference.
const COARSE: f64 = 0.1;
const FINE: f64 = 3e-4;
/// States of each robot, which takes as long to compile as three states to judge.
const STATES: usize = 8;
/// Share of the unreachable states whose nearest y is sought, which takes as long as ten states.
const SOUGHT: f64 = 0.1;

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
    (
        "simulation x springs x limits x locks",
        Features { simulated: true, springs: true, limits: true, locks: true, ..NONE },
    ),
    (
        "sums x views x far x floating",
        Features { sums: true, far: true, floating: true, balls: true, ..NONE },
    ),
    (
        "sums x views x locks x mimic x sizes",
        Features { sums: true, locks: true, mimic: true, sizes: true, springs: true, ..NONE },
    ),
    (
        "oblique x numerical x actuators",
        Features { oblique: true, numerical: true, actuators: true, balls: true, ..NONE },
    ),
    (
        "curves x loops x files x locks",
        Features { curves: true, mimic: true, files: true, locks: true, springs: true, ..NONE },
    ),
    (
        "curves x sums x sizes",
        Features { curves: true, mimic: true, sums: true, sizes: true, ..NONE },
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
    oblique: false,
    curves: false,
    sums: false,
    simulated: false,
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
    let (mut compiled, mut read) = match compiled(&drawn, with, seed, ledger) {
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
                Ok(reduced) => {
                    (compiled, read) = (reduced, found.description);
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
    let model = &compiled.model;
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
    let driving = left.iter().chain(&held).copied().collect();
    let judge = Judge {
        pair,
        seed,
        drawn: &drawn,
        of,
        oracle,
        rows_of: drawn.oblique.as_ref().unwrap_or(of),
        description: &read,
        model,
        shared: Arc::new(model.clone()),
        held: locks.iter().filter_map(|lock| Some((lock.joint, lock.position?))).collect(),
        independent,
        driving,
        is_reduced,
    };
    // files take longer to read than a state to judge
    for _ in 0..if with.files { 2 * STATES } else { STATES } {
        ledger.cases += 1;
        if with.simulated {
            judge.simulated(&compiled, &mut seeded, ledger);
        } else {
            judge.state(with, &mut seeded, ledger);
        }
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
    let of = drawn.oblique.as_ref().unwrap_or(&drawn.description);
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
    /// It with the rows as they are given, and as it was compiled.
    rows_of: &'a Description,
    description: &'a Description,
    oracle: Oracle<'a>,
    model: &'a Model,
    shared: Arc<Model>,
    held: Vec<(usize, f64)>,
    /// Independent joints of the whole robot.
    independent: Vec<usize>,
    /// Those that are left, and the locked joints in place of the others.
    driving: Vec<usize>,
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
        let mut cuts = self.rows_of.submechanisms.iter().flat_map(|part| &part.loops);
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
            let whole = Oracle::new(self.of, &self.driving, &[], self.drawn.length);
            let all = Oracle::new(self.of, &self.independent, &[], self.drawn.length);
            if whole.independents().len() != all.independents().len() {
                return None;
            }
            let lock = |(j, x): &(usize, f64)| (whole.coordinate(*j), *x);
            let locks: Vec<(usize, f64)> = self.held.iter().map(lock).collect();
            start = whole.follow(zero, &locks, step)?;
        }
        let (q, pivot) = self.oracle.follow(&start.0, targets, step)?;
        Some((q, start.1.min(pivot)))
    }
}
