//! A robot in this process.

use std::sync::Arc;

use sarrus_dynamics::{Batch, Model, Plan, Workspace};
use sarrus_proto::Query;

use crate::batch::Here;
#[cfg(feature = "kernels")]
use crate::kernels::{AnsweredBy, KernelError, Kernels, Source};
use crate::{Answer, Error};

/// The model with its scratch and its plans.
pub(crate) struct Local {
    pub(crate) model: Arc<Model<f64>>,
    workspace: Workspace<f64>,
    /// Indexed by slot.
    plans: Vec<Option<Prepared>>,
    /// The source of kernels for plans.
    #[cfg(feature = "kernels")]
    kernels: Source,
}

/// A plan, the scratch of each thread that answered its batches, and its kernel if one was
/// requested.
struct Prepared {
    plan: Plan,
    batches: Vec<Batch>,
    #[cfg(feature = "kernels")]
    kernel: Option<Result<Arc<sarrus_generate::NativeKernel>, KernelError>>,
}

impl Local {
    pub(crate) fn new(model: Model<f64>) -> Local {
        Local {
            workspace: Workspace::new(&model),
            model: Arc::new(model),
            plans: Vec::new(),
            #[cfg(feature = "kernels")]
            kernels: Source::default(),
        }
    }

    /// Plans that are registered from now on get these kernels.
    #[cfg(feature = "kernels")]
    pub(crate) fn use_kernels(&mut self, kernels: Kernels) -> Result<(), KernelError> {
        self.kernels = Source::new(kernels, &self.model)?;
        Ok(())
    }

    /// The code that answers a plan.
    #[cfg(feature = "kernels")]
    pub(crate) fn answered_by(&self, place: usize) -> AnsweredBy<'_> {
        match self.plans.get(place).and_then(Option::as_ref).map(|prepared| &prepared.kernel) {
            Some(Some(Ok(kernel))) => AnsweredBy::Generated(kernel.manifest()),
            Some(Some(Err(error))) => AnsweredBy::Refused(error),
            _ => AnsweredBy::Generic,
        }
    }

    pub(crate) fn register(&mut self, place: usize, query: &Query) -> Result<(), Error> {
        let plan = Plan::new(&self.model, query).map_err(Error::Query)?;
        self.plans.resize_with(self.plans.len().max(place + 1), || None);
        self.plans[place] = Some(Prepared {
            #[cfg(feature = "kernels")]
            kernel: self.kernels.kernel(&self.model, &plan),
            plan,
            batches: Vec::new(),
        });
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
        let Some(Some(prepared)) = self.plans.get(place) else { return Err(Error::ReleasedPlan) };
        // the same bits by either
        let workspace = &mut self.workspace;
        #[cfg(feature = "kernels")]
        if let Some(Ok(kernel)) = &prepared.kernel {
            let of = (&*self.model, &prepared.plan);
            if let Some(answer) = kernel.answer(of, workspace, input, output) {
                return Ok(answer);
            }
        }
        Ok(prepared.plan.run(&self.model, workspace, input, output))
    }

    /// The engines with which this number of threads answers batches of a plan.
    pub(crate) fn batches(&mut self, place: usize, threads: usize) -> Result<Here<'_>, Error> {
        let Some(Some(prepared)) = self.plans.get_mut(place) else {
            return Err(Error::ReleasedPlan);
        };
        let batches = &mut prepared.batches;
        if batches.is_empty() {
            batches.push(Batch::new(&self.model, &prepared.plan));
        }
        while batches.len() < threads {
            batches.extend(batches.first().cloned());
        }
        Ok(Here {
            batches: &mut batches[..threads],
            #[cfg(feature = "kernels")]
            kernel: prepared.kernel.as_ref().and_then(|kernel| kernel.as_deref().ok()),
        })
    }
}
