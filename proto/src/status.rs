//! The status and warnings of an answer.

use crate::wire_enum::wire_enum;

wire_enum! {
    /// The outcome of a request. The numbers are part of the wire contract and never change.
    ///
    /// Only clients set [`Status::UnknownStatus`] and [`Status::OtherProcess`]; no server sends
    /// them.
    Status: u32 {
        /// The answer is complete.
        Ok = 0, "ok";
        /// The request itself is malformed: a field missing, two that exclude each other, a
        /// quaternion not of unit length.
        BadRequest = 1, "bad_request";
        /// An input number is NaN or infinite, or so large that the answer overflows.
        NonFiniteInput = 2, "non_finite_input";
        /// An array does not have the size that the plan or the robot needs.
        WrongSize = 3, "wrong_size";
        /// The request was made for a model with another fingerprint.
        WrongModel = 4, "wrong_model";
        /// The request or plan number is not known to the server.
        UnknownRequest = 5, "unknown_request";
        /// Newton's method ran out of steps although the target seems reachable.
        NotConverged = 6, "not_converged";
        /// The straight path from the guess to the target crosses a singularity onto another
        /// branch.
        BranchChanged = 7, "branch_changed";
        /// No closed pose has these coordinates.
        Unreachable = 8, "unreachable";
        /// The closure loses rank at the answer: the mechanism gains a freedom.
        SingularClosure = 9, "singular_closure";
        /// The declared independent coordinates do not determine the motion at the answer.
        SingularIndependents = 10, "singular_independents";
        /// The actuators do not determine the motion (or a force cannot be mapped to them) at the
        /// answer.
        SingularActuation = 11, "singular_actuation";
        /// The reduced mass matrix is not positive definite.
        MassNotPositive = 12, "mass_not_positive";
        /// The server has more work than it accepts.
        Overloaded = 13, "overloaded";
        /// The server is stopping.
        ShuttingDown = 14, "shutting_down";
        /// The checksum of the request or of the answer fails: its bytes changed after it was sent.
        /// Set by the server for a request, by the client for an answer, where the query asks for
        /// checksums.
        CorruptAnswer = 15, "corrupt_answer";
        /// This client does not know the status: the server has another version. The numbers are
        /// NaN.
        UnknownStatus = 16, "unknown_status";
        /// The connection was made by another process, from which this one was forked. The numbers
        /// are NaN, and the server was not asked.
        OtherProcess = 17, "other_process";
        /// The deadline of the request passed before its answer was there. The numbers are NaN.
        Late = 18, "late";
        /// No pose was found that meets all tasks; the numbers are those of the nearest one that
        /// breaks no bound.
        NotReached = 19, "not_reached";
        /// No pose was found that breaks no bound; `binding` names the bounds that contradict.
        Infeasible = 20, "infeasible";
    }
}

impl Status {
    /// The status of an answer by its number; an unknown number is always
    /// [`Status::UnknownStatus`].
    pub const fn of_answer(code: u32) -> Status {
        match Status::from_code(code) {
            Some(status) => status,
            None => Status::UnknownStatus,
        }
    }
}

wire_enum! {
    /// Bits that accompany an answer and never change its numbers.
    Warning: u32 {
        /// A position, velocity or actuator force lies outside the limits that the model declares.
        LimitsExceeded = 1, "limits_exceeded";
        /// Some field of the answer may keep fewer than nine digits: near a singular pose, where
        /// actuators nearly lose control, or where an inertia nearly cancels. Without it all keep
        /// nine.
        IllConditioned = 2, "ill_conditioned";
        /// A redundant row, which the solution omits, is open by more than the query's tolerance:
        /// the loops do not close here.
        LoopOpen = 4, "loop_open";
        /// The given q or qd does not fit its loops: the answer's state is farther from it than the
        /// query's tolerance (the field `projection`).
        InputProjected = 8, "input_projected";
        /// An actuator that a wanted field depends on has no limit, and the field is NaN.
        NoLimit = 16, "no_limit";
    }
}

/// A set of [`Warning`]s, as their bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(transparent)]
pub struct Warnings(pub u32);

impl Warnings {
    /// No warning.
    pub const NONE: Warnings = Warnings(0);
    /// [`Warning::LimitsExceeded`].
    pub const LIMITS_EXCEEDED: Warnings = Warnings(Warning::LimitsExceeded as u32);
    /// [`Warning::IllConditioned`].
    pub const ILL_CONDITIONED: Warnings = Warnings(Warning::IllConditioned as u32);
    /// [`Warning::LoopOpen`].
    pub const LOOP_OPEN: Warnings = Warnings(Warning::LoopOpen as u32);
    /// [`Warning::InputProjected`].
    pub const INPUT_PROJECTED: Warnings = Warnings(Warning::InputProjected as u32);
    /// [`Warning::NoLimit`].
    pub const NO_LIMIT: Warnings = Warnings(Warning::NoLimit as u32);

    /// True when every bit of `other` is set.
    pub const fn contains(self, other: Warnings) -> bool {
        self.0 & other.0 == other.0
    }

    /// Those that are set, in the order of the bits.
    pub fn iter(self) -> impl Iterator<Item = Warning> {
        Warning::ALL.iter().copied().filter(move |one| self.0 & *one as u32 != 0)
    }

    /// The names in scripts, in the order of the bits.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        self.iter().map(Warning::name)
    }
}

impl core::ops::BitOrAssign for Warnings {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn status_numbers_are_the_wire_contract() {
        for (code, status) in Status::ALL.iter().enumerate() {
            assert_eq!(*status as usize, code);
            assert_eq!(Status::from_code(code as u32), Some(*status));
        }
        for code in [21, 1 << 31, u32::MAX] {
            assert_eq!(Status::from_code(code), None);
            assert_eq!(Status::of_answer(code), Status::UnknownStatus);
        }
        assert_eq!(Status::of_answer(8), Status::Unreachable);
        assert_eq!(Status::Unreachable as u32, 8);
        assert_eq!(Status::ShuttingDown.name(), "shutting_down");
    }
}
