//! The source of kernels: one file, or a thread that makes them from the plans that clients
//! register.
//!
//! The thread traces and compiles one plan at a time, at a lower priority than the serving threads;
//! clients that register a plan do not wait. A process of its own loads each object before this one
//! does: an object that crashes or hangs there only leaves its query without a kernel. The kernels
//! are kept in the user's cache for the next start. A refused query is not tried again.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::process::setpriority_process;
use sarrus_dynamics::{Model, Plan};
use sarrus_generate::{
    BuildError, Cache, Cancel, Compiler, LoadError, MakeError, NativeKernel, Origin, Trial,
    bare_query,
};
use sarrus_proto::{FieldSet, Query, Request};

use crate::error::ServeError;
use crate::system::stderr::line;

/// Most queries per run that get kernels: a client that keeps registering new ones cannot occupy
/// the compiler.
const QUERIES: usize = 64;
/// Niceness of the thread and of its compilers.
const NICE: i32 = 10;
/// Longest wait for the end of a compiler when the server stops.
const END: Duration = Duration::from_millis(200);

/// The kernels for the clients' plans.
#[derive(Clone, Debug, Default)]
pub struct Kernels(Choice);

#[derive(Clone, Debug, Default)]
enum Choice {
    #[default]
    None,
    Auto(Trial),
    One(Arc<NativeKernel>),
}

impl Kernels {
    /// Kernels of the cache, and new ones by the C compiler of this machine. The program `trial`
    /// loads each object as [`Kernels::of_file`] does before this process loads it.
    ///
    /// # Errors
    /// None in this build.
    pub fn auto(trial: Trial) -> Result<Kernels, ServeError> {
        Ok(Kernels(Choice::Auto(trial)))
    }

    /// One shared object, for the query that it was made for.
    ///
    /// # Errors
    /// [`ServeError::Kernel`] with the reason why it is refused.
    pub fn of_file(path: &Path, model: &Model<f64>) -> Result<Kernels, ServeError> {
        let refused = |error: LoadError| ServeError::Kernel(error.to_string());
        let kernel = NativeKernel::of_file(path, model).map_err(refused)?;
        Ok(Kernels(Choice::One(Arc::new(kernel))))
    }
}

/// A query and its kernel, if one was made.
type Made = (Query, Option<Arc<NativeKernel>>);

/// Gives plans their kernels; on the maintenance thread.
pub(crate) struct Maker {
    /// By query; without a kernel while it is being made, and if it is refused.
    known: HashMap<Query, Option<Arc<NativeKernel>>>,
    thread: Option<Thread>,
}

/// The thread that makes them.
struct Thread {
    plans: Sender<Plan>,
    made: Receiver<Made>,
    cancel: Cancel,
    handle: JoinHandle<()>,
}

impl Maker {
    /// With the thread, if needed, which starts with `place`.
    pub(crate) fn start(
        kernels: &Kernels,
        model: &Arc<Model<f64>>,
        place: impl FnOnce() + Send + 'static,
    ) -> Result<Maker, ServeError> {
        let mut known = HashMap::new();
        let mut thread = None;
        match &kernels.0 {
            Choice::None => {}
            Choice::One(kernel) => {
                let what = label(&kernel.manifest().query);
                line(format_args!("sarrus serve: kernel for {what}: from the file"));
                known.insert(kernel.manifest().query, Some(Arc::clone(kernel)));
            }
            Choice::Auto(trial) => {
                thread = Some(Thread::start(Arc::clone(model), *trial, place)?);
            }
        }
        Ok(Maker { known, thread })
    }

    /// The kernel of a new plan, if it exists; otherwise orders it.
    pub(crate) fn kernel_of(&mut self, plan: &Plan) -> Option<Arc<NativeKernel>> {
        let query = bare_query(plan.query());
        if let Some(kernel) = self.known.get(&query) {
            return kernel.clone();
        }
        let thread = self.thread.as_ref()?;
        match self.known.len() {
            ..QUERIES => {
                self.known.insert(query, None);
                // a dead thread makes nothing
                let _ = thread.plans.send(plan.clone());
            }
            QUERIES => {
                self.known.insert(query, None);
                line(format_args!(
                    "sarrus serve: no more kernels: {QUERIES} queries were tried; the generic \
                     ones answer further ones"
                ));
            }
            _ => {}
        }
        None
    }

