//! The robots that are measured, and the ways in which their loops are closed.

use sarrus_dynamics::description::{Description, SubmechanismKind};
use sarrus_dynamics::{ClosureKind, Compiled, Model};
use sarrus_models::{Options, Source, bundled_text, load};

use super::chain::chain_of_lambdas;
use super::texts::TEXTS;
use crate::Outcome;

/// The bundled robots: all of them.
pub(crate) const BUNDLED: [&str; 16] = [
    "lambda",
    "torso",
    "ankle",
    "parallelogram",
    "wrist",
    "stewart",
    "stewart_floating",
    "r3_lambda_r",
    "five_bar",
    "four_bars_2",
    "delta",
    "active_ankle",
    "bricard",
    "squeezer",
    "rh5v2_upper_body",
    "rh5v2_full",
];
/// Lambdas in a chain, by the name that stands for how its loops are closed.
const CHAINS: [(&str, usize); 3] = [("10", 10), ("100", 100), ("1000", 1000)];

/// A robot that is loaded once: its variants share their states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// By name.
    Bundled(&'static str),
    /// One of the small ones, by its place.
    Text(usize),
    /// A row of lambdas, by its place.
    Chain(usize),
}

impl Subject {
    /// Every robot that is measured.
    pub fn all() -> impl Iterator<Item = Subject> {
        let texts = (0..TEXTS.len()).map(Subject::Text);
        BUNDLED
            .into_iter()
            .map(Subject::Bundled)
            .chain(texts)
            .chain((0..CHAINS.len()).map(Subject::Chain))
    }

    /// The first part of the cases' names.
    pub fn name(self) -> &'static str {
        match self {
            Subject::Bundled(name) => name,
            Subject::Text(k) => TEXTS[k].name,
            Subject::Chain(_) => "chain",
        }
    }

    /// True where its cases may have this in their names.
    pub fn may_have(self, only: &str) -> bool {
        let prefix = match self {
            Subject::Chain(k) => format!("chain/{}", CHAINS[k].0),
            _ => self.name().to_owned(),
        };
        // every robot has to be loaded where the query names none
        let names_one =
            Subject::all().any(|subject| only.starts_with(&format!("{}/", subject.name())));
        !names_one || only.starts_with(&format!("{prefix}/")) || prefix.starts_with(only)
    }

    /// How many of the states of a run it takes: long chains take milliseconds.
    pub fn states(self, all: usize) -> usize {
        match self {
            Subject::Chain(k) => all.min([64, 16, 4][k]),
            _ => all,
        }
    }
}

/// A robot with its loops closed in one way.
#[derive(Debug)]
pub struct Variant {
    /// The name of the way.
    pub closures: &'static str,
    /// The model for work and its double-double twin.
    pub compiled: Compiled,
}

/// A way to close loops: its name and the types that are made `NUMERICAL`.
type Closing = (&'static str, fn(&str) -> bool);

const NUMERICAL: Closing = ("numerical", |_| true);
const CLOSINGS_OF_UPPER_BODY: [Closing; 2] =
    [("hybrid-torso", |kind| kind == "2SPU+1U"), ("hybrid-elbows", |kind| kind == "RRPR")];

/// The robot as it is given, then with closed forms replaced by Newton's method. `query` skips
/// variants that need not be loaded.
pub fn variants(
    subject: Subject,
    query: impl Fn(&str) -> bool,
) -> Outcome<(Description, Vec<Variant>)> {
    let (urdf, submechanisms) = match subject {
        Subject::Bundled(name) => {
            let (urdf, submechanisms) = bundled_text(name).ok_or("no such robot")?;
            (urdf.to_owned(), submechanisms)
        }
        Subject::Text(k) => (TEXTS[k].urdf(), TEXTS[k].submechanisms),
        Subject::Chain(k) => {
            let (closures, n) = CHAINS[k];
            let description = chain_of_lambdas(n)?;
            let compiled = if query(closures) {
                vec![Variant { closures, compiled: Model::compile(&description)? }]
            } else {
                vec![]
            };
            return Ok((description, compiled));
        }
    };
    let read = |submechanisms: String| {
        let source =
            Source::Text { urdf: urdf.clone().into(), submechanisms: Some(submechanisms.into()) };
        load(&source, &Options::default())
    };
    let given = read(submechanisms.to_owned())?;
    let mut kept = Vec::new();
    let has = |kind: ClosureKind| {
        given.compiled.model.closures().iter().any(|closure| closure.kind == kind)
    };
    let closures = match (has(ClosureKind::Analytic), has(ClosureKind::Numerical)) {
        (true, true) => "hybrid",
        (false, true) => "numerical",
        _ => "analytic",
    };
    if query(closures) {
        kept.push(Variant { closures, compiled: given.compiled });
    }

    let closings = if subject == Subject::Bundled("rh5v2_upper_body") {
        &CLOSINGS_OF_UPPER_BODY[..]
    } else {
        &[]
    };
    // couplings without loops have no other way
    let loops = submechanisms.contains("loop_constraints");
    for &(name, changes) in closings.iter().chain(std::iter::once(&NUMERICAL)) {
        if name == closures || !query(name) || !loops {
            continue;
        }
        kept.push(Variant {
            closures: name,
            compiled: read(made_numerical(submechanisms, changes))?.compiled,
        });
    }
    Ok((given.description, kept))
}

/// The robot with every loop closed by Newton's method.
pub(crate) fn numerical(mut robot: Description) -> Description {
    for part in robot.submechanisms.iter_mut().filter(|part| !part.loops.is_empty()) {
        part.kind = SubmechanismKind::Numerical;
    }
    robot
}

/// The submechanism file with `type: NUMERICAL` for every closed loop that `changes` names.
fn made_numerical(submechanisms: &str, changes: fn(&str) -> bool) -> String {
    let line = |line: &str| match line.split_once("type: ") {
        Some((before, kind))
            if before.trim_matches([' ', '-']).is_empty() && kind != "SERIAL" && changes(kind) =>
        {
            format!("{before}type: NUMERICAL\n")
        }
        _ => format!("{line}\n"),
    };
    submechanisms.lines().map(line).collect()
}
