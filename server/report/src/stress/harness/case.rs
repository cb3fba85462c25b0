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

/// One case: a robot, a parameter at a value, a question, and the result.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// The family, such as `mass ratio`.
    pub(crate) family: &'static str,
    /// The robot.
    pub(crate) mechanism: String,
    /// The swept parameter.
    pub(crate) parameter: &'static str,
    /// Its value.
    pub(crate) value: f64,
    /// How it was answered: how loops are closed, and by which method forward dynamics went.
    pub(crate) method: String,
    /// The question.
    pub(crate) asked: String,
    /// The status, or the error at load.
    pub(crate) status: String,
    /// Warnings of the answer.
    pub(crate) warnings: Vec<String>,
    /// Error by size against the reference, where there is an answer.
    pub(crate) error: Option<f64>,
    /// The reference.
    pub(crate) reference: &'static str,
    /// Forward dynamics: backward error.
    pub(crate) backward: Option<f64>,
    /// Time of a call in nanoseconds, where it was taken.
    pub(crate) nanoseconds: Option<f64>,
    /// Reports beside the status.
    pub(crate) reported: String,
    /// The assessment.
    pub(crate) assessment: Assessment,
}

/// The reference of an answer.
pub(crate) enum Reference<'a> {
    /// The question itself in double-double.
    Same,
    /// Another question in double-double, whose answer is the true one.
    Of(&'a Question),
    /// Numbers by closed form.
    Known(Vec<(Field, Vec<Dd>)>),
    /// There is no answer: any that is ok is wrong.
    None,
}

/// The cases of a run.
#[derive(Default)]
pub(crate) struct Cases {
    pub(crate) all: Vec<Case>,
    /// Family and robot of the cases whose reference is no truth.
    pub(crate) not_judged: Vec<(&'static str, String)>,
    family: &'static str,
    parameter: &'static str,
}

/// Where a case stands in its family: the parameter's value and the method's name.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    pub(crate) value: f64,
    pub(crate) method: &'a str,
}

impl At<'_> {
    /// At a value, by the way in which the robot's loops are closed.
    pub(crate) fn of(robot: &Robot, value: f64) -> At<'static> {
        At { value, method: robot.closures() }
    }
}

impl Cases {
    /// The cases that follow are of this family.
    pub(crate) fn family(&mut self, family: &'static str, parameter: &'static str) {
        (self.family, self.parameter) = (family, parameter);
    }

    /// The family of the cases that follow.
    pub(crate) fn family_name(&self) -> &'static str {
        self.family
    }

    /// A case with nothing but its place.
    pub(crate) fn blank(&self, mechanism: &str, at: At<'_>, asked: &str) -> Case {
        Case {
            family: self.family,
            mechanism: mechanism.to_owned(),
            parameter: self.parameter,
            value: at.value,
            method: at.method.to_owned(),
            asked: asked.to_owned(),
            status: String::new(),
            warnings: vec![],
            error: None,
            reference: "double-double",
            backward: None,
            nanoseconds: None,
            reported: String::new(),
            assessment: Assessment::FailedSilently,
        }
    }

    /// A case with a status, its error where it is ok, and whether a failed answer is NaN wherever
    /// it must be; without warnings.
    pub(crate) fn ended(
        &self,
        mechanism: &str,
        at: At<'_>,
        asked: &str,
        (status, error, empty): (Status, Option<f64>, bool),
    ) -> Case {
        Case {
            status: status.name().to_owned(),
            error,
            assessment: assess(status, Warnings::NONE, error.unwrap_or(f64::INFINITY), empty),
            ..self.blank(mechanism, at, asked)
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

    /// Adds a case that ended before there was anything to ask.
    pub(crate) fn refused(
        &mut self,
        mechanism: &str,
        at: At<'_>,
        asked: &str,
        status: &str,
        reported: String,
    ) {
        let case = Case {
            status: status.to_owned(),
            reported,
            assessment: Assessment::Failed,
            reference: "-",
            ..self.blank(mechanism, at, asked)
        };
        self.all.push(case);
    }

    /// Loads a robot at a value of the parameter; a refused one is a case of its own that reports
    /// the error.
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
        let error =
            ok.then(|| numbers.map_or(f64::INFINITY, |numbers| error(robot, &answer, &numbers)));
        let forward = ok
            && ask.request == Request::ForwardDynamics
            && ask.given.iter().any(|(field, _)| *field == Field::TauY);
        let backward = if forward && matches!(reference, Reference::Same) {
            Some(backward_error(robot, ask, &answer)?)
        } else {
            None
        };
        let case = Case {
            reference: source,
            backward,
            reported: if error.is_some_and(|error| error > HELD) {
                figures(robot, ask)?
            } else {
                reported(robot, ask, &answer)?
            },
            ..self.answered(robot, at, asked, &answer, error)
        };
        self.all.push(case);
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
            // the oracle in double-double would cost more and agree
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

/// The reference numbers of the asked fields, if there are any, and where they come from.
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

/// Further diagnostics after a failure, beside status and warnings.
fn reported(robot: &Robot, ask: &Question, answer: &Answered<f64>) -> Outcome<String> {
    use Field::*;
    if matches!(
        answer.status(),
        Status::Ok | Status::NonFiniteInput | Status::BadRequest | Status::MassNotPositive
    ) {
        return Ok(String::new());
    }
    let given = ask
        .given
        .iter()
        .filter(|(field, _)| matches!(field, Y | Q | U | QGuess))
        .cloned()
        .collect();
    let want = [Residual, SigmaMin, NearestY, Uncontrolled];
    let helps = Question::new(Request::Kinematics, given, &want).run(&robot.compiled.model)?;
    let mut reported: Vec<Cow<'_, str>> = Vec::new();
    for (field, name) in [
        (Residual, "residual"),
        (SigmaMin, "σ_min"),
        (NearestY, "nearest y"),
        (Uncontrolled, "uncontrolled"),
    ] {
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

/// The figures by which a user can assess an answer.
fn figures(robot: &Robot, ask: &Question) -> Outcome<String> {
    use Field::{CondGu, CondMy, Q, QGuess, SigmaMin, U, Y};
    let given: Vec<_> = ask
        .given
        .iter()
        .filter(|(field, _)| matches!(field, Y | Q | U | QGuess))
        .cloned()
        .collect();
    let want = [SigmaMin, CondGu, CondMy];
    let figures =
        Question::new(Request::InverseDynamics, given, &want).run(&robot.compiled.model)?;
    let reported = want.map(|field| {
        figures.get(field).first().map_or(String::new(), |x| format!("{} {x:.1e}", field.name()))
    });
    Ok(reported.join(", "))
}
