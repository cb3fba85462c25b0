//! One case and its result; a collector that asks, compares and assesses.

use std::borrow::Cow;

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, Method, Request, Status, Warnings};

use super::assess::{HELD, assess};
use super::question::{Answered, Question, State, backward_error, error};
use super::robot::Robot;
use crate::Outcome;
use crate::page::Assessment;
pub(crate) use crate::page::Case;

/// The reference of an answer.
pub(crate) enum Reference<'a> {
    /// The question itself in double-double.
    Same,
    /// Another question in double-double, whose answer is exact.
    Of(&'a Question),
    /// Numbers by closed form.
    Known(Vec<(Field, Vec<Dd>)>),
    /// No answer exists: any that is ok is wrong.
    None,
}

/// The cases of a run.
#[derive(Default)]
pub(crate) struct Cases {
    pub(crate) all: Vec<Case>,
    /// Number of cases with an unreliable reference.
    pub(crate) not_judged: usize,
    family: &'static str,
    parameter: &'static str,
}

/// The position of a case in its family: the parameter's value and the method's name.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    pub(crate) value: f64,
    pub(crate) method: &'a str,
}

impl At<'_> {
    /// At a value, with the robot's kind of closure.
    pub(crate) fn of(robot: &Robot, value: f64) -> At<'static> {
        At { value, method: robot.closures() }
    }
}

impl Cases {
    /// The cases that follow are of this family.
    pub(crate) fn family(&mut self, family: &'static str, parameter: &'static str) {
        (self.family, self.parameter) = (family, parameter);
    }

    /// A case with its position only.
    pub(crate) fn blank(&self, robot: &str, at: At<'_>, asked: &str) -> Case {
        Case {
            family: self.family,
            robot: robot.to_owned(),
            parameter: self.parameter,
            value: at.value,
            method: at.method.to_owned(),
            asked: asked.to_owned(),
            reference: "double-double",
            ..Case::default()
        }
    }

    /// A case without warnings: its status, its error if it is ok, and the check for NaN in a
    /// failed answer.
    pub(crate) fn ended(
        &self,
        robot: &str,
        at: At<'_>,
        asked: &str,
        (status, error, empty): (Status, Option<f64>, bool),
    ) -> Case {
        Case {
            status: status.name().to_owned(),
            error,
            assessment: assess(status, Warnings::NONE, error.unwrap_or(f64::INFINITY), empty),
            ..self.blank(robot, at, asked)
        }
    }

    /// A case with the status, the warnings and the assessment of an answer with this error.
    pub(crate) fn answered(
        &self,
        robot: &Robot,
        at: At<'_>,
        asked: &str,
        answer: &Answered<f64>,
        error: Option<f64>,
    ) -> Case {
        let status = answer.status();
        let warnings = answer.warnings();
        let size = error.unwrap_or(f64::INFINITY);
        Case {
            warnings: warnings.names().map(str::to_owned).collect(),
            assessment: assess(status, warnings, size, answer.is_empty()),
            ..self.ended(&robot.name, at, asked, (status, error, false))
        }
    }

    /// Adds a case that ended before any question.
    pub(crate) fn refused(
        &mut self,
        robot: &str,
        at: At<'_>,
        asked: &str,
        status: &str,
        reported: String,
    ) {
        self.all.push(Case {
            status: status.to_owned(),
            reported,
            assessment: Assessment::Failed,
            reference: "-",
            ..self.blank(robot, at, asked)
        });
    }

    /// Loads a robot at a value of the parameter; a refused one is a separate case that reports the
    /// error.
    pub(crate) fn load(&mut self, name: &str, at: At<'_>, of: Description) -> Option<Robot> {
        Robot::new(name, of)
            .map_err(|error| self.refused(name, at, "load", "refused at load", error.to_string()))
            .ok()
    }

    /// Asks, compares, assesses.
    pub(crate) fn ask(
        &mut self,
        robot: &Robot,
        at: At<'_>,
        asked: &str,
        ask: &Question,
        reference: &Reference<'_>,
    ) -> Outcome<&mut Case> {
        let answer = ask.run(&robot.compiled.model)?;
        let ok = answer.status() == Status::Ok;
        let (numbers, source) =
            if ok { reference_numbers(robot, ask, reference)? } else { (None, "-") };
        let worst = |exact: Vec<(Field, Vec<Dd>)>| {
            let error = |(field, exact): &(Field, Vec<Dd>)| {
                error(robot, *field, answer.get(*field), exact, 0.0)
            };
            exact.iter().map(error).fold(0.0, f64::max)
        };
        let error = ok.then(|| numbers.map_or(f64::INFINITY, worst));
        let forward = ok
            && ask.request == Request::ForwardDynamics
            && ask.given.iter().any(|(field, _)| *field == Field::TauY);
        let backward = if forward && matches!(reference, Reference::Same) {
            Some(backward_error(robot, ask, &answer)?)
        } else {
            None
        };
        self.all.push(Case {
            reference: source,
            backward,
            reported: if error.is_some_and(|error| error > HELD) {
                figures(robot, ask)?
            } else {
                reported(robot, ask, &answer)?
            },
            ..self.answered(robot, at, asked, &answer, error)
        });
        self.all.last_mut().ok_or_else(|| "no case".into())
    }

