//! The C compiler of this machine.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::Source;

/// Whether this build of sarrus needs a processor with FMA and AVX2: then what it compiles may too.
const HAS_BASELINE: bool =
    cfg!(all(target_arch = "x86_64", target_feature = "fma", target_feature = "avx2"));

/// The flags that keep the bits: no contraction, and no call where an instruction does. With the
/// baseline of this build where it has one, so that `fma` is an instruction; a portable build
/// compiles for every processor, and `fma` is a call there.
pub const FLAGS: &[&str] = if HAS_BASELINE {
    &[
        "-std=c11",
        "-O2",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-fno-trapping-math",
        "-march=x86-64-v3",
    ]
} else {
    &["-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
};

/// Why generated code was not built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// A file could not be written, or a program not be started.
    #[error("{path}: {error}")]
    Io {
        /// Which one.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A program ended with a fault: the compiler, or the test of what it made.
    #[error("{program} failed: {words}")]
    Failed {
        /// Which one.
        program: String,
        /// What it printed.
        words: String,
    },
}

/// A C compiler: `CC`, or `cc`.
#[derive(Clone, Debug)]
pub struct Compiler {
    command: String,
    name: String,
}

/// What a compiler made.
#[derive(Clone, Debug)]
pub struct Built {
    /// The shared object.
    pub library: PathBuf,
    /// The test program.
    pub test: PathBuf,
}

impl Compiler {
    /// The compiler of this machine, if there is one.
    pub fn found() -> Option<Compiler> {
        let command = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
        let output = Command::new(&command).arg("--version").stdin(Stdio::null()).output().ok()?;
        let words = String::from_utf8_lossy(&output.stdout);
        let name = words.lines().next().unwrap_or_default().trim().to_owned();
        output.status.success().then_some(Compiler { command, name })
    }

    /// What it calls itself: the first line of `--version`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The program.
    #[cfg(feature = "load")]
    pub(crate) fn command(&self) -> &str {
        &self.command
    }

    /// Writes the files of a source into a folder, which is made where it is missing.
    pub fn write(source: &Source, folder: &Path) -> Result<Vec<PathBuf>, BuildError> {
        let failed = |path: &Path, error| BuildError::Io { path: path.to_owned(), error };
        std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
        let files = [(".c", &source.function), (".h", &source.header), ("_test.c", &source.test)];
        let write = |(ending, text): (&str, &String)| {
            let path = folder.join(format!("{}{ending}", source.name));
            std::fs::write(&path, text).map_err(|error| failed(&path, error))?;
            Ok(path)
        };
        files.into_iter().map(write).collect()
    }

    /// Builds what [`Compiler::write`] wrote, with these flags besides [`FLAGS`].
    pub fn build(
        &self,
        source: &Source,
        folder: &Path,
        flags: &[&str],
    ) -> Result<Built, BuildError> {
        let file = |ending: &str| folder.join(format!("{}{ending}", source.name));
        let (library, test) = (file(".so"), file("_test"));
        let run = |arguments: &[&Path]| {
            let mut command = Command::new(&self.command);
            command.args(FLAGS).args(flags).args(arguments);
            finished(&mut command, &self.command)
        };
        // once for both: a function may take long
        let object = file(".o");
        let [fpic, only, shared, to, math] = ["-fPIC", "-c", "-shared", "-o", "-lm"].map(Path::new);
        let named = format!("-D{}", crate::manifest::DEFINITION);
        run(&[fpic, only, Path::new(&named), &file(".c"), to, &object])?;
        run(&[shared, &object, to, &library, math])?;
        run(&[&file("_test.c"), &object, to, &test, math])?;
        std::fs::remove_file(&object)
            .map_err(|error| BuildError::Io { path: object.clone(), error })?;
        Ok(Built { library, test })
    }
}

impl Built {
    /// Runs the test program; what it prints.
    pub fn test(&self) -> Result<String, BuildError> {
        let name = self.test.display().to_string();
        let output = finished(&mut Command::new(&self.test), &name)?;
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    }
}

/// The output of a program that ends well.
fn finished(command: &mut Command, name: &str) -> Result<Output, BuildError> {
    let output = command.stdin(Stdio::null()).output();
    let output = output.map_err(|error| BuildError::Io { path: name.into(), error })?;
    if output.status.success() {
        return Ok(output);
    }
    let words = [&output.stdout, &output.stderr].map(|text| String::from_utf8_lossy(text));
    Err(BuildError::Failed { program: name.to_owned(), words: words.concat().trim().to_owned() })
}
