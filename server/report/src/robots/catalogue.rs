//! The measured robots, and the ways to close their loops.

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{ClosureKind, Compiled, Model};
use sarrus_models::{Loaded, Options, Source, load};

use super::chain::chain_of_lambdas;
use super::rare::RARE;
use crate::Outcome;

/// The names of the bundled robots.
pub(crate) fn bundled_names() -> Vec<&'static str> {
    sarrus_models::bundled().map(|(name, _)| name).collect()
}

/// Chains of lambdas, with the name of their closure and the most states: long chains take
/// milliseconds.
const CHAINS: [(&str, usize, usize); 3] = [("10", 10, 64), ("100", 100, 16), ("1000", 1000, 4)];

/// A robot, loaded once: its variants share their states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// By name.
    Bundled(&'static str),
    /// A small robot, by its index.
    Rare(usize),
    /// A chain of lambdas, by its index.
    Chain(usize),
    /// Somebody's robot.
    Own(Own),
}

/// Somebody's robot; it lives as long as the program.
#[derive(Clone, Copy, Debug)]
pub struct Own(&'static Description, Option<&'static Loaded>);

impl Own {
    /// Keeps this description.
    pub fn new(description: Description) -> Own {
        Own(Box::leak(Box::new(description)), None)
    }

    /// Keeps a robot with its files, which peers read.
    pub fn with_files(loaded: Loaded) -> Own {
        let loaded = Box::leak(Box::new(loaded));
        Own(&loaded.description, Some(loaded))
    }
}

impl PartialEq for Own {
    fn eq(&self, other: &Own) -> bool {
        core::ptr::eq(self.0, other.0)
    }
}

impl Eq for Own {}

impl Subject {
    /// Every measured robot.
    pub fn all() -> impl Iterator<Item = Subject> {
        let rare = (0..RARE.len()).map(Subject::Rare);
        let chains = (0..CHAINS.len()).map(Subject::Chain);
        bundled_names().into_iter().map(Subject::Bundled).chain(rare).chain(chains)
    }

    /// The first part of the cases' names.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Bundled(name) => name,
            Subject::Rare(k) => RARE[k].0,
            Subject::Chain(_) => "chain",
            Subject::Own(of) => &of.0.name,
        }
    }

    /// The robot with its files; none without.
    pub(crate) fn loaded(self) -> Outcome<Option<&'static Loaded>> {
        Ok(match self {
            Subject::Bundled(name) => Own::with_files(loaded(name)?).1,
            Subject::Own(own) => own.1,
            Subject::Rare(_) | Subject::Chain(_) => None,
        })
    }

    fn description(self) -> Outcome<Description> {
        match self {
            Subject::Bundled(name) => bundled(name),
            Subject::Rare(k) => RARE[k].1(),
            Subject::Chain(k) => Ok(chain_of_lambdas(CHAINS[k].1)?),
            Subject::Own(of) => Ok(of.0.clone()),
        }
    }

    /// True if the names of its cases may contain this.
    pub fn may_have(self, only: &str) -> bool {
        let prefix = match self {
            Subject::Chain(k) => format!("chain/{}", CHAINS[k].0),
            _ => self.name().to_owned(),
        };
        // every robot must be loaded if the query names none
        let names_one =
            Subject::all().any(|subject| only.starts_with(&format!("{}/", subject.name())));
        !names_one || only.starts_with(&format!("{prefix}/")) || prefix.starts_with(only)
    }

    /// Number of states of a run that it uses.
    pub fn states(self, all: usize) -> usize {
        match self {
            Subject::Chain(k) => all.min(CHAINS[k].2),
            _ => all,
        }
    }
}

/// A robot with one way to close its loops.
#[derive(Debug)]
pub struct Variant {
    /// The name of the way.
    pub closures: &'static str,
    /// The f64 model and its double-double twin.
    pub compiled: Compiled,
}

/// A way to close loops: its name and the types that are made `NUMERICAL`.
type Closing = (&'static str, fn(Kind) -> bool);

const NUMERICAL: Closing = ("numerical", |_| true);
const HYBRIDS_OF_UPPER_BODY: [Closing; 2] =
    [("hybrid-torso", |kind| kind == Kind::Spu2U1), ("hybrid-elbows", |kind| kind == Kind::Rrpr)];

/// The robot with its own closures, then with closed forms replaced by Newton's method. `query`
/// skips variants that need not be loaded.
pub fn variants(
    subject: Subject,
    query: impl Fn(&str) -> bool,
) -> Outcome<(Description, Vec<Variant>)> {
    let description = subject.description()?;
    let mut kept = Vec::new();
    let compiled = Model::compile(&description)?;
    let given = match subject {
        Subject::Chain(k) => CHAINS[k].0,
        _ => closures(&compiled.model).unwrap_or("analytic"),
    };
    if query(given) {
        kept.push(Variant { closures: given, compiled });
    }
    let hybrids = if subject == Subject::Bundled("rh5v2_upper_body") {
        &HYBRIDS_OF_UPPER_BODY[..]
    } else {
        &[]
    };
    // couplings without loops have no other way, and chains vary in length only
    let has_loops = !matches!(subject, Subject::Chain(_))
        && description.submechanisms.iter().any(|part| !part.loops.is_empty());
    for &(closures, which) in hybrids.iter().chain([&NUMERICAL]) {
        if has_loops && closures != given && query(closures) {
            let compiled = Model::compile(&by_newton(description.clone(), which))?;
            kept.push(Variant { closures, compiled });
        }
    }
    Ok((description, kept))
}

/// The kind of a model's closures, in a word; none without loops.
pub(crate) fn closures(model: &Model) -> Option<&'static str> {
    let has = |kind| model.closures().iter().any(|closure| closure.kind == kind);
    match (has(ClosureKind::Analytic), has(ClosureKind::Numerical)) {
        (true, true) => Some("hybrid"),
        (true, false) => Some("analytic"),
        (false, true) => Some("numerical"),
        (false, false) => None,
    }
}

/// The description of a bundled robot.
pub(crate) fn bundled(name: &str) -> Outcome<Description> {
    Ok(loaded(name)?.description)
}

fn loaded(name: &str) -> Outcome<Loaded> {
    Ok(load(&Source::Bundled(name.to_owned()), &Options::default())?)
}

/// The robot with every loop closed by Newton's method.
pub(crate) fn numerical(robot: Description) -> Description {
    by_newton(robot, |_| true)
}

/// The robot with the loops of some types closed by Newton's method.
fn by_newton(mut robot: Description, which: fn(Kind) -> bool) -> Description {
    for part in robot.submechanisms.iter_mut() {
        if !part.loops.is_empty() && which(part.kind) {
            part.closed_forms = false;
        }
    }
    robot
}
