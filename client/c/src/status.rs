//! How a call ends, as a number and a name.

use core::ffi::CStr;

use sarrus_client::{ConnectError, Error, Status, Warnings};

/// How a call ended. From 0 to 99 it is the status of an answer, by the numbers of the wire; from
/// 100 on there was no answer, and sarrus_last_error has the reason. The numbers never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum StatusCode {
    /// The answer is complete, or the call succeeded.
    Ok = 0,
    /// The request is malformed, such as a quaternion that is not of unit length.
    BadRequest = 1,
    /// An input number is NaN or infinite, or so large that the answer would be.
    NonFiniteInput = 2,
    /// An array does not have the size that the plan or the robot needs.
    WrongSize = 3,
    /// The request was made for a model with another fingerprint.
    WrongModel = 4,
    /// The request or plan number is not known to the server.
    UnknownRequest = 5,
    /// Newton's method ran out of steps although the target seems reachable.
    NotConverged = 6,
    /// The straight path from the guess to the target crosses onto another assembly branch.
    BranchChanged = 7,
    /// No closed pose has these coordinates.
    Unreachable = 8,
    /// The closure loses rank at the answer: the mechanism gains a freedom.
    SingularClosure = 9,
    /// The independent coordinates do not determine the motion at the answer.
    SingularIndependents = 10,
    /// The actuators do not determine the motion at the answer.
    SingularActuation = 11,
    /// The reduced mass matrix is not positive definite.
    MassNotPositive = 12,
    /// The server has more work than it accepts.
    Overloaded = 13,
    /// The server is stopping.
    ShuttingDown = 14,
    /// The checksum of the request or of the answer fails: its bytes changed after it was sent.
    CorruptAnswer = 15,
    /// The server answered with a status that this version does not know.
    UnknownStatus = 16,
    /// The connection belongs to the process that made it, from which this one was forked.
    OtherProcess = 17,
    /// The deadline of the request passed before its answer was there.
    Late = 18,
    /// No pose was found that meets all tasks; the numbers are those of the nearest one that breaks
    /// no bound.
    NotReached = 19,
    /// No pose was found that breaks no bound; binding has those that contradict.
    Infeasible = 20,
    /// A pointer that must not be NULL is.
    NullPointer = 100,
    /// A pointer is not aligned for its type.
    UnalignedPointer = 101,
    /// An output array overlaps another array of the same call.
    OverlappingArrays = 102,
    /// A text is not UTF-8, or malformed.
    BadText = 103,
    /// A number stands for nothing in its enum, or a place is none of its list.
    UnknownNumber = 104,
    /// The files cannot be read or have faults: all of them are in the text.
    LoadFailed = 105,
    /// No server or bridge takes this client.
    ConnectFailed = 106,
    /// The server is gone and did not come back in time; the next call looks for it again.
    ServerGone = 107,
    /// The server is there but did not answer in time.
    NoAnswer = 108,
    /// Names stand for nothing: all of them are in the text.
    UnknownName = 109,
    /// The query cannot be planned.
    BadQuery = 110,
    /// The plan moves more numbers than a request carries.
    TooLarge = 111,
    /// The server's table of plans is full.
    TooManyPlans = 112,
    /// The plan is another robot's, be it one of the same model.
    UnknownPlan = 113,
    /// The plan was released.
    ReleasedPlan = 114,
    /// There is nothing new since the last call.
    NothingNew = 115,
    /// A command could not be sent.
    NotSent = 116,
    /// This processor lacks a feature that this build of the library needs.
    OldProcessor = 117,
    /// A fault of the library itself; free the handle. Please report it.
    Internal = 118,
    /// This process has too little memory left for the call.
    NoMemory = 119,
}

/// Bits beside an answer; they never change its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Warning {
    /// A position, velocity or actuator force lies outside the limits of the model.
    LimitsExceeded = 1,
    /// Some field of the answer may keep fewer than nine digits.
    IllConditioned = 2,
    /// The loops do not close here: a redundant row is open by more than the tolerance.
    LoopOpen = 4,
    /// The given q or qd does not fit its loops by more than the tolerance.
    InputProjected = 8,
    /// An actuator that a wanted field depends on has no limit, and the field is NaN.
    NoLimit = 16,
}

