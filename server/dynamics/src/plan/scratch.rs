//! The workspace that plans need.

use crate::model::Model;
use crate::plan::Plan;
use crate::scalar::Real;
use crate::workspace::{Needs, Probe, Workspace};

impl<T: Real> Workspace<T> {
    /// Scratch for exactly these plans on this model, without square matrices that none of them
    /// needs: for a robot with a thousand joints it is a thousand times smaller. Allocates; nothing
    /// after it does.
    pub fn for_plans<'a>(
        model: &Model<T>,
        plans: impl IntoIterator<Item = &'a Plan>,
    ) -> Workspace<T> {
        let mut needs = Needs::default();
        let mut given = 0;
        let mut want = 0;
        let mut closed = 0;
        for plan in plans.into_iter().flat_map(|plan| [Some(plan), plan.inner()]).flatten() {
            needs = needs.and(plan.needs());
            given = given.max(plan.given().len());
            want = want.max(plan.want().len());
            closed = closed.max(plan.given.len() + plan.closed.len());
            if let Some(first) = &plan.first {
                given = given.max(first.given().len());
                want = want.max(2 * first.want().len());
            }
        }
        let probe = Probe::new(model, needs, given, want);
        Workspace::sized(model, needs).with_probe(probe).with_room_for_closed(closed)
    }
}
