//! Numbers that leave the kernels, so that a plan decides by them.

/// Growth of roundings from which on the digits of an answer are counted: with the roundings of a
/// few hundred operations ten digits are left below it.
pub const DOUBTFUL: f64 = 5e3;

/// What a plan decides by a number that it takes out of the kernels, see
/// [`super::Scalar::to_figure`].
///
/// Everything else that a run decides is a comparison of [`super::Real`]. An answer whose gains γ
/// and growths w have (max γ)^1.5 · Π max(w, 1) below [`DOUBTFUL`], and whose limited numbers lie
/// in their limits, is `ok` without a warning wherever every comparison comes out likewise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Figure {
    /// The gain of a closure.
    Gain,
    /// A factor by which roundings grow.
    Growth,
    /// A number that is warned of below `lower` and above `upper`.
    Limited {
        /// Least one.
        lower: f64,
        /// Greatest one.
        upper: f64,
    },
    /// Read only where digits are counted.
    OfDoubt,
}