/// All statuses with their names, which are those of the wire for the status of an answer.
const NAMES: [(StatusCode, &CStr); 41] = [
    (StatusCode::Ok, c"ok"),
    (StatusCode::BadRequest, c"bad_request"),
    (StatusCode::NonFiniteInput, c"non_finite_input"),
    (StatusCode::WrongSize, c"wrong_size"),
    (StatusCode::WrongModel, c"wrong_model"),
    (StatusCode::UnknownRequest, c"unknown_request"),
    (StatusCode::NotConverged, c"not_converged"),
    (StatusCode::BranchChanged, c"branch_changed"),
    (StatusCode::Unreachable, c"unreachable"),
    (StatusCode::SingularClosure, c"singular_closure"),
    (StatusCode::SingularIndependents, c"singular_independents"),
    (StatusCode::SingularActuation, c"singular_actuation"),
    (StatusCode::MassNotPositive, c"mass_not_positive"),
    (StatusCode::Overloaded, c"overloaded"),
    (StatusCode::ShuttingDown, c"shutting_down"),
    (StatusCode::CorruptAnswer, c"corrupt_answer"),
    (StatusCode::UnknownStatus, c"unknown_status"),
    (StatusCode::OtherProcess, c"other_process"),
    (StatusCode::Late, c"late"),
    (StatusCode::NotReached, c"not_reached"),
    (StatusCode::Infeasible, c"infeasible"),
    (StatusCode::NullPointer, c"null_pointer"),
    (StatusCode::UnalignedPointer, c"unaligned_pointer"),
    (StatusCode::OverlappingArrays, c"overlapping_arrays"),
    (StatusCode::BadText, c"bad_text"),
    (StatusCode::UnknownNumber, c"unknown_number"),
    (StatusCode::LoadFailed, c"load_failed"),
    (StatusCode::ConnectFailed, c"connect_failed"),
    (StatusCode::ServerGone, c"server_gone"),
    (StatusCode::NoAnswer, c"no_answer"),
    (StatusCode::UnknownName, c"unknown_name"),
    (StatusCode::BadQuery, c"bad_query"),
    (StatusCode::TooLarge, c"too_large"),
    (StatusCode::TooManyPlans, c"too_many_plans"),
    (StatusCode::UnknownPlan, c"unknown_plan"),
    (StatusCode::ReleasedPlan, c"released_plan"),
    (StatusCode::NothingNew, c"nothing_new"),
    (StatusCode::NotSent, c"not_sent"),
    (StatusCode::OldProcessor, c"old_processor"),
    (StatusCode::Internal, c"internal"),
    (StatusCode::NoMemory, c"no_memory"),
];

impl StatusCode {
    /// That of an answer, by its number on the wire.
    pub(crate) fn of_answer(status: Status) -> StatusCode {
        let mut codes = NAMES.iter().map(|(code, _)| *code);
        codes.find(|code| *code as i32 == status as i32).unwrap_or(StatusCode::UnknownStatus)
    }

    pub(crate) fn of_error(error: &Error) -> StatusCode {
        match error {
            Error::ServerGone(..) => StatusCode::ServerGone,
            Error::NoAnswer { .. } | Error::Connect(ConnectError::NoAnswer { .. }) => {
                StatusCode::NoAnswer
            }
            Error::Connect(ConnectError::WrongModel { .. }) => StatusCode::WrongModel,
            Error::Connect(ConnectError::NoMemory(..)) => StatusCode::NoMemory,
            Error::Connect(_) => StatusCode::ConnectFailed,
            Error::UnknownNames(_) => StatusCode::UnknownName,
            Error::Query(_) | Error::NotPlanned(_) => StatusCode::BadQuery,
            Error::WrongSize { .. } => StatusCode::WrongSize,
            Error::Failed(failed) => StatusCode::of_answer(failed.status),
            Error::TooLarge { .. } => StatusCode::TooLarge,
            Error::TooManyPlans { .. } => StatusCode::TooManyPlans,
            Error::UnknownPlan => StatusCode::UnknownPlan,
            Error::ReleasedPlan => StatusCode::ReleasedPlan,
            _ => StatusCode::Internal,
        }
    }
}

const WARNINGS: [(Warning, &CStr); 5] = [
    (Warning::LimitsExceeded, c"limits_exceeded"),
    (Warning::IllConditioned, c"ill_conditioned"),
    (Warning::LoopOpen, c"loop_open"),
    (Warning::InputProjected, c"input_projected"),
    (Warning::NoLimit, c"no_limit"),
];

/// The name of a status by its number, if it is one.
pub(crate) fn status_name(status: i32) -> Option<&'static CStr> {
    NAMES.iter().find(|(code, _)| *code as i32 == status).map(|(_, name)| *name)
}

/// The name of the lowest warning among bits, if there is one.
pub(crate) fn warning_name(bits: u32) -> Option<&'static CStr> {
    WARNINGS.iter().find(|(warning, _)| bits & *warning as u32 != 0).map(|(_, name)| *name)
}

/// The bits of warnings as they cross the border.
pub(crate) const fn bits(warnings: Warnings) -> u32 {
    warnings.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statuses_of_answers_have_the_numbers_and_names_of_the_wire() {
        for status in Status::ALL {
            let code = StatusCode::of_answer(*status);
            assert_eq!(code as u32, *status as u32);
            assert_eq!(status_name(code as i32).unwrap().to_str().unwrap(), status.name());
        }
        let own = NAMES.iter().filter(|(code, _)| *code as i32 >= 100).count();
        assert_eq!(own + Status::ALL.len(), NAMES.len());
    }

    #[test]
    fn warnings_have_the_bits_and_names_of_the_wire() {
        for (warning, name) in WARNINGS {
            let names: Vec<_> = Warnings(warning as u32).names().collect();
            assert_eq!(names, [name.to_str().unwrap()]);
        }
        assert_eq!(Warnings(u32::MAX).names().count(), WARNINGS.len());
    }
}
