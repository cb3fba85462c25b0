//! The mathematics over duals, compiled once and without optimisation.
//!
//! A generic function is compiled in the crate that calls it, once for each scalar. Crates below
//! `opt-level` 2, as the tests are, take an instance from a crate that they depend on if that is
//! below 2 as well. So the functions here hold the instances of all that a plan calls: in the tests
//! at `opt-level` 1 they took three quarters of the time to compile.
//!
//! The targets of this crate named after other crates are these crates' unit tests.

use sarrus_dynamics::scalar::{Dd, Dual, Real};
use sarrus_dynamics::{Answer, Model, Plan, Query, Workspace};

/// First derivatives in one direction.
pub type First = Dual<f64>;
/// First derivatives in two directions, and the mixed second derivative.
pub type Second = Dual<Dual<f64>>;
/// First derivatives in one direction, over double-double.
pub type Exact = Dual<Dd>;

/// A model over duals, whose constants have no derivative.
pub fn model<S: Real>(of: &Model<S>) -> Model<Dual<S>> {
    of.convert(Dual::constant)
}

/// The answer to a query, or `None` where the model has none.
fn answer<S: Real>(
    of: &Model<S>,
    query: &Query,
    input: &[Dual<S>],
    output: &mut [Dual<S>],
) -> Option<Answer> {
    let model = model(of);
    let plan = Plan::new(&model, query).ok()?;
    let mut workspace = Workspace::new(&model);
    Some(plan.run(&model, &mut workspace, input, output))
}

/// The answer to a query with its first derivatives; `None` where the model has none.
pub fn first(
    of: &Model<f64>,
    query: &Query,
    input: &[First],
    output: &mut [First],
) -> Option<Answer> {
    answer(of, query, input, output)
}

/// The answer to a query with its second derivatives; `None` where the model has none.
pub fn second(
    of: &Model<First>,
    query: &Query,
    input: &[Second],
    output: &mut [Second],
) -> Option<Answer> {
    answer(of, query, input, output)
}

/// The answer to a query with its first derivatives over double-double; `None` where the model has
/// none.
pub fn exact(
    of: &Model<Dd>,
    query: &Query,
    input: &[Exact],
    output: &mut [Exact],
) -> Option<Answer> {
    answer(of, query, input, output)
}
