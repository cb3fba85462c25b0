//! The Python of the tests: one virtual environment under the target folder, with pinned packages
//! and the package `sarrus` of this build.
//!
//! Cargo builds the extension before any test runs, since this crate depends on it without linking
//! it. The environment is completed once under a lock, and again after a change. The interpreter is
//! `SARRUS_PYTHON`, else `python3`; packages come from the indexes of `pip`. With
//! `SARRUS_OPTIONAL=missing`, and where pip reaches no index, the optional packages may be missing;
//! every other failure to install them is an error.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

/// Packages that the tests need beside `sarrus`.
const REQUIREMENTS: &str = include_str!("../../client/python/requirements.txt");
/// Packages of some tests, which are skipped where pip reaches no index.
const OPTIONAL: &str = include_str!("../../client/python/requirements-optional.txt");

/// A virtual environment that is ready.
#[derive(Debug)]
pub struct Environment {
    python: PathBuf,
    package: PathBuf,
    /// Whether the packages of `OPTIONAL` are installed, or the reason why not.
    optional: Result<(), String>,
}

impl Environment {
    /// Its interpreter.
    pub fn python(&self) -> &Path {
        &self.python
    }

    /// The interpreter as a command with arguments, free of the caller's Python settings and of
    /// writes beside the sources.
    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(&self.python);
        command
            .args(arguments)
            .env("PYTHONPATH", &self.package)
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("PYTHONUNBUFFERED", "1")
            // threads of OpenBLAS wait in a loop for each other; beside other tests that takes ten
            // times as long as they compute
            .env("OPENBLAS_NUM_THREADS", "1")
            // fault logs lie with the package and not in the user's home
            .env("XDG_STATE_HOME", self.package.join("state"));
        command
            .env_remove("PYTHONHOME")
            .env_remove("CAN_INTERFACE")
            .env_remove("CAN_CHANNEL")
            .env_remove("CAN_CONFIG");
        command
    }

    /// True if the optional packages are installed; otherwise prints that the caller is not run.
    pub fn has_optional_packages(&self) -> bool {
        if let Err(error) = &self.optional {
            println!("not run: client/python/requirements-optional.txt is not installed\n{error}");
        }
        self.optional.is_ok()
    }

    /// `python -m sarrus.can` with arguments.
    pub fn can(&self, arguments: &[&str]) -> Command {
        let mut command = self.command(&["-m", "sarrus.can"]);
        command.args(arguments);
        command
    }
}

/// The environment, which the first call makes. Panics without a Python of at least 3.10.
pub fn environment() -> &'static Environment {
    static ENVIRONMENT: OnceLock<Environment> = OnceLock::new();
    ENVIRONMENT
        .get_or_init(|| make().unwrap_or_else(|error| panic!("the Python of the tests: {error}")))
}

fn make() -> Result<Environment, String> {
    // target/PROFILE/deps/proof-…
    let test = std::env::current_exe().map_err(described)?;
    let profile = test.ancestors().nth(2).ok_or("this is no test binary of cargo")?;
    let root = profile.parent().ok_or("this is no test binary of cargo")?.join("python");
    fs::create_dir_all(&root).map_err(described)?;
    // one process at a time; the lock is released with the file's handle
    let lock = File::create(root.join("lock")).map_err(described)?;
    lock.lock().map_err(described)?;
    let folder = root.join("environment");
    let python = virtual_environment(&folder)?;
    let optional = install_optional(&folder)?;
    // each profile has a package of its own
    let package = root.join(profile.file_name().ok_or("no profile")?);
    let name = format!("{DLL_PREFIX}sarrus_python{DLL_SUFFIX}");
    let extension = [profile.join("deps").join(&name), profile.join(&name)]
        .into_iter()
        .find(|path| path.exists());
    let extension = extension.ok_or_else(|| format!("cargo has not built {name}"))?;
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../client/python/python/sarrus");
    copy_folder(&sources, &package.join("sarrus"))?;
    copy_file(&extension, &package.join("sarrus/_native.abi3.so"))?;
    Ok(Environment { python, package, optional })
}