    /// Kinematics, inverse dynamics and forward dynamics at a state, against double-double;
    /// `methods` of forward dynamics.
    pub(crate) fn questions(
        &mut self,
        robot: &Robot,
        value: f64,
        state: &State,
        kinematics: bool,
        methods: &[Method],
    ) -> Outcome {
        let closures = robot.closures();
        let at = At { value, method: closures };
        if kinematics {
            self.ask(robot, at, "kinematics", &Question::kinematics(state), &Reference::Same)?;
        }
        let inverse = Question::inverse(state, &[Field::TauY, Field::TauU]);
        self.ask(robot, at, "ID", &inverse, &Reference::Same)?;
        for method in methods {
            let name = format!("{closures}, {}", method.name());
            let ask = Question::forward(state, Some(*method));
            // the oracle in double-double would agree at a higher cost
            let exact = Question { method: Some(Method::Recursion), ..ask.clone() };
            let at = At { value, method: &name };
            let case = self.ask(robot, at, "FD", &ask, &Reference::Of(&exact))?;
            if case.status == Status::Ok.name() {
                let answer = ask.run(&robot.compiled.model)?;
                case.backward = Some(backward_error(robot, &ask, &answer)?);
            }
        }
        Ok(())
    }
}

/// The reference numbers of the wanted fields, if any, and their source.
fn reference_numbers(
    robot: &Robot,
    ask: &Question,
    reference: &Reference<'_>,
) -> Outcome<(Option<Vec<(Field, Vec<Dd>)>>, &'static str)> {
    let exact = match reference {
        Reference::Known(numbers) => return Ok((Some(numbers.clone()), "closed form")),
        Reference::None => return Ok((None, "there is no answer")),
        Reference::Same => ask,
        Reference::Of(other) => other,
    };
    let answer = exact.run(&robot.compiled.exact)?;
    if answer.status() != Status::Ok {
        return Ok((None, "double-double has no answer"));
    }
    Ok((
        Some(ask.want.iter().map(|field| (*field, answer.get(*field).to_vec())).collect()),
        "double-double",
    ))
}

/// Further diagnostics after a failure, other than status and warnings.
fn reported(robot: &Robot, ask: &Question, answer: &Answered<f64>) -> Outcome<String> {
    use Field::{NearestY, Residual, SigmaMin, Uncontrolled};
    if matches!(
        answer.status(),
        Status::Ok | Status::NonFiniteInput | Status::BadRequest | Status::MassNotPositive
    ) {
        return Ok(String::new());
    }
    let want = [Residual, SigmaMin, NearestY, Uncontrolled];
    let helps = beside(robot, ask, Request::Kinematics, &want)?;
    let mut reported: Vec<Cow<'_, str>> = Vec::new();
    for (field, name) in want.into_iter().zip(["residual", "σ_min", "nearest y", "uncontrolled"]) {
        let numbers = helps.get(field);
        let few: Vec<String> = numbers
            .iter()
            .take(6)
            .map(|x| if field == NearestY { format!("{x:.6}") } else { format!("{x:.1e}") })
            .collect();
        let relevant = field != Uncontrolled || answer.status() == Status::SingularActuation;
        if relevant && !numbers.is_empty() && numbers.iter().all(|x| x.is_finite()) {
            reported.push(format!("{name} {}", few.join(" ")).into());
        }
    }
    Ok(reported.join(", "))
}

/// The fields by which a user can assess an answer.
fn figures(robot: &Robot, ask: &Question) -> Outcome<String> {
    let want = [Field::SigmaMin, Field::CondGu, Field::CondMy];
    let figures = beside(robot, ask, Request::InverseDynamics, &want)?;
    let reported = want.map(|field| {
        figures.get(field).first().map_or(String::new(), |x| format!("{} {x:.1e}", field.name()))
    });
    Ok(reported.join(", "))
}

/// The answer to another question at the same position.
fn beside(
    robot: &Robot,
    ask: &Question,
    request: Request,
    want: &[Field],
) -> Outcome<Answered<f64>> {
    use Field::{Q, QGuess, U, Y};
    let position = |(field, _): &&(Field, Vec<f64>)| matches!(field, Y | Q | U | QGuess);
    let given = ask.given.iter().filter(position).cloned().collect();
    Question::new(request, given, want).run(&robot.compiled.model)
}
