//! A robot in this process.

use std::sync::Arc;

use sarrus_dynamics::{Model, Plan, Workspace};
use sarrus_models::{LoadError, Options, Source, load};
use sarrus_proto::ModelInfo;

use crate::{Answer, Error, Prepared, describe};

/// The model with its scratch and its plans.
pub(crate) struct Local {
    model: Arc<Model<f64>>,
    workspace: Workspace<f64>,
    plans: Vec<Plan>,
}

impl Local {
    pub(crate) fn load(
        source: &Source,
        options: &Options,
    ) -> Result<(Local, ModelInfo), LoadError> {
        let loaded = load(source, options)?;
        let info = describe(&loaded);
        let model = Arc::new(loaded.compiled.model);
        let workspace = Workspace::new(&model);
        Ok((Local { model, workspace, plans: Vec::new() }, info))
    }

    pub(crate) fn register(&mut self, prepared: &Prepared) -> Result<(), Error> {
        self.plans.push(Plan::new(&self.model, prepared.query()).map_err(Error::Query)?);
        Ok(())
    }

    pub(crate) fn ask(
        &mut self,
        plan: usize,
        input: &[f64],
        output: &mut [f64],
    ) -> Result<Answer, Error> {
        let plan = self.plans.get(plan).ok_or(Error::UnknownPlan { index: plan })?;
        Ok(plan.run(&self.model, &mut self.workspace, input, output))
    }
}