    /// A kernel made meanwhile, and whether it belongs to a query.
    pub(crate) fn made(&mut self) -> Option<(impl Fn(&Query) -> bool, Arc<NativeKernel>)> {
        let thread = self.thread.as_ref()?;
        loop {
            let (query, kernel) = thread.made.try_recv().ok()?;
            if let Some(kernel) = kernel {
                self.known.insert(query, Some(Arc::clone(&kernel)));
                return Some((move |other: &Query| bare_query(other) == query, kernel));
            }
        }
    }

    /// Ends the thread, and a running compiler. A trace cannot be ended and need not be: it uses
    /// nothing outside this process.
    pub(crate) fn stop(&mut self) {
        if let Some(Thread { cancel, handle, .. }) = self.thread.take() {
            cancel.cancel();
            let start = Instant::now();
            while !handle.is_finished() && start.elapsed() < END {
                std::thread::sleep(Duration::from_millis(5));
            }
        }
    }
}

impl Drop for Maker {
    fn drop(&mut self) {
        self.stop();
    }
}

impl Thread {
    fn start(
        model: Arc<Model<f64>>,
        trial: Trial,
        place: impl FnOnce() + Send + 'static,
    ) -> Result<Thread, ServeError> {
        let (plans, orders) = channel::<Plan>();
        let (done, made) = channel();
        let cancel = Cancel::default();
        let cancelled = cancel.clone();
        let body = move || {
            place();
            let _ = setpriority_process(None, NICE);
            let mut compiler = None;
            for plan in orders {
                let compiler = compiler.get_or_insert_with(|| Compiler::found_unless(&cancelled));
                let kernel = make(&model, &plan, compiler.as_ref(), trial, &cancelled);
                let query = bare_query(plan.query());
                if cancelled.is_cancelled() || done.send((query, kernel)).is_err() {
                    return;
                }
            }
        };
        // the depth of a trace grows with the robot
        let builder = std::thread::Builder::new().name("sarrus-kernels".to_owned());
        let handle = builder.stack_size(16 << 20).spawn(body);
        let handle = handle.map_err(ServeError::Thread)?;
        Ok(Thread { plans, made, cancel, handle })
    }
}

/// Makes one kernel and reports it.
fn make(
    model: &Model<f64>,
    plan: &Plan,
    compiler: Option<&Compiler>,
    trial: Trial,
    cancel: &Cancel,
) -> Option<Arc<NativeKernel>> {
    let what = label(plan.query());
    let made = (|| {
        let cache = Cache::usual(|name| std::env::var_os(name))?.tried_by(trial);
        let compiler = compiler.ok_or(MakeError::NoCompiler)?;
        cache.kernel(model, plan, compiler, cancel)
    })();
    match made {
        Ok(made) => {
            match &made.origin {
                Origin::Kept => {
                    line(format_args!("sarrus serve: kernel for {what}: kept from before"));
                }
                Origin::Made { time, operations, refused } => {
                    if let Some(error) = refused {
                        line(format_args!(
                            "sarrus serve: warning: a kernel is made again: {error}"
                        ));
                    }
                    line(format_args!(
                        "sarrus serve: kernel for {what}: made in {:.1} s, {operations} operations",
                        time.as_secs_f64()
                    ));
                }
            }
            Some(Arc::new(made.kernel))
        }
        Err(MakeError::Build(BuildError::Cancelled)) => None,
        Err(error) => {
            line(format_args!(
                "sarrus serve: no kernel for {what}: {error}; the generic ones answer"
            ));
            None
        }
    }
}

/// A query in one line.
fn label(query: &Query) -> String {
    let names =
        |fields: FieldSet| fields.iter().map(|field| field.name()).collect::<Vec<_>>().join(", ");
    let request = Request::from_code(query.request).map_or("a query", Request::name);
    format!("{request} of {} for {}", names(query.given), names(query.want))
}
