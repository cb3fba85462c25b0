//! The cases measured in process: robot × closure method × start of Newton's method × question.

use std::hint::black_box;

use sarrus_dynamics::{Answer, Field, Method, Plan, Status, Workspace};
use sarrus_report::Outcome;
use sarrus_report::measure::timing::Timed;
use sarrus_report::robots::{Question, Robot, Start, Subject, Variant, packed};

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

/// Every timed case of a robot. A cold start adds no information about methods, and M_y of a long
/// chain does not fit.
pub(crate) fn of_robot(robot: &Robot) -> Outcome<Vec<Case<'_>>> {
    let mut cases = Vec::new();
    for (k, variant) in robot.variants.iter().enumerate() {
        for &start in starts(robot, variant) {
            let forced = [Method::Recursion, Method::Projection, Method::Kkt];
            let forced = forced.map(Question::Forced).into_iter();
            let forced = forced.filter(|_| start != Start::Cold);
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

/// The cases that are counted only: the robot at rest, derivatives.
pub(crate) fn counted(robot: &Robot) -> Outcome<Vec<Case<'_>>> {
    let mut cases = Vec::new();
    for (k, variant) in robot.variants.iter().enumerate() {
        for &start in starts(robot, variant) {
            for question in
                [Question::Gravity, Question::InverseDerivatives, Question::ForwardDerivatives]
            {
                cases.push(Case::new(robot, k, start, question)?);
            }
        }
    }
    Ok(cases)
}

/// Where Newton's method starts, if there is something to iterate.
fn starts(robot: &Robot, variant: &Variant) -> &'static [Start] {
    if matches!(robot.subject, Subject::Chain(_)) || variant.closures == "analytic" {
        &[Start::None]
    } else {
        &[Start::Warm, Start::Cold]
    }
}

/// Tree velocities up to which methods with square matrices are measured.
const LARGEST_SQUARE: usize = 100;

impl<'a> Case<'a> {
    pub(crate) fn new(
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
            self.robot.subject.name(),
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
            black_box(&self.inputs[state]),
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

/// The only function whose instructions are counted: loading a robot takes another number of
/// them in every run.
#[inline(never)]
pub(crate) fn passes(case: &mut Case<'_>, repeats: usize) -> Outcome {
    for _ in 0..repeats {
        for state in 0..case.inputs.len() {
            black_box(case.answer(state)?);
        }
    }
    Ok(())
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
        black_box(&self.output);
        status
    }
}
