//! What is measured in process: robot × how its loops are closed × where Newton starts × what is
//! asked.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::{
    Answer, ClosureKind, Compiled, Field, FieldSet, Method, Model, Plan, Query, Request, Status,
    Workspace,
};
use sarrus_models::{Options, Source, bundled_text, load};

use crate::Outcome;
use crate::chain::chain_of_lambdas;
use crate::extra::TEXTS;
use crate::states::{Robot, State};
use crate::timing::Timed;

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

/// What is loaded at once: its variants share their states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// By name.
    Bundled(&'static str),
    /// One of the small ones, by its place.
    Text(usize),
    /// A row of lambdas, by its place.
    Chain(usize),
}

impl What {
    /// Every robot that is measured.
    pub(crate) fn all() -> impl Iterator<Item = What> {
        let texts = (0..TEXTS.len()).map(What::Text);
        BUNDLED
            .into_iter()
            .map(What::Bundled)
            .chain(texts)
            .chain((0..CHAINS.len()).map(What::Chain))
    }

    /// The first part of the cases' names.
    pub(crate) fn name(self) -> &'static str {
        match self {
            What::Bundled(name) => name,
            What::Text(k) => TEXTS[k].name,
            What::Chain(_) => "chain",
        }
    }

    /// True where its cases may have this in their names.
    pub(crate) fn may_have(self, only: &str) -> bool {
        let prefix = match self {
            What::Chain(k) => format!("chain/{}", CHAINS[k].0),
            _ => self.name().to_owned(),
        };
        // every robot has to be loaded where the query names none
        let names_one = What::all().any(|what| only.starts_with(&format!("{}/", what.name())));
        !names_one || only.starts_with(&format!("{prefix}/")) || prefix.starts_with(only)
    }

    /// How many of the states of a run it takes: long chains take milliseconds.
    pub(crate) fn states(self, all: usize) -> usize {
        match self {
            What::Chain(k) => all.min([64, 16, 4][k]),
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
type Way = (&'static str, fn(&str) -> bool);

const NUMERICAL: Way = ("numerical", |_| true);
const WAYS_OF_UPPER_BODY: [Way; 2] =
    [("hybrid-torso", |kind| kind == "2SPU+1U"), ("hybrid-elbows", |kind| kind == "RRPR")];

/// The robot as it is given, then with closed forms replaced by Newton's method. `wanted` skips
/// what need not be loaded.
pub(crate) fn variants(
    what: What,
    query: impl Fn(&str) -> bool,
) -> Outcome<(Description, Vec<Variant>)> {
    let (urdf, submechanisms) = match what {
        What::Bundled(name) => {
            let (urdf, submechanisms) = bundled_text(name).ok_or("no such robot")?;
            (urdf.to_owned(), submechanisms)
        }
        What::Text(k) => (TEXTS[k].urdf(), TEXTS[k].submechanisms),
        What::Chain(k) => {
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

    let ways =
        if what == What::Bundled("rh5v2_upper_body") { &WAYS_OF_UPPER_BODY[..] } else { &[] };
    // couplings without loops have no other way
    let loops = submechanisms.contains("loop_constraints");
    for &(name, changes) in ways.iter().chain(std::iter::once(&NUMERICAL)) {
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

/// Where Newton's method starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// Nothing is iterated.
    None,
    /// From the closed pose 1 ms earlier at the state's velocity.
    Warm,
    /// Without a guess.
    Cold,
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Question {
    /// q, q̇, q̈, u, u̇, ü from y, ẏ, ÿ.
    State,
    /// τ_u from y, ẏ, ÿ.
    InverseDynamics,
    /// ÿ from y, ẏ, τ_u, by the method that the model chooses.
    ForwardDynamics,
    /// The same by this method.
    Forced(Method),
}

impl Question {
    /// Questions with the method that the model chooses, and then forced.
    const CHOSEN: [Question; 3] =
        [Question::State, Question::InverseDynamics, Question::ForwardDynamics];
    const FORCED: [Question; 3] = [
        Question::Forced(Method::Recursion),
        Question::Forced(Method::Projection),
        Question::Forced(Method::Kkt),
    ];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Question::State => "state",
            Question::InverseDynamics => "ID",
            Question::ForwardDynamics => "FD",
            Question::Forced(Method::Recursion) => "FD-recursion",
            Question::Forced(Method::Projection) => "FD-projection",
            Question::Forced(Method::Kkt) => "FD-kkt",
        }
    }

    /// True for forward dynamics by any method.
    pub(crate) fn is_forward(self) -> bool {
        matches!(self, Question::ForwardDynamics | Question::Forced(_))
    }

    /// What is given and what is wanted.
    pub fn query(self) -> Query {
        use Field::*;
        let motion = FieldSet::of(&[Y, Yd, Ydd]);
        match self {
            Question::State => {
                Query::new(Request::Kinematics, motion, FieldSet::of(&[Q, Qd, Qdd, U, Ud, Udd]))
            }
            Question::InverseDynamics => {
                Query::new(Request::InverseDynamics, motion, FieldSet::of(&[TauU]))
            }
            Question::ForwardDynamics | Question::Forced(_) => Query::new(
                Request::ForwardDynamics,
                FieldSet::of(&[Y, Yd, TauU]),
                FieldSet::of(&[Ydd]),
            ),
        }
    }
}

/// One row of the table.
pub(crate) struct Case<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) variant: &'a Variant,
    /// Place of the variant among those of its robot.
    pub(crate) place: usize,
    pub(crate) start: Start,
    pub(crate) question: Question,
    pub(crate) plan: Plan,
    /// One packed input for each state.
    pub(crate) inputs: Vec<Vec<f64>>,
    workspace: Workspace<f64>,
    pub(crate) output: Vec<f64>,
}

/// Every case of a robot. A cold start says nothing more about methods, and M_y of a long chain
/// does not fit.
pub(crate) fn of_robot(robot: &Robot) -> Outcome<Vec<Case<'_>>> {
    let mut cases = Vec::new();
    let chain = matches!(robot.what, What::Chain(_));
    for (k, variant) in robot.variants.iter().enumerate() {
        let closed_form = chain || variant.closures == "analytic";
        let starts: &[Start] =
            if closed_form { &[Start::None] } else { &[Start::Warm, Start::Cold] };
        for &start in starts {
            let forced = Question::FORCED.into_iter().filter(|_| start != Start::Cold);
            for question in Question::CHOSEN.into_iter().chain(forced) {
                let square = matches!(question, Question::Forced(Method::Projection | Method::Kkt));
                if !(square && variant.compiled.model.sizes().n_v > LARGEST_SQUARE) {
                    cases.push(Case::new(robot, k, start, question)?);
                }
            }
        }
    }
    Ok(cases)
}

/// Tree velocities up to which methods with square matrices are measured.
const LARGEST_SQUARE: usize = 100;

impl<'a> Case<'a> {
    fn new(
        robot: &'a Robot,
        variant: usize,
        start: Start,
        question: Question,
    ) -> Outcome<Case<'a>> {
        let model = &robot.variants[variant].compiled.model;
        let mut query = question.query();
        if start == Start::Warm {
            query.given = query.given.with(Field::QGuess);
        }
        let plan = match question {
            Question::Forced(method) => Plan::with_method(model, &query, method)?,
            _ => Plan::new(model, &query)?,
        };
        let inputs = robot.states.iter().map(|state| packed(&plan, state, variant)).collect();
        let output = vec![0.0; plan.want().len()];
        let workspace = Workspace::for_plans(model, [&plan]);
        Ok(Case {
            robot,
            variant: &robot.variants[variant],
            place: variant,
            start,
            question,
            inputs,
            workspace,
            output,
            plan,
        })
    }

    /// The name that `--only` and `--count` see.
    pub(crate) fn name(&self) -> String {
        let start = ["", "/warm", "/cold"][self.start as usize];
        format!(
            "{}/{}{start}/{}",
            self.robot.what.name(),
            self.variant.closures,
            self.question.name()
        )
    }

    /// One call on the state of this number.
    #[inline]
    pub(crate) fn run(&mut self, state: usize) -> Answer {
        self.plan.run(
            &self.variant.compiled.model,
            &mut self.workspace,
            std::hint::black_box(&self.inputs[state]),
            &mut self.output,
        )
    }

    /// One call that must succeed.
    pub(crate) fn answer(&mut self, state: usize) -> Outcome<&[f64]> {
        match self.run(state).status {
            Status::Ok => Ok(&self.output),
            status => Err(format!("{}, state {state}: {status}", self.name()).into()),
        }
    }
}

impl Timed for Case<'_> {
    fn name(&self) -> String {
        Case::name(self)
    }

    fn states(&self) -> usize {
        self.inputs.len()
    }

    #[inline]
    fn call(&mut self, state: usize) -> Status {
        let status = self.run(state).status;
        std::hint::black_box(&self.output);
        status
    }
}

/// The numbers of a state in the order of a plan.
pub fn packed(plan: &Plan, state: &State, variant: usize) -> Vec<f64> {
    let mut input = vec![0.0; plan.given().len()];
    for slot in plan.given().slots() {
        let numbers = match slot.field {
            Field::Y => &state.y,
            Field::Yd => &state.yd,
            Field::Ydd => &state.ydd,
            Field::TauU => &state.tau_u,
            _ => &state.guesses[variant],
        };
        input[slot.range()].copy_from_slice(numbers);
    }
    input
}
