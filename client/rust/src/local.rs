//! A robot in this process.

use std::sync::Arc;

use sarrus_dynamics::{Batch, Model, Plan, Workspace};
use sarrus_proto::Query;

use crate::{Answer, Error};

/// The model with its scratch and its plans.
pub(crate) struct Local {
    pub(crate) model: Arc<Model<f64>>,
    workspace: Workspace<f64>,
    /// By their places.
    plans: Vec<Option<Kept>>,
}

/// A plan, and the scratch of each thread that answered batches of it.
struct Kept {
    plan: Plan,
    batches: Vec<Batch>,
}

impl Local {
    pub(crate) fn new(model: Model<f64>) -> Local {
        Local { workspace: Workspace::new(&model), model: Arc::new(model), plans: Vec::new() }
    }

    pub(crate) fn register(&mut self, place: usize, query: &Query) -> Result<(), Error> {
        let plan = Plan::new(&self.model, query).map_err(Error::Query)?;
        self.plans.resize_with(self.plans.len().max(place + 1), || None);
        self.plans[place] = Some(Kept { plan, batches: Vec::new() });
        Ok(())
    }

    pub(crate) fn release(&mut self, place: usize) {
        if let Some(plan) = self.plans.get_mut(place) {
            *plan = None;
        }
    }

    pub(crate) fn ask(
        &mut self,
        place: usize,
        input: &[f64],
        output: &mut [f64],
    ) -> Result<Answer, Error> {
        let Some(Some(kept)) = self.plans.get(place) else { return Err(Error::ReleasedPlan) };
        Ok(kept.plan.run(&self.model, &mut self.workspace, input, output))
    }

    /// What so many threads answer batches of a plan with.
    pub(crate) fn batches(&mut self, place: usize, threads: usize) -> Result<&mut [Batch], Error> {
        let Some(Some(kept)) = self.plans.get_mut(place) else { return Err(Error::ReleasedPlan) };
        if kept.batches.is_empty() {
            kept.batches.push(Batch::new(&self.model, &kept.plan));
        }
        while kept.batches.len() < threads {
            kept.batches.extend(kept.batches.first().cloned());
        }
        Ok(&mut kept.batches)
    }
}
