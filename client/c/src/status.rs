//! How a call ends, as a number.

use sarrus_client::{ConnectError, Error, Status, wire_enum};

wire_enum! {
    /// How a call ended that has no answer; the header shows these behind the statuses of answers.
    OwnStatus: u32 {
        /// A pointer that must not be NULL is.
        NullPointer = 100, "null_pointer";
        /// A pointer is not aligned for its type.
        UnalignedPointer = 101, "unaligned_pointer";
        /// An output array overlaps another array of the same call.
        OverlappingArrays = 102, "overlapping_arrays";
        /// A text is not UTF-8, or malformed.
        BadText = 103, "bad_text";
        /// A number stands for nothing in its enum, or a place is none of its list.
        UnknownNumber = 104, "unknown_number";
        /// The files cannot be read or have faults: all of them are in the text.
        LoadFailed = 105, "load_failed";
        /// No server or bridge takes this client.
        ConnectFailed = 106, "connect_failed";
        /// The server is gone and did not come back in time; the next call looks for it again.
        ServerGone = 107, "server_gone";
        /// The server is there but did not answer in time.
        NoAnswer = 108, "no_answer";
        /// Names stand for nothing: all of them are in the text.
        UnknownName = 109, "unknown_name";
        /// The query cannot be planned.
        BadQuery = 110, "bad_query";
        /// The plan moves more numbers than a request carries.
        TooLarge = 111, "too_large";
        /// The server's table of plans is full.
        TooManyPlans = 112, "too_many_plans";
        /// The plan is another robot's, be it one of the same model.
        UnknownPlan = 113, "unknown_plan";
        /// The plan was released.
        ReleasedPlan = 114, "released_plan";
        /// There is nothing new since the last call.
        NothingNew = 115, "nothing_new";
        /// A command could not be sent.
        NotSent = 116, "not_sent";
        /// This processor lacks a feature that this build of the library needs.
        OldProcessor = 117, "old_processor";
        /// A fault of the library itself; free the handle. Please report it.
        Internal = 118, "internal";
        /// This process has too little memory left for the call.
        NoMemory = 119, "no_memory";
    }
}

/// How a call ended, 0 for success. From 0 to 99 it is the status of an answer, by the numbers of
/// the wire; from 100 on there was no answer, and sarrus_last_error has the reason. The numbers
/// never change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct StatusCode(pub(crate) i32);

impl StatusCode {
    pub(crate) const OK: StatusCode = StatusCode(Status::Ok as i32);

    pub(crate) fn of_error(error: &Error) -> StatusCode {
        StatusCode(match error {
            Error::ServerGone(..) => OwnStatus::ServerGone as i32,
            Error::NoAnswer { .. } | Error::Connect(ConnectError::NoAnswer { .. }) => {
                OwnStatus::NoAnswer as i32
            }
            Error::Connect(ConnectError::WrongModel { .. }) => Status::WrongModel as i32,
            Error::Connect(ConnectError::NoMemory(..)) => OwnStatus::NoMemory as i32,
            Error::Connect(_) => OwnStatus::ConnectFailed as i32,
            Error::UnknownNames(_) => OwnStatus::UnknownName as i32,
            Error::Query(_) | Error::NotPlanned(_) => OwnStatus::BadQuery as i32,
            Error::WrongSize { .. } => Status::WrongSize as i32,
            Error::Failed(failed) => failed.status as i32,
            Error::TooLarge { .. } => OwnStatus::TooLarge as i32,
            Error::TooManyPlans { .. } => OwnStatus::TooManyPlans as i32,
            Error::UnknownPlan => OwnStatus::UnknownPlan as i32,
            Error::ReleasedPlan => OwnStatus::ReleasedPlan as i32,
            _ => OwnStatus::Internal as i32,
        })
    }
}
