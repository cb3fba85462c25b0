//! `sarrus import`: robots of other formats as a URDF and a submechanism file.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use sarrus_client::Options;
use sarrus_models::{Imported, LoadError, Report, import};

use super::output::{Failure, Outcome, Results, file_name, labelled, write_new};
use super::robot::{diagnostics, notes};

/// Longest time of a program that reads a file.
const LONGEST: Duration = Duration::from_secs(60);
/// Endings of files that the Python package converts.
const OF_PYTHON: [&str; 5] = ["lua", "usd", "usda", "usdc", "usdz"];

/// Flags of `import`.
#[derive(Args)]
pub(crate) struct Import {
    /// Files of MJCF or SDF, YAML files of Gepetto's tools beside their URDF, URDF files with loops
    /// in the elements of other programs, or files of Lua (RBDL) or USD; one for each robot.
    #[arg(value_name = "FILE", required_unless_present = "description")]
    files: Vec<PathBuf>,
    /// A robot of the Python package `robot_descriptions`, as `g1_description`. May be given
    /// several times.
    #[arg(long, value_name = "NAME")]
    description: Vec<String>,
    /// The folder for NAME.urdf and NAME.yml of each robot; existing files stay.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Parts that cannot be expressed are left out with a warning.
    #[arg(long)]
    lenient: bool,
    /// A folder below which files are read that FILE names; without it only those below the folder
    /// of FILE. May be given several times.
    #[arg(long, value_name = "DIR")]
    include_dir: Vec<PathBuf>,
    /// Expand FILE by the program `xacro` of the package of that name first.
    #[arg(long)]
    xacro: bool,
}

impl Import {
    pub(crate) fn run(self) -> Outcome {
        let options = Options { lenient: self.lenient, ..Options::default() };
        let mut results = Results { text: String::new(), code: 0 };
        let mut files = self.files.clone();
        for name in &self.description {
            let path = output_of(python("sarrus.descriptions").arg(name))?;
            files.push(String::from_utf8_lossy(&path).trim_end().into());
        }
        for file in &files {
            let expanded = self.expand(file)?;
            let imported = match import(file, expanded, &self.include_dir, &options) {
                Ok(imported) => imported,
                Err(LoadError::Faults(report)) => {
                    eprint!("{}", in_words(&report));
                    results.code = 1;
                    continue;
                }
                Err(other) => return Err(other.into()),
            };
            eprint!("{}", in_words(&imported.report));
            results.text += &self.write(&imported)?;
            results.code |= u8::from(!imported.report.errors.is_empty());
        }
        Ok(results)
    }

    /// The text of a file that another program reads.
    fn expand(&self, file: &Path) -> Result<Option<Vec<u8>>, Failure> {
        let ending = file.extension().unwrap_or_default().to_ascii_lowercase();
        if self.xacro {
            return output_of(Command::new("xacro").arg(file)).map(Some);
        }
        if !OF_PYTHON.iter().any(|of| ending == *of) {
            return Ok(None);
        }
        std::fs::metadata(file)
            .map_err(|error| LoadError::Open(file.display().to_string(), error.to_string()))?;
        let mut program = python("sarrus.convert");
        self.include_dir.iter().for_each(|of| _ = program.arg("--include-dir").arg(of));
        program.args(self.lenient.then_some("--lenient")).arg("--").arg(file);
        output_of(&mut program).map(Some)
    }

    /// Writes both files; their names, and the facts about the closed robot.
    fn write(&self, imported: &Imported) -> Result<String, Failure> {
        let name = file_name(&imported.name);
        let path = |ending: &str| self.out.join(format!("{name}.{ending}"));
        let files =
            [(path("urdf"), imported.urdf.clone()), (path("yml"), imported.submechanisms.clone())];
        let mut text = write_new(&self.out, &files)?.text;
        if let Some(residual) = imported.residual {
            text += &labelled("closure", format!("{residual:.3e} off at the file's pose, scaled"));
        }
        if let Some((key, closed)) = &imported.keyframe {
            let state = match &closed.error {
                Some(error) => error.clone(),
                None => format!(
                    "{:.3e} off, closed at a distance of {:.3e}",
                    closed.residual_before, closed.distance
                ),
            };
            text += &labelled("keyframe", format!("{key}: {state}"));
        }
        if !imported.independent.is_empty() {
            text += &labelled("independent", imported.independent.join(" "));
            let rule =
                "those that determine all others: actuated ones first, then those on the base";
            text += &labelled("", rule);
        }
        Ok(text)
    }
}

/// Notes, warnings and errors, a line each.
fn in_words(report: &Report) -> String {
    notes(&report.notes) + &diagnostics(&report.errors, &report.warnings)
}

/// Runs a module without those of the current folder, which may be a robot's.
const MODULE: &str = "import sys; sys.path = [of for of in sys.path if of]; import runpy; \
    runpy.run_module(sys.argv.pop(1), run_name='__main__', alter_sys=True)";

/// A module of the Python package, for the interpreter that `SARRUS_PYTHON` names, or `python3`.
fn python(module: &str) -> Command {
    let named = std::env::var_os("SARRUS_PYTHON").unwrap_or_else(|| "python3".into());
    let mut program = Command::new(named);
    program.args(["-c", MODULE, module]);
    program
}

/// The output of a program; its words go to stderr.
fn output_of(program: &mut Command) -> Result<Vec<u8>, Failure> {
    let words = format!("{program:?}").replace(&format!("\"-c\" {MODULE:?}"), "\"-m\"");
    let package = if words.starts_with("\"xacro") { "xacro" } else { "sarrus" };
    let failed = |why: String| Failure::start(format!("{words}: {why}"));
    let broken =
        |error: std::io::Error| failed(format!("{error}; install it: pip install {package}"));
    program.stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = program.spawn().map_err(broken)?;
    let text = child.stdout.take().map(|mut stream| {
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            stream.read_to_end(&mut bytes).map(|_| bytes)
        })
    });
    let start = Instant::now();
    while child.try_wait().map_err(broken)?.is_none() {
        if start.elapsed() > LONGEST {
            child.kill().and_then(|()| child.wait()).map_err(broken)?;
            return Err(failed(format!("it takes more than {} s", LONGEST.as_secs())));
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let status = child.wait().map_err(broken)?;
    if !status.success() {
        let code = if status.code() == Some(2) && package == "sarrus" { 2 } else { 1 };
        return Err(Failure { code, ..failed(status.to_string()) });
    }
    text.and_then(|text| text.join().ok()).unwrap_or(Ok(Vec::new())).map_err(broken)
}
