//! The outcome of a request, and the error for every status except `ok`.

use core::fmt;

use crate::{Status, Warnings};

/// The outcome of a request.
///
/// ```
/// use sarrus_proto::{Answer, Status, Warnings};
///
/// let answer = Answer { status: Status::Unreachable, warnings: Warnings::NONE };
/// let failed = answer.ok().unwrap_err();
/// assert_eq!(failed.status, Status::Unreachable);
/// assert!(failed.to_string().starts_with("unreachable: no closed pose has these coordinates"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use = "the numbers of an answer count only where its status is `ok`; see `Answer::ok`"]
pub struct Answer {
    /// The status; unless it is `Ok` the wanted numbers are NaN, except for fields that survive a
    /// failure.
    pub status: Status,
    /// Remarks that change neither status nor numbers.
    pub warnings: Warnings,
}

impl Answer {
    /// The warnings of a complete answer. Never allocates.
    ///
    /// # Errors
    /// [`FailedState`] with any other status than [`Status::Ok`].
    pub const fn ok(self) -> Result<Warnings, FailedState> {
        match self.status {
            Status::Ok => Ok(self.warnings),
            status => Err(FailedState { status }),
        }
    }
}

/// A failed request: its status as an error, with a remedy in the message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FailedState {
    /// The status, never [`Status::Ok`] if made by [`Answer::ok`].
    pub status: Status,
}

/// The words of a status, a line each.
macro_rules! words {
    ($status:expr; $($variant:ident: $words:literal;)*) => {
        match $status { $(Status::$variant => $words,)* }
    };
}

impl FailedState {
    /// The meaning of the status and its remedy, in one sentence.
    pub const fn help(self) -> &'static str {
        words! { self.status;
            Ok: "the answer is complete";
            BadRequest: "the request is malformed; see that quaternions have unit length and that \
                client and server are of one version";
            NonFiniteInput: "an input number is NaN or infinite, or so large that the answer would \
                be; check what computes it";
            WrongSize: "the arrays do not fit the plan; see how many numbers it takes and how many \
                it gives";
            WrongModel: "plan, workspace and model do not belong together, or the server holds \
                another model; prepare the plan for the model that is asked";
            UnknownRequest: "nobody holds a plan of this number; prepare it again and ask with the \
                new one";
            NotConverged: "Newton's method ran out of the steps of a request; give `q_guess`, a \
                closed pose nearby, go there in smaller steps, or ask with `search`";
            BranchChanged: "the straight path from the guess to the target crosses a singularity \
                onto another branch; give a guess on the branch that is meant";
            Unreachable: "no closed pose has these coordinates; with `search`, `nearest_y` is the \
                closest one that does";
            SingularClosure: "a loop is at a singularity and gains a degree of freedom; keep \
                `sigma_min` away from zero";
            SingularIndependents: "the independent coordinates do not determine the motion here; \
                `good_independents` names some that do";
            SingularActuation: "the actuators do not determine the motion here; `uncontrolled` is \
                the direction that they leave free";
            MassNotPositive: "the reduced mass matrix is not positive definite; some body that \
                moves alone has no inertia";
            Overloaded: "the server has more work than it accepts; ask again or start another \
                server";
            Late: "the deadline passed first; allow more time, or ask other clients for less";
            NotReached: "no pose was found that meets all tasks; the numbers are those of the \
                nearest one, and `binding` names the bounds that hold it";
            Infeasible: "no pose was found that breaks no bound; `binding` names those that \
                contradict, widen them or give another `y_guess`";
            ShuttingDown: "the server is stopping; ask again when it is back";
            CorruptAnswer: "memory was changed on the way, the checksum fails; ask again, and find \
                out which process writes there";
            UnknownStatus: "the server ends requests in a way that this client does not know; use \
                client and server of one version";
            OtherProcess: "the connection belongs to the process that made it, and this one was \
                forked from it; connect again here";
        }
    }
}

impl fmt::Display for FailedState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.status.name(), self.help())
    }
}

impl core::error::Error for FailedState {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_status_but_ok_is_an_error_that_says_what_to_do() {
        for status in Status::ALL {
            let answer = Answer { status: *status, warnings: Warnings::ILL_CONDITIONED };
            match answer.ok() {
                Ok(warnings) => {
                    assert_eq!((*status, warnings), (Status::Ok, Warnings::ILL_CONDITIONED));
                }
                Err(failed) => {
                    assert_ne!(*status, Status::Ok);
                    let words = failed.to_string();
                    assert!(words.starts_with(status.name()) && words.contains(';'), "{words}");
                }
            }
        }
    }
}
