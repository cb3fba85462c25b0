//! Generated kernels for robots in this process.

use std::path::PathBuf;
use std::sync::Arc;

use sarrus_dynamics::{Model, Plan};
use sarrus_generate::{Cache, Cancel, Compiler, MakeError, Manifest, NativeKernel, bare_query};

/// Selects the generated kernels for a robot's plans. All choices return the same bits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kernels {
    /// None: the generic kernels answer.
    #[default]
    None,
    /// Kernels from the user's cache. No program is run.
    Kept,
    /// Kernels from the user's cache; missing ones are compiled by `CC`, or `cc`, while the plan is
    /// prepared, which takes seconds, and stored there.
    Compiled,
    /// A shared object of `sarrus generate`, for the query that it was made for.
    File(PathBuf),
}

/// The code that answers a plan.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum AnsweredBy<'a> {
    /// The generic kernels: no others were requested, or the robot is connected.
    Generic,
    /// A generated kernel, and the generic ones where it has no answer.
    Generated(&'a Manifest),
    /// The generic kernels, because there is no generated one.
    Refused(&'a KernelError),
}

/// Why a plan has no generated kernel.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KernelError {
    /// The robot is in another process.
    #[error("a connected robot is answered by its server: `sarrus serve --kernel`")]
    Connected,
    /// The file is for another query.
    #[error("{} is for another query", .0.display())]
    OtherQuery(PathBuf),
    /// The kernel cannot be made, or is refused.
    #[error(transparent)]
    Make(#[from] MakeError),
}

/// Gives plans their kernels.
#[derive(Default)]
pub(crate) struct Source {
    kernels: Kernels,
    /// The kernel of [`Kernels::File`].
    loaded: Option<Arc<NativeKernel>>,
}

impl Source {
    /// Loads and checks the existing kernels.
    pub(crate) fn new(kernels: Kernels, model: &Model<f64>) -> Result<Source, KernelError> {
        let loaded = match &kernels {
            Kernels::File(path) => {
                Some(Arc::new(NativeKernel::of_file(path, model).map_err(MakeError::from)?))
            }
            _ => None,
        };
        Ok(Source { kernels, loaded })
    }

    /// The kernel of a plan; `None` if none is requested.
    pub(crate) fn kernel(
        &self,
        model: &Model<f64>,
        plan: &Plan,
    ) -> Option<Result<Arc<NativeKernel>, KernelError>> {
        let cache = || Cache::usual(|name| std::env::var_os(name)).map_err(MakeError::from);
        Some(match &self.kernels {
            Kernels::None => return None,
            Kernels::File(path) => {
                let kernel = self.loaded.as_ref()?;
                match kernel.manifest().query == bare_query(plan.query()) {
                    true => Ok(Arc::clone(kernel)),
                    false => Err(KernelError::OtherQuery(path.clone())),
                }
            }
            Kernels::Kept => {
                cache().and_then(|cache| cache.find(model, plan)).map(Arc::new).map_err(Into::into)
            }
            Kernels::Compiled => cache()
                .and_then(|cache| {
                    let compiler = Compiler::found().ok_or(MakeError::NoCompiler)?;
                    cache.kernel(model, plan, &compiler, &Cancel::default())
                })
                .map(|made| Arc::new(made.kernel))
                .map_err(Into::into),
        })
    }
}
