//! The interface of every method of integration.

pub(crate) mod dop853;
pub(crate) mod fixed_step;
pub(crate) mod implicit_form;
pub(crate) mod radau5;
pub(crate) mod runge_kutta;
pub(crate) mod semi_implicit_euler;

use sarrus_dynamics::Status;

use crate::motion::engine::Engine;

/// How an attempt at a step ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attempt {
    /// t and x are those of a new settled state.
    Done,
    /// Nothing has changed; the next attempt is shorter.
    Rejected,
    /// The right-hand side has no answer ahead, however short the step.
    Failed(Status),
    /// The step has become too short to change t.
    TooShort,
}

/// A method under way.
pub(crate) trait Stepper {
    /// One attempt at a step from a settled state, not beyond `limit`.
    fn attempt(&mut self, engine: &mut Engine, t: &mut f64, x: &mut [f64], limit: f64) -> Attempt;

    /// The state or the right-hand side has been changed from outside: discards the method's
    /// history.
    fn restart(&mut self);

    /// x at a time within the last step, from ẋ at its ends; of DOP853.
    fn within(&mut self, _t: f64, _rates: [&[f64]; 2]) -> Option<Vec<f64>> {
        None
    }

    /// True once the method has found the problem stiff, which it is not made for.
    fn finds_stiff(&self) -> bool {
        false
    }
}

/// Tolerance of a component that is not controlled.
pub(crate) const FREE: f64 = 1e100;