/// Makes a virtual environment with the packages of `REQUIREMENTS` and returns its interpreter.
fn virtual_environment(folder: &Path) -> Result<PathBuf, String> {
    let python = folder.join("bin/python");
    // the stamp holds the folder, since an environment cannot be moved
    let stamp = folder.join("made-from");
    let made_from = format!("{}\n{REQUIREMENTS}", folder.display());
    if fs::read_to_string(&stamp).is_ok_and(|stamp| stamp == made_from) && python.exists() {
        return Ok(python);
    }
    let base = std::env::var_os("SARRUS_PYTHON").unwrap_or_else(|| "python3".into());
    let version = run(Command::new(&base)
        .args(["-c", "import sys; print(sys.version_info >= (3, 10), sys.version)"]))
    .map_err(|error| {
        format!("{error}\ninstall Python 3.10 or later, or name it in SARRUS_PYTHON")
    })?;
    if !version.starts_with("True") {
        return Err(format!(
            "{base:?} is Python {}; 3.10 or later is needed, name one in SARRUS_PYTHON",
            version.trim_start_matches("False ")
        ));
    }
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(described)?;
    }
    run(Command::new(&base).args(["-m", "venv"]).arg(folder))
        .map_err(|error| format!("{error}\non Debian: apt install python3-venv"))?;
    install(folder, "requirements", REQUIREMENTS)?;
    fs::write(&stamp, made_from).map_err(described)?;
    Ok(python)
}

/// Installs the optional packages, or returns why tests may run without them: by request, or
/// because pip reached no index. Any other failure, such as a pin that no index has, is an error.
fn install_optional(folder: &Path) -> Result<Result<(), String>, String> {
    // one attempt for all processes of a cargo run
    let note = folder.join("unreachable");
    let this_run = format!("{}\n{OPTIONAL}", std::os::unix::process::parent_id());
    let is_asked = std::env::var_os("SARRUS_OPTIONAL").is_some_and(|value| value == "missing");
    if fs::read_to_string(&note).is_ok_and(|noted| noted == this_run) {
        return Ok(Err("pip reached no index before in this run".to_owned()));
    }
    match install(folder, "optional", OPTIONAL) {
        Err(error) if is_asked || reached_no_index(&error) => {
            fs::write(&note, this_run).map_err(described)?;
            Ok(Err(error))
        }
        outcome => outcome.map(Ok),
    }
}

/// True if pip reports that it could not connect and lists no version at all; for a wrong pin it
/// lists the versions that exist.
fn reached_no_index(error: &str) -> bool {
    error.contains("connection broken by") && error.contains("(from versions: none)")
}

/// Installs packages into an environment once.
fn install(folder: &Path, name: &str, requirements: &str) -> Result<(), String> {
    let stamp = folder.join(name).with_extension("installed");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == requirements) {
        return Ok(());
    }
    let file = folder.join(name).with_extension("txt");
    fs::write(&file, requirements).map_err(described)?;
    run(Command::new(folder.join("bin/python"))
        .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"])
        .arg(&file))?;
    fs::write(&stamp, requirements).map_err(described)
}

fn described(error: std::io::Error) -> String {
    error.to_string()
}

/// Runs a command to its end and returns its stdout.
fn run(command: &mut Command) -> Result<String, String> {
    let Output { status, stdout, stderr } =
        command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if !status.success() {
        return Err(format!(
            "{command:?}: {status}\n{}{}",
            String::from_utf8_lossy(&stdout),
            String::from_utf8_lossy(&stderr)
        ));
    }
    Ok(String::from_utf8_lossy(&stdout).into_owned())
}

/// Makes a folder of Python sources equal to another one.
fn copy_folder(from: &Path, to: &Path) -> Result<(), String> {
    fs::create_dir_all(to).map_err(described)?;
    let query: Vec<PathBuf> =
        entries(from)?.into_iter().filter(|path| !path.ends_with("__pycache__")).collect();
    // a source that was deleted must not be importable
    for path in entries(to)? {
        let same = query.iter().any(|query| query.file_name() == path.file_name());
        let is_extension = path.extension().is_some_and(|ending| ending == "so");
        match (same || is_extension, path.is_dir()) {
            (true, _) => {}
            (false, true) => fs::remove_dir_all(&path).map_err(described)?,
            (false, false) => fs::remove_file(&path).map_err(described)?,
        }
    }
    for path in query {
        let Some(name) = path.file_name() else { continue };
        if path.is_dir() {
            copy_folder(&path, &to.join(name))?
        } else {
            copy_file(&path, &to.join(name))?
        }
    }
    Ok(())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let entries = fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    entries.map(|entry| entry.map(|entry| entry.path()).map_err(described)).collect()
}

/// Copies a file that differs, under another name first, so that a process that has the old file
/// open keeps it.
fn copy_file(from: &Path, to: &Path) -> Result<(), String> {
    let bytes = fs::read(from).map_err(|error| format!("{}: {error}", from.display()))?;
    if fs::read(to).is_ok_and(|there| there == bytes) {
        return Ok(());
    }
    let fresh = to.with_extension("fresh");
    fs::write(&fresh, bytes).map_err(described)?;
    fs::rename(&fresh, to).map_err(described)
}
