//! Kernel outputs on which a plan branches.

/// Growth of roundings above which the digits of an answer are counted: below it, after the
/// roundings of a few hundred operations, ten digits remain.
pub const DOUBTFUL: f64 = 5e3;

/// The use that a plan makes of a kernel output, see [`super::Real::to_branch_value`].
///
/// All other branches of a run are comparisons of [`super::Real`]. An answer whose gains γ
/// and growths w have (max γ)^1.5 · Π max(w, 1) below [`DOUBTFUL`], and whose limited numbers lie
/// in their limits, is `ok` without a warning wherever every comparison comes out likewise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BranchValue {
    /// The gain of a closure.
    Gain,
    /// A factor by which roundings grow.
    Growth,
    /// A number that raises a warning below `lower` and above `upper`.
    Limited {
        /// Smallest value without a warning.
        lower: f64,
        /// Largest value without a warning.
        upper: f64,
    },
    /// Read only when digits are counted.
    OfDoubt,
}
