//! The bound on the work of a request.

use crate::closure::{BUDGET, Closure, Numerical};
use crate::model::Model;

/// Predicted time of an operation: about that of the slowest kernels on x86-64-v3 at 3 GHz `[ns]`.
const OPERATION_NS: f64 = 0.4;
/// Operations a body of an answer beside the iterations, generously.
const BODY: u64 = 400;
/// Most steps of Newton's method for the independents of one cluster, from its actuators.
pub(crate) const ACTUATOR_STEPS: u32 = 60;

/// The costliest state that a request without `search` computes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Most Newton steps.
    pub steps: u32,
    /// Predicted time, without the comparison in double-double that a doubtful answer takes `[ns]`.
    pub ns: f64,
}

impl<C> Model<C> {
    /// The bound on the work of a request: Newton steps times their operations.
    pub fn bound(&self) -> Bound {
        let answer = BODY * self.bodies.len() as u64;
        let blocks = || {
            let choices = self.closures.iter().filter_map(iterated).flat_map(|n| &n.choices);
            choices.flat_map(|choice| &choice.blocks)
        };
        let least = blocks().map(|block| block.work).min();
        let (steps, operations) = match least {
            // the last attempt may begin just below the budget
            Some(least) => {
                let attempt = blocks().map(|block| 10 * block.work).sum::<u64>();
                (BUDGET / least.max(1), BUDGET + attempt)
            }
            None => {
                let clusters = self.clusters.iter().filter(|cluster| {
                    let own = cluster.active.iter().map(|(_, v)| v);
                    !own.eq(&cluster.independent)
                });
                let steps = u64::from(ACTUATOR_STEPS) * clusters.count() as u64;
                (steps, steps * BODY * 2)
            }
        };
        Bound { steps: steps as u32, ns: (operations + answer) as f64 * OPERATION_NS }
    }
}

/// The Newton's method of a closure, if it has one.
fn iterated<C>(closure: &Closure<C>) -> Option<&Numerical<C>> {
    match closure {
        Closure::Numerical(numerical) => Some(numerical),
        Closure::Serial => None,
        Closure::Coupling(coupling) => coupling.polish.as_ref(),
        Closure::Planar(planar) => planar.polish.as_ref(),
        Closure::Rrpr(rrpr) => rrpr.polish.as_ref(),
        Closure::Platform(platform) => platform.polish.as_ref(),
    }
}
