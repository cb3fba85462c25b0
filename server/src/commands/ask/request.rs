//! The parts of a request line and the names of its fields.

use std::time::Duration;

use sarrus_client::{Field, FieldSet, Query, Status};

use super::json::Fault;

/// The request of one line.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) query: Query,
    /// The members of the answer in their order.
    pub(super) outputs: Vec<Output>,
    /// Names of the links whose frames are wanted.
    pub(super) frames: Vec<String>,
    pub(super) given: Vec<Given>,
    /// Time until the answer, for a server.
    pub(super) deadline: Option<Duration>,
    /// The fault that fails the state of a valid request.
    pub(super) doubt: Option<Problem>,
}

/// The numbers of one field and the offset of its key.
#[derive(Debug)]
pub(super) struct Given {
    pub(super) field: Field,
    pub(super) numbers: Vec<f64>,
    pub(super) offset: usize,
}

/// One member of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Output {
    Field(Field),
    Frames,
    Jacobians,
}

/// The status and the reason of a line whose answer has no numbers.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Problem {
    pub(super) status: Status,
    pub(super) offset: usize,
    pub(super) words: String,
}

/// Result of reading a line or a part of one.
pub(super) type Read<T = ()> = Result<T, Problem>;

impl From<Fault> for Problem {
    fn from(Fault { offset, words }: Fault) -> Problem {
        Problem { status: Status::BadRequest, offset, words }
    }
}

/// The inputs of a request besides wrenches.
pub(super) const INPUTS: [Field; 17] = [
    Field::Y,
    Field::Yd,
    Field::Ydd,
    Field::U,
    Field::Ud,
    Field::Udd,
    Field::Q,
    Field::Qd,
    Field::Qdd,
    Field::QGuess,
    Field::QdGuess,
    Field::TauU,
    Field::TauY,
    Field::TauQ,
    Field::YGuess,
    Field::YPreferred,
    Field::Multipliers,
];
const FRAMES: [Field; 3] = [Field::FramePose, Field::FrameTwist, Field::FrameAcc];
const JACOBIANS: [Field; 3] =
    [Field::JacobianTree, Field::JacobianIndependent, Field::JacobianActuator];

impl Output {
    /// Its name in a line.
    pub(super) fn name(self) -> &'static str {
        match self {
            Output::Field(field) => field.name(),
            Output::Frames => "frames",
            Output::Jacobians => "jacobians",
        }
    }

    /// The output of a name.
    pub(super) fn from_name(name: &str) -> Option<Output> {
        match name {
            "frames" => Some(Output::Frames),
            "jacobians" => Some(Output::Jacobians),
            // fields of frames come by link, under the two names above
            _ => Field::from_name(name)
                .filter(|field| !FRAMES.contains(field) && !JACOBIANS.contains(field))
                .map(Output::Field),
        }
    }

    /// The fields that a plan computes for it.
    pub(super) fn fields(self) -> FieldSet {
        match self {
            Output::Field(field) => FieldSet::of(&[field]),
            Output::Frames => FieldSet::of(&FRAMES),
            Output::Jacobians => FieldSet::of(&JACOBIANS),
        }
    }
}
