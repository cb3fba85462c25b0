//! What is measured in process: robot × how its loops are closed × where Newton starts × what is asked.

use sarrus_dynamics::{Answer, ClosureKind, Compiled, Field, FieldSet, Plan, Request, Status, Wanted, Workspace};
use sarrus_models::{Loaded, Options, Source, bundled_text, load};

use crate::Outcome;
use crate::states::{Robot, State};

/// The bundled robots that are measured.
pub(crate) const ROBOTS: [&str; 7] = ["lambda", "torso", "ankle", "wrist", "stewart", "rh5v2_upper_body", "rh5v2_full"];

/// A robot with its loops closed in one way.
pub(crate) struct Variant {
    pub(crate) closures: &'static str,
    pub(crate) compiled: Compiled,
}

/// A way to close loops: its name and the types that are made `NUMERICAL`.
type Way = (&'static str, fn(&str) -> bool);

const NUMERICAL: Way = ("numerical", |_| true);
const WAYS_OF_UPPER_BODY: [Way; 2] = [("hybrid-torso", |kind| kind == "2SPU+1U"), ("hybrid-elbows", |kind| kind == "RRPR")];

/// The robot as it is bundled, then with closed forms replaced by Newton's method. `wanted` skips what need not be loaded.
pub(crate) fn variants(robot: &'static str, wanted: impl Fn(&str) -> bool) -> Outcome<(Loaded, Vec<Variant>)> {
    let bundled = load(&Source::Bundled(robot.to_owned()), &Options::default())?;
    let mut kept = Vec::new();
    let has = |kind: ClosureKind| bundled.compiled.model.closures().iter().any(|closure| closure.kind == kind);
    let closures = match (has(ClosureKind::Analytic), has(ClosureKind::Numerical)) {
        (true, true) => "hybrid",
        (false, true) => "numerical",
        _ => "analytic",
    };
    if wanted(closures) {
        kept.push(Variant { closures, compiled: bundled.compiled.clone() });
    }

    let (urdf, submechanisms) = bundled_text(robot).ok_or("no such robot")?;
    let ways = if robot == "rh5v2_upper_body" { &WAYS_OF_UPPER_BODY[..] } else { &[] };
    for &(name, changes) in ways.iter().chain(std::iter::once(&NUMERICAL)) {
        if name == closures || !wanted(name) {
            continue;
        }
        let source = Source::Text { urdf: urdf.into(), submechanisms: Some(made_numerical(submechanisms, changes).into()) };
        kept.push(Variant { closures: name, compiled: load(&source, &Options::default())?.compiled });
    }
    Ok((bundled, kept))
}

/// The submechanism file with `type: NUMERICAL` for every closed loop that `changes` names.
fn made_numerical(submechanisms: &str, changes: fn(&str) -> bool) -> String {
    let line = |line: &str| match line.split_once("type: ") {
        Some((before, kind)) if before.trim().is_empty() && kind != "SERIAL" && changes(kind) => format!("{before}type: NUMERICAL\n"),
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
pub(crate) enum Question {
    /// q, q̇, q̈, u, u̇, ü from y, ẏ, ÿ.
    State,
    /// τ_u from y, ẏ, ÿ.
    InverseDynamics,
    /// ÿ from y, ẏ, τ_u.
    ForwardDynamics,
}

impl Question {
    const ALL: [Question; 3] = [Question::State, Question::InverseDynamics, Question::ForwardDynamics];

    pub(crate) fn name(self) -> &'static str {
        ["state", "ID", "FD"][self as usize]
    }

    pub(crate) fn wanted(self) -> Wanted {
        use Field::*;
        let motion = FieldSet::of(&[Y, Yd, Ydd]);
        match self {
            Question::State => Wanted::new(Request::Kinematics, motion, FieldSet::of(&[Q, Qd, Qdd, U, Ud, Udd])),
            Question::InverseDynamics => Wanted::new(Request::InverseDynamics, motion, FieldSet::of(&[TauU])),
            Question::ForwardDynamics => Wanted::new(Request::ForwardDynamics, FieldSet::of(&[Y, Yd, TauU]), FieldSet::of(&[Ydd])),
        }
    }
}

/// One row of the table.
pub(crate) struct Case<'a> {
    pub(crate) robot: &'a Robot,
    pub(crate) variant: &'a Variant,
    pub(crate) start: Start,
    pub(crate) question: Question,
    pub(crate) plan: Plan,
    /// One packed input for each state.
    pub(crate) inputs: Vec<Vec<f64>>,
    workspace: Workspace<f64>,
    pub(crate) output: Vec<f64>,
}

/// Every case of a robot.
pub(crate) fn of_robot(robot: &Robot) -> Outcome<Vec<Case<'_>>> {
    let mut cases = Vec::new();
    for (k, variant) in robot.variants.iter().enumerate() {
        let starts: &[Start] = if variant.closures == "analytic" { &[Start::None] } else { &[Start::Warm, Start::Cold] };
        for &start in starts {
            for question in Question::ALL {
                cases.push(Case::new(robot, k, start, question)?);
            }
        }
    }
    Ok(cases)
}

impl<'a> Case<'a> {
    fn new(robot: &'a Robot, variant: usize, start: Start, question: Question) -> Outcome<Case<'a>> {
        let model = &robot.variants[variant].compiled.model;
        let mut wanted = question.wanted();
        if start == Start::Warm {
            wanted.given = wanted.given.with(Field::QGuess);
        }
        let plan = Plan::new(model, &wanted)?;
        let inputs = robot.states.iter().map(|state| packed(&plan, state, variant)).collect();
        let output = vec![0.0; plan.want().len()];
        Ok(Case { robot, variant: &robot.variants[variant], start, question, inputs, workspace: Workspace::new(model), output, plan })
    }

    /// The name that `--only` and `--count` see.
    pub(crate) fn name(&self) -> String {
        let start = ["", "/warm", "/cold"][self.start as usize];
        format!("{}/{}{start}/{}", self.robot.name, self.variant.closures, self.question.name())
    }

    /// One call on the state of this number.
    #[inline]
    pub(crate) fn run(&mut self, state: usize) -> Answer {
        self.plan.run(&self.variant.compiled.model, &mut self.workspace, std::hint::black_box(&self.inputs[state]), &mut self.output)
    }

    /// One call that must succeed.
    pub(crate) fn answer(&mut self, state: usize) -> Outcome<&[f64]> {
        match self.run(state).status {
            Status::Ok => Ok(&self.output),
            status => Err(format!("{}, state {state}: {status}", self.name()).into()),
        }
    }
}

/// The numbers of a state in the order of a plan.
pub(crate) fn packed(plan: &Plan, state: &State, variant: usize) -> Vec<f64> {
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
