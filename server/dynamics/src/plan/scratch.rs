//! The workspace that plans need.

use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::Scalar;
use crate::workspace::{Needs, Workspace};

impl<T: Scalar> Workspace<T> {
    /// Scratch for these plans on this model and for no others, without the square matrices that
    /// none of them needs: that of a robot with a thousand joints is then a thousand times as
    /// small. Allocates; nothing after it does.
    pub fn for_plans<'a>(
        model: &Model<T>,
        plans: impl IntoIterator<Item = &'a Plan>,
    ) -> Workspace<T> {
        Workspace::sized(
            model,
            plans.into_iter().fold(Needs::default(), |needs, plan| needs.and(plan.needs())),
        )
    }
}
