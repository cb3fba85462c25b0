//! The C compiler of this machine.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

#[cfg(feature = "load")]
use sarrus_dynamics::{Model, Plan};

use crate::c::{Device, FLAGS, Source};
use crate::error::BuildError;
use crate::manifest::DEFINITION;
use crate::run::{Cancel, run};
#[cfg(feature = "load")]
use crate::{LoadError, NativeKernel, ObjectFile};

/// The longest time for which a compiler may print its version.
const NAME: Duration = Duration::from_secs(10);
/// The longest time for which a compiler, or the test of its output, may run.
const COMPILE: Duration = Duration::from_secs(120);

/// Beginnings of flags that add code with constructors to an object: sanitizers, profiles.
const INSTRUMENTS: [&str; 6] =
    ["-fsanitize", "-fprofile-arcs", "-fprofile-generate", "--coverage", "-finstrument", "-pg"];

/// With this flag the function for rows is compiled too.
const ROWS: &str = "-DSARRUS_ROWS";

/// A C compiler: `CC`, or `cc` where that is unset or empty. As for make it is a program with
/// arguments: `ccache gcc`, `gcc -m64`.
#[derive(Clone, Debug)]
pub struct Compiler {
    /// The value of `CC`.
    pub(crate) command: String,
    name: String,
}

/// The output of a compiler.
#[derive(Clone, Debug)]
pub struct Built {
    /// The shared object.
    pub library: PathBuf,
    /// The test program.
    pub test: PathBuf,
}

impl Compiler {
    /// The compiler of this machine, if there is one. Runs it for its version, for at most 10 s.
    pub fn found() -> Option<Compiler> {
        Compiler::found_unless(&Cancel::default())
    }

    /// As above, but gives no answer as soon as it is cancelled.
    pub fn found_unless(cancel: &Cancel) -> Option<Compiler> {
        Compiler::named(&usual("CC", "cc"), cancel).ok()
    }

    /// The compiler that this command starts, once it has printed its version.
    ///
    /// # Errors
    /// [`BuildError`]: it cannot be started, fails, takes longer than 10 s, or was cancelled.
    pub fn named(command: &str, cancel: &Cancel) -> Result<Compiler, BuildError> {
        let mut compiler = Compiler { command: command.to_owned(), name: String::new() };
        let ended = run(compiler.start().arg("--version"), &compiler.command, NAME, cancel)?;
        if !ended.is_success {
            let program = format!("{command} --version");
            return Err(BuildError::Failed { program, words: first_line(&ended.words) });
        }
        compiler.name = first_line(&ended.words);
        Ok(compiler)
    }

    /// Its version: the first line of `--version`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its program, with its arguments.
    fn start(&self) -> Command {
        let mut words = self.command.split_whitespace();
        let mut command = Command::new(words.next().unwrap_or("cc"));
        command.args(words);
        command
    }

    /// Writes the files of a source into a folder, which is made where it is missing.
    pub fn write(source: &Source, folder: &Path) -> Result<Vec<PathBuf>, BuildError> {
        let files = [(".c", &source.function), (".h", &source.header), ("_test.c", &source.test)];
        let of_device = source.launcher.iter().flat_map(|launcher| {
            launcher.endings().into_iter().zip([&launcher.kernel, &launcher.launch])
        });
        write_all(folder, &source.name, files.into_iter().chain(of_device))
    }

    /// Builds the files that [`Compiler::write`] wrote, with these flags besides [`FLAGS`]. A
    /// program that takes more than 120 s is ended, and as soon as it is cancelled.
    pub fn build(
        &self,
        source: &Source,
        folder: &Path,
        flags: &[&str],
        cancel: &Cancel,
    ) -> Result<Built, BuildError> {
        let library = self.library(source, folder, flags, cancel)?;
        let [from, test] = ["_test.c", "_test"].map(|end| folder.join(source.name.clone() + end));
        let _ = std::fs::remove_file(&test);
        let mut command = self.start();
        command.args(FLAGS).arg(ROWS).args(flags).arg(from).arg(&library);
        // the test finds the shared object beside itself
        command.args(["-Wl,-rpath,$ORIGIN", "-o"]).arg(&test).arg("-lm");
        finished(&mut command, &self.command, cancel)?;
        Ok(Built { library, test })
    }

    /// Compiles the function of a source to a shared object; its path. All files of a compiler
    /// that is ended are in the folder.
    pub(crate) fn library(
        &self,
        source: &Source,
        folder: &Path,
        flags: &[&str],
        cancel: &Cancel,
    ) -> Result<PathBuf, BuildError> {
        let is_instrument = |word: &&str| INSTRUMENTS.iter().any(|flag| word.starts_with(flag));
        if let Some(flag) = self.command.split_whitespace().find(is_instrument) {
            return Err(BuildError::Flag(flag.to_owned()));
        }
        let [from, to] = [".c", ".so"].map(|end| folder.join(source.name.clone() + end));
        // a compiler may write through a link or into a pipe
        let _ = std::fs::remove_file(&to);
        let mut command = self.start();
        command.args(FLAGS).arg(ROWS).arg(format!("-D{DEFINITION}")).args(flags);
        command.args(["-fPIC", "-shared", "-o"]).arg(&to).arg(&from).arg("-lm");
        command.env("TMPDIR", folder);
        finished(&mut command, &self.command, cancel)?;
        Ok(to)
    }
}

