//! `sarrus generate`: straight-line code of one query on one robot.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use sarrus_client::describe;
use sarrus_dynamics::Plan;
use sarrus_generate::{BuildError, Cancel, Compiler, Device, Kernel, NativeKernel, Script, Source};
use sarrus_models::Loaded;
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::ask::read_plan;
use super::output::{Failure, FormatFlag, Outcome, Results, labelled};
use super::progress::Progress;
use super::robot::RobotFlags;

/// Flags of `generate`.
#[derive(Args)]
pub(crate) struct Generate {
    #[command(flatten)]
    robot: RobotFlags,
    /// The query: a line of `ask` with its request; its numbers are not used:
    /// '{"request": "inverse-dynamics", "y": […], "yd": […], "want": ["tau_u"]}'.
    #[arg(long, value_name = "LINE")]
    query: String,
    /// Where the files go; made where it is missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Language of the code.
    #[arg(long, value_enum, value_name = "LANGUAGE", default_value_t = Language::C)]
    language: Language,
    #[command(flatten)]
    format: FormatFlag,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Language {
    /// C11.
    C,
    /// JavaScript, for a page or node.
    Js,
    /// C11 that is CUDA too, with a kernel over batches and its launcher.
    Cuda,
    /// C11 that is OpenCL C too, with a kernel over batches and its launcher.
    Opencl,
}

/// The generated files and their sizes.
#[derive(Default, Serialize)]
struct Generated {
    files: Vec<PathBuf>,
    operations: usize,
    checks: usize,
    /// The compiler's name, or "not built"; of JavaScript none.
    compiler: Option<String>,
    /// The number of states on which the shared object gave the bits of the generic kernels.
    compared: Option<u64>,
    /// The output of the tests.
    test: Option<String>,
}

/// The stages in their order.
const STAGES: [&str; 3] = ["traced and compared", "compiled", "loaded, compared and tested"];
/// Time between two readings of the stage and of signals.
const PAUSE: Duration = Duration::from_millis(5);

/// Longest wait for a compiler to end before this process ends.
const END: Duration = Duration::from_millis(200);

impl Generate {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let generated = self.generate_with_progress(&loaded)?;
        Ok(Results { text: self.format.render(&generated, in_words), code: 0 })
    }

    /// Generates on a thread of its own, so that the bar moves while kernels are traced and the
    /// compiler runs.
    fn generate_with_progress(&self, loaded: &Loaded) -> Result<Generated, Failure> {
        let stage = AtomicUsize::new(0);
        let start = Instant::now();
        let mut progress = Progress::new();
        let cancel = Cancel::default();
        let signal = Arc::new(AtomicUsize::new(0));
        // a compiler has a process group of its own, which signals of the terminal do not reach
        for number in [SIGINT, SIGTERM] {
            let value = number as usize;
            let _ = signal_hook::flag::register_usize(number, signal.clone(), value);
        }
        let failed = |error| BuildError::Io { path: self.out.clone(), error };
        thread::scope(|scope| {
            // the recursion of a trace is as deep as the robot
            let builder = thread::Builder::new().stack_size(16 << 20);
            let worker = builder.spawn_scoped(scope, || self.generate(loaded, &stage, &cancel));
            let worker = worker.map_err(|error| Failure::start(failed(error)))?;
            while !worker.is_finished() {
                let current = stage.load(Relaxed).min(STAGES.len() - 1);
                let step = format!("{} … {:.0} s", STAGES[current], start.elapsed().as_secs_f64());
                progress.show(&step, current as f64 / STAGES.len() as f64);
                let number = signal.load(Relaxed);
                if number != 0 && !cancel.is_cancelled() {
                    cancel.cancel();
                    let start = Instant::now();
                    while !worker.is_finished() && start.elapsed() < END {
                        thread::sleep(PAUSE);
                    }
                    let _ = signal_hook::low_level::emulate_default_handler(number as i32);
                }
                thread::sleep(PAUSE);
            }
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    fn generate(
        &self,
        loaded: &Loaded,
        stage: &AtomicUsize,
        cancel: &Cancel,
    ) -> Result<Generated, Failure> {
        let model = &loaded.compiled.model;
        let no_query = |reason: String| Failure::start(format!("--query: {reason}"));
        let (query, _) = read_plan(&describe(loaded), &self.query).map_err(no_query)?;
        let request = query.check(model.info()).map_err(|error| no_query(error.to_string()))?;
        let plan = Plan::new(model, &query).map_err(|error| no_query(error.to_string()))?;
        let kernel = Kernel::trace(model, &plan).map_err(Failure::finding)?;
        let name = format!("{}_{}", model.name(), request.name());
        let mut generated = Generated {
            operations: kernel.operations(),
            checks: kernel.checks(),
            ..Generated::default()
        };
        let device = match self.language {
            Language::Js => {
                let script = Script::new(&kernel, model, &name);
                generated.files = script.write(&self.out).map_err(Failure::start)?;
                stage.store(2, Relaxed);
                let test = script.test(&self.out, cancel).map_err(Failure::finding)?;
                let absent = || "not run: node was not found".to_owned();
                return Ok(Generated { test: Some(test.unwrap_or_else(absent)), ..generated });
            }
            Language::C => None,
            Language::Cuda => Some(Device::Cuda),
            Language::Opencl => Some(Device::OpenCl),
        };
        let source = match device {
            Some(device) => Source::of_device(&kernel, model, &name, device),
            None => Source::new(&kernel, model, &name),
        };
        generated.files = Compiler::write(&source, &self.out).map_err(Failure::start)?;
        generated.compiler = Some("not built".to_owned());
        stage.store(1, Relaxed);
        generated.test = source.launched(&self.out, cancel).map_err(Failure::finding)?;
        let Some(found) = Compiler::found_unless(cancel) else { return Ok(generated) };
        let built = found.build(&source, &self.out, &[], cancel).map_err(Failure::finding)?;
        stage.store(2, Relaxed);
        // a process of its own runs the object first
        let test = built.test(cancel).map_err(Failure::finding)?;
        generated.test =
            Some(generated.test.into_iter().chain([test]).collect::<Vec<_>>().join("\n"));
        // as `serve --kernel` does: the few states of the test are for other machines
        built.load(model, &plan).map_err(Failure::finding)?;
        generated.compared = Some(NativeKernel::STATES);
        generated.files.extend([built.library, built.test]);
        generated.compiler = Some(found.name().to_owned());
        Ok(generated)
    }
}

fn in_words(generated: &Generated) -> String {
    let mut text = String::new();
    for file in &generated.files {
        text += &labelled("written", file.display());
    }
    text += &labelled("operations", generated.operations);
    text += &labelled("checks", generated.checks);
    if let Some(compiler) = &generated.compiler {
        text += &labelled("compiler", compiler);
    }
    if let Some(states) = generated.compared {
        text += &labelled("compared", format!("{states} states, the same bits"));
    }
    for line in generated.test.iter().flat_map(|test| test.lines()) {
        text += &labelled("test", line);
    }
    text
}
