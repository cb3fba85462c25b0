//! What a line asks: the names that scripts use, and what they stand for.

use sarrus_client::{Field, FieldSet, Query, Status};

use super::json::Fault;

/// What one line asks.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) query: Query,
    /// What the answer holds, in its order.
    pub(super) outputs: Vec<Output>,
    /// Names of the links in `wanted.frames`.
    pub(super) frames: Vec<String>,
    pub(super) given: Vec<Given>,
    /// Why there can be no answer to a request that is otherwise a good one.
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

/// Why a line has no numbers for an answer.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Problem {
    pub(super) status: Status,
    pub(super) offset: usize,
    pub(super) words: String,
}

impl From<Fault> for Problem {
    fn from(Fault { offset, words }: Fault) -> Problem {
        Problem { status: Status::BadRequest, offset, words }
    }
}

/// What a request can give, besides wrenches.
pub(super) const INPUTS: [Field; 14] = [
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
];
const FRAMES: [Field; 3] = [Field::FramePose, Field::FrameTwist, Field::FrameAcc];
const JACOBIANS: [Field; 3] =
    [Field::JacobianTree, Field::JacobianIndependent, Field::JacobianActuator];

impl Output {
    /// The name that scripts see.
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
            // frames come by link
            _ => Field::from_name(name)
                .filter(|field| !FRAMES.contains(field) && !JACOBIANS.contains(field))
                .map(Output::Field),
        }
    }

    /// What a plan computes for it.
    pub(super) fn fields(self) -> FieldSet {
        match self {
            Output::Field(field) => FieldSet::of(&[field]),
            Output::Frames => FieldSet::of(&FRAMES),
            Output::Jacobians => FieldSet::of(&JACOBIANS),
        }
    }
}
