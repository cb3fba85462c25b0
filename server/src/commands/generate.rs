//! `sarrus generate`: straight-line C of one query on one robot.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::describe;
use sarrus_dynamics::Plan;
use sarrus_generate::{BuildError, Cancel, Compiler, Kernel, NativeKernel, Source};
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};

use super::ask::read_plan;
use super::output::{Format, FormatFlag, finish, json_line};
use super::progress::Progress;
use super::robot::{RobotFlags, refuse};

/// Flags of `generate`.
#[derive(Args)]
pub(crate) struct Generate {
    #[command(flatten)]
    robot: RobotFlags,
    /// The query: a line of `ask` with its request, of which the numbers do not matter:
    /// '{"request": "inverse-dynamics", "y": […], "yd": […], "want": ["tau_u"]}'.
    #[arg(long, value_name = "LINE")]
    query: String,
    /// Where the files go; made where it is missing.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    format: FormatFlag,
}

/// What was generated.
#[derive(Serialize)]
struct Generated {
    files: Vec<PathBuf>,
    operations: usize,
    checks: usize,
    /// The compiler's name, or "not built".
    compiler: String,
    /// On how many states the shared object was compared with the generic kernels: every bit.
    compared: Option<u64>,
    /// What the test printed.
    test: Option<String>,
}

/// What is done, one after the other.
const STAGES: [&str; 3] = ["traced and compared", "compiled", "loaded, compared and tested"];
/// Between two looks whether it is done.
const LOOK: Duration = Duration::from_millis(5);

/// How long the end of this process waits for a compiler to be ended.
const END: Duration = Duration::from_millis(200);

/// Why nothing was.
enum Failure {
    /// The line is none.
    Line(String),
    /// There is no straight-line code, or it is not the kernel's.
    Finding(String),
    /// A file cannot be written.
    Start(BuildError),
}

impl Generate {
    pub(crate) fn run(self) -> ExitCode {
        let loaded = match self.robot.load_and_warn() {
            Ok(loaded) => loaded,
            Err(error) => return refuse("generate", &error),
        };
        let (words, code) = match self.generate_in_sight(&loaded) {
            Ok(generated) => {
                let results = match self.format.format {
                    Format::Json => json_line(&generated),
                    Format::Text => in_words(&generated),
                };
                return finish("generate", &results, 0);
            }
            Err(Failure::Line(words)) => (format!("--query: {words}"), 2),
            Err(Failure::Start(error)) => (error.to_string(), 2),
            Err(Failure::Finding(words)) => (words, 1),
        };
        eprintln!("sarrus generate: {words}");
        ExitCode::from(code)
    }

    /// Generates on a thread of its own, so that the bar moves while others have the word: the
    /// kernels that are traced, and the compiler.
    fn generate_in_sight(&self, loaded: &sarrus_models::Loaded) -> Result<Generated, Failure> {
        let stage = AtomicUsize::new(0);
        let (start, mut progress) = (Instant::now(), Progress::new());
        let (cancel, signal) = (Cancel::default(), Arc::new(AtomicUsize::new(0)));
        // compilers are in groups of their own, which the terminal does not reach
        for number in [SIGINT, SIGTERM] {
            let value = number as usize;
            let _ = signal_hook::flag::register_usize(number, signal.clone(), value);
        }
        let failed = |error| BuildError::Io { path: self.out.clone(), error };
        thread::scope(|scope| {
            // traces are deep where robots are
            let builder = thread::Builder::new().stack_size(16 << 20);
            let worker = builder.spawn_scoped(scope, || self.generate(loaded, &stage, &cancel));
            let worker = worker.map_err(|error| Failure::Start(failed(error)))?;
            while !worker.is_finished() {
                let at = stage.load(Relaxed).min(STAGES.len() - 1);
                let what = format!("{} … {:.0} s", STAGES[at], start.elapsed().as_secs_f64());
                progress.show(&what, at as f64 / STAGES.len() as f64);
                let number = signal.load(Relaxed);
                if number != 0 && !cancel.is_cancelled() {
                    cancel.cancel();
                    let start = Instant::now();
                    while !worker.is_finished() && start.elapsed() < END {
                        thread::sleep(LOOK);
                    }
                    let _ = signal_hook::low_level::emulate_default_handler(number as i32);
                }
                thread::sleep(LOOK);
            }
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    fn generate(
        &self,
        loaded: &sarrus_models::Loaded,
        stage: &AtomicUsize,
        cancel: &Cancel,
    ) -> Result<Generated, Failure> {
        let model = &loaded.compiled.model;
        let (query, _) = read_plan(&describe(loaded), &self.query).map_err(Failure::Line)?;
        let request =
            query.check(model.info()).map_err(|error| Failure::Line(error.to_string()))?;
        let plan = Plan::new(model, &query).map_err(|error| Failure::Line(error.to_string()))?;
        let kernel =
            Kernel::trace(model, &plan).map_err(|error| Failure::Finding(error.to_string()))?;
        let name = format!("{}_{}", model.name(), request.name());
        let source = Source::new(&kernel, model, &name);
        let mut files = Compiler::write(&source, &self.out).map_err(Failure::Start)?;
        let (mut compiler, mut compared, mut test) = ("not built".to_owned(), None, None);
        if let Some(found) = Compiler::found_unless(cancel) {
            let finding = |error: BuildError| Failure::Finding(error.to_string());
            stage.store(1, Relaxed);
            let built = found.build_unless(&source, &self.out, &[], cancel).map_err(finding)?;
            stage.store(2, Relaxed);
            // as `serve --kernel` does: the few states of the test are for other machines
            built.load(model, &plan).map_err(|error| Failure::Finding(error.to_string()))?;
            compared = Some(NativeKernel::STATES);
            test = Some(built.test_unless(cancel).map_err(finding)?);
            files.extend([built.library, built.test]);
            compiler = found.name().to_owned();
        }
        Ok(Generated {
            files,
            operations: kernel.operations(),
            checks: kernel.checks(),
            compiler,
            compared,
            test,
        })
    }
}

fn in_words(generated: &Generated) -> String {
    let mut text = String::new();
    for file in &generated.files {
        text += &format!("{:<12} {}\n", "written", file.display());
    }
    text += &format!("{:<12} {}\n", "operations", generated.operations);
    text += &format!("{:<12} {}\n", "checks", generated.checks);
    text += &format!("{:<12} {}\n", "compiler", generated.compiler);
    if let Some(states) = generated.compared {
        text += &format!("{:<12} {states} states, the same bits\n", "compared");
    }
    for test in generated.test.iter().flat_map(|test| test.lines()) {
        text += &format!("{:<12} {test}\n", "test");
    }
    text
}