impl Built {
    /// Loads the shared object as [`NativeKernel::open`] does, independent of the user's file mode
    /// mask: compares its answers with the plan's on [`NativeKernel::STATES`] states.
    ///
    /// # Errors
    /// As [`NativeKernel::open`].
    #[cfg(feature = "load")]
    pub fn load(&self, model: &Model<f64>, plan: &Plan) -> Result<NativeKernel, LoadError> {
        NativeKernel::load(&ObjectFile::read_built(&self.library)?, model, plan)
    }

    /// Runs the test program, for at most 120 s and until it is cancelled, and returns its output.
    pub fn test(&self, cancel: &Cancel) -> Result<String, BuildError> {
        finished(&mut Command::new(&self.test), &self.test.display().to_string(), cancel)
    }
}

impl Source {
    /// Builds the launcher that [`Compiler::write`] wrote, with the compiler `NVCC`, or `nvcc`, for
    /// CUDA and with `CC` for OpenCL, and runs it, each for at most 120 s. Its output, with the
    /// registers and spills of the kernel where the compiler prints them, or why it was not run;
    /// `None` without a launcher.
    ///
    /// # Errors
    /// [`BuildError`]: some bit is another, it takes too long, or was cancelled.
    pub fn launched(&self, folder: &Path, cancel: &Cancel) -> Result<Option<String>, BuildError> {
        let Some(launcher) = &self.launcher else { return Ok(None) };
        let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let program = folder.join(format!("{}_launch", self.name));
        let (compiler, flags) = match launcher.device {
            Device::Cuda => (usual("NVCC", "nvcc"), &["-fmad=false", "-Xptxas", "-v"][..]),
            Device::OpenCl => (usual("CC", "cc"), &["-std=c11", "-lOpenCL"][..]),
        };
        let [_, ending] = launcher.endings();
        let from = folder.join(format!("{}{ending}", self.name));
        let mut words = compiler.split_whitespace();
        let mut command = Command::new(words.next().unwrap_or_default());
        command.args(words).arg(from).arg("-o").arg(&program).args(flags);
        let mut text = String::new();
        match run(&mut command, &compiler, COMPILE, cancel) {
            Ok(built) if built.is_success => {
                let is_size = |line: &&str| line.contains("registers") || line.contains("spill");
                let lines = built.words.lines().filter(is_size);
                lines.for_each(|line| text += &format!("{}\n", line.trim()));
            }
            Ok(failed) => {
                let why = first_line(&failed.words);
                return Ok(Some(format!("not run: {compiler}: {why}")));
            }
            Err(BuildError::Cancelled) => return Err(BuildError::Cancelled),
            Err(error) => return Ok(Some(format!("not run: {error}"))),
        }
        let name = program.display().to_string();
        let ended = run(Command::new(&program).current_dir(folder), &name, COMPILE, cancel)?;
        match ended.code {
            Some(0) => Ok(Some(text + &ended.words)),
            Some(2) => Ok(Some(text + "not run: " + &ended.words)),
            _ => Err(BuildError::Failed { program: name, words: ended.words }),
        }
    }
}

fn first_line(words: &str) -> String {
    words.lines().next().unwrap_or_default().trim().to_owned()
}

/// The command of a compiler: this variable, or `program` where it is unset or empty.
fn usual(variable: &str, program: &str) -> String {
    let command = std::env::var(variable).ok().filter(|command| !command.trim().is_empty());
    command.unwrap_or_else(|| program.to_owned())
}

/// Why there is no compiler, in brackets; empty where there is one now.
#[cfg(feature = "load")]
pub(crate) fn why_not_found() -> String {
    let found = Compiler::named(&usual("CC", "cc"), &Cancel::default());
    found.map_or_else(|why| format!(" (tried {why})"), |_| String::new())
}

/// The output of a program that ends well.
fn finished(command: &mut Command, name: &str, cancel: &Cancel) -> Result<String, BuildError> {
    let ended = run(command, name, COMPILE, cancel)?;
    match ended.is_success {
        true => Ok(ended.words),
        false => Err(BuildError::Failed { program: name.to_owned(), words: ended.words }),
    }
}

/// Writes files of this name, with these endings, into a folder, which is made where it is missing;
/// their paths.
pub(crate) fn write_all<'a>(
    folder: &Path,
    name: &str,
    files: impl IntoIterator<Item = (&'static str, &'a String)>,
) -> Result<Vec<PathBuf>, BuildError> {
    let failed = |path: &Path, error| BuildError::Io { path: path.to_owned(), error };
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    let write = |(ending, text): (&str, &String)| {
        let path = folder.join(format!("{name}{ending}"));
        write_new(&path, text).map_err(|error| failed(&path, error))?;
        Ok(path)
    };
    files.into_iter().map(write).collect()
}

/// Writes a file in place of any existing one: writing to a pipe would wait for a reader.
pub(crate) fn write_new(path: &Path, text: &str) -> io::Result<()> {
    let _ = std::fs::remove_file(path);
    File::create_new(path)?.write_all(text.as_bytes())
}
