//! Shared objects that were made once, in a folder of the user's.
//!
//! The path is `COMPILER/FINGERPRINT-QUERY.so`, hashes of its origin: the compiler with its flags
//! and the version and the revision of sarrus, the robot, the query. A name proves nothing: an
//! object from here is compared with the hash behind it, checked like any other, and made again
//! where it is refused.

use std::collections::hash_map::RandomState;
use std::ffi::OsString;
use std::fs::{self, DirBuilder, File};
use std::hash::{BuildHasher, Hasher};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant, SystemTime};

use sarrus_dynamics::{Model, Plan};
use sarrus_proto::fnv1a_64;

use rustix::fs::{Access, FlockOperation, flock};

use super::file::sum;
use super::{LoadError, LoadFault, NativeKernel, ObjectFile};
use crate::manifest::{HEAD, bare_query, query_text};
use crate::run::run;
use crate::{BuildError, Cancel, Compiler, FLAGS, GenerateError, Kernel, Source};

/// Objects that are kept for one compiler.
const KEPT: usize = 256;
/// Prefix of the names of build folders.
const BUILD: &str = ".build-";
/// Most symbolic links in the path of the folder, as of the kernel.
const LINKS: usize = 40;
/// The file in it that its process locks.
const LOCK: &str = "lock";
/// From which age on such a folder is of a process that ended within its build: no build takes so
/// long.
const ABANDONED: Duration = Duration::from_secs(3600);
/// The longest time for which an object may be tried.
const TRIAL: Duration = Duration::from_secs(30);

/// Last line of a trial that succeeds: an object may end its process with 0.
const COMPARED: &str = "compared";

/// The program that loads an object with [`NativeKernel::of_file`] and prints `compared`, or ends
/// with another code than 0 and the reason on stderr.
pub type Trial = fn(&Path) -> Command;

/// Where objects are kept.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    trial: Option<Trial>,
}

/// Why there is no such folder.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CacheError {
    /// Neither `XDG_CACHE_HOME` nor `HOME` is set.
    #[error("no folder for kernels: set HOME or XDG_CACHE_HOME")]
    Nowhere,
    /// It cannot be made or read.
    #[error("{}: {error}", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// Another user owns it, or others may write into it.
    #[error("{}: not a folder that only this user may write; chmod 700 or remove it", .0.display())]
    Open(PathBuf),
    /// A folder above it belongs to another user, or others may write into it.
    #[error(
        "{}: another user may put a folder of kernels here; chmod go-w, or set XDG_CACHE_HOME",
        .0.display()
    )]
    Above(PathBuf),
}

/// Why no kernel was made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MakeError {
    /// There is no straight line.
    #[error(transparent)]
    Generate(#[from] GenerateError),
    /// There is no compiler.
    #[error("no C compiler: set CC, or install cc{}", crate::compiler::why_not_found())]
    NoCompiler,
    /// The compiler cannot be run, fails, takes too long, or the caller cancelled it.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// A new or a kept object is refused.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// There is nowhere to keep it.
    #[error(transparent)]
    Cache(#[from] CacheError),
    /// No object of this robot and query is kept.
    #[error("none is kept for this robot and query")]
    NotKept,
}

/// Where a kernel came from.
#[derive(Debug)]
pub enum Origin {
    /// It was kept.
    Kept,
    /// It was made in this time; `refused` is the reason why a kept one is not used.
    Made {
        /// From the plan to the checked kernel.
        time: Duration,
        /// Arithmetic operations of it.
        operations: usize,
        /// Why one that was there is not used.
        refused: Option<LoadError>,
    },
}

/// A kernel with its origin.
#[derive(Debug)]
pub struct Made {
    /// The kernel.
    pub kernel: NativeKernel,
    /// The file that it is kept in.
    pub path: PathBuf,
    /// Where it came from.
    pub origin: Origin,
}

impl Cache {
    /// In a folder, which is made when it is needed.
    pub fn at(folder: PathBuf) -> Cache {
        Cache { folder, trial: None }
    }

    /// Has this program try each object, new or kept, before this process loads it. Without one, a
    /// new object is tried by the test program of its source, and a kept one was.
    pub fn tried_by(self, trial: Trial) -> Cache {
        Cache { trial: Some(trial), ..self }
    }

    /// In the usual folder, by the conventions of XDG; `of` gives variables of the environment.
    ///
    /// # Errors
    /// [`CacheError::Nowhere`].
    pub fn usual(of: impl Fn(&str) -> Option<OsString>) -> Result<Cache, CacheError> {
        let of = |name: &str| of(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let base = of("XDG_CACHE_HOME").or_else(|| of("HOME").map(|home| home.join(".cache")));
        Ok(Cache::at(base.ok_or(CacheError::Nowhere)?.join("sarrus/kernels")))
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// A kept kernel, made by any compiler; runs no program. Allocates.
    ///
    /// # Errors
    /// [`MakeError::NotKept`], [`MakeError::Load`], [`MakeError::Cache`].
    pub fn find(&self, model: &Model<f64>, plan: &Plan) -> Result<NativeKernel, MakeError> {
        let name = file_name(model, plan);
        let compilers = match fs::read_dir(&self.folder) {
            Ok(compilers) => compilers,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(MakeError::NotKept);
            }
            Err(error) => return Err(io_error(&self.folder, error).into()),
        };
        self.check(&self.folder)?;
        let mut paths: Vec<PathBuf> =
            compilers.flatten().map(|entry| entry.path().join(&name)).collect();
        paths.retain(|path| path.is_file());
        paths.sort();
        let mut refused = None;
        for path in paths {
            let file = ObjectFile::read_kept(&path, &path);
            match file.and_then(|file| NativeKernel::load(&file, model, plan)) {
                Ok(kernel) => {
                    touch(&path);
                    return Ok(kernel);
                }
                Err(error) => refused = Some(error),
            }
        }
        Err(refused.map_or(MakeError::NotKept, MakeError::Load))
    }

    /// The kernel of a plan: the one that is kept, else a new one, which takes a compiler
    /// with its time and memory. Allocates.
    ///
    /// # Errors
    /// [`MakeError`] with the reason; nothing of an attempt stays in the folder.
    pub fn kernel(
        &self,
        model: &Model<f64>,
        plan: &Plan,
        compiler: &Compiler,
        cancel: &Cancel,
    ) -> Result<Made, MakeError> {
        let folder = self.folder.join(compiler_name(compiler));
        let path = folder.join(file_name(model, plan));
        for folder in [&self.folder, &folder].into_iter().filter(|folder| folder.exists()) {
            self.check(folder)?;
        }
        let refused = match ObjectFile::read_kept(&path, &path) {
            Err(LoadError { fault: LoadFault::Io(error), .. })
                if error.kind() == io::ErrorKind::NotFound =>
            {
                None
            }
            Err(error) => Some(error),
            Ok(file) => match self.load(&file, &path, model, plan, cancel) {
                Ok(kernel) => {
                    touch(&path);
                    return Ok(Made { kernel, path, origin: Origin::Kept });
                }
                Err(MakeError::Load(error)) => Some(error),
                Err(error) => return Err(error),
            },
        };
        // before a trace that would be for nothing
        writable(&folder)?;
        if path.is_dir() {
            fs::remove_dir(&path).map_err(|error| io_error(&path, error))?;
        }

        let start = Instant::now();
        let kernel = Kernel::trace(model, plan)?;
        if cancel.is_cancelled() {
            return Err(BuildError::Cancelled.into());
        }
        let source = Source::new(&kernel, model, &function_name(model, plan));
        for folder in [&self.folder, &folder] {
            let mut builder = DirBuilder::new();
            let made = builder.recursive(true).mode(0o700).create(folder);
            made.map_err(|error| io_error(folder, error))?;
            self.check(folder)?;
        }
        let build = Build::new(&folder)?;
        Compiler::write(&source, &build.folder)?;
        let built = match self.trial {
            Some(_) => compiler.library(&source, &build.folder, &[], cancel)?,
            None => {
                let built = compiler.build(&source, &build.folder, &[], cancel)?;
                built.test(cancel)?;
                built.library
            }
        };
        let new = build.folder.join("new");
        let file = finished(&built, &new, &path)?;
        let loaded = self.load(&file, &new, model, plan, cancel)?;
        // every reader gets either the old file or the new one
        fs::rename(&new, &path).map_err(|error| io_error(&path, error))?;
        remove_oldest(&folder);
        let time = start.elapsed();
        let operations = kernel.operations();
        let origin = Origin::Made { time, operations, refused };
        Ok(Made { kernel: loaded, path, origin })
    }

    /// Loads an object that another process has loaded before, from the file `from`.
    fn load(
        &self,
        file: &ObjectFile,
        from: &Path,
        model: &Model<f64>,
        plan: &Plan,
        cancel: &Cancel,
    ) -> Result<NativeKernel, MakeError> {
        if let Some(trial) = self.trial {
            let refused = |reason| LoadFault::Trial(reason).of(file.path());
            match run(&mut trial(from), "it", TRIAL, cancel) {
                Ok(ended) if ended.is_success && ended.words.ends_with(COMPARED) => {}
                Ok(ended) if ended.is_success => {
                    return Err(refused(format!("it ended early: {}", ended.words)).into());
                }
                Ok(ended) => return Err(refused(ended.words).into()),
                Err(BuildError::Cancelled) => return Err(BuildError::Cancelled.into()),
                Err(error) => return Err(refused(error.to_string()).into()),
            }
        }
        Ok(NativeKernel::load(file, model, plan)?)
    }

    /// Only this user may write into it, and only this user and root may put another folder in its
    /// place: every folder above is checked, and those above each symbolic link's target, as sshd
    /// checks its files. A group with the user's number counts as the user's own.
    fn check(&self, folder: &Path) -> Result<(), CacheError> {
        let user = rustix::process::geteuid().as_raw();
        let about = fs::symlink_metadata(folder).map_err(|error| io_error(folder, error))?;
        if !about.is_dir() || about.uid() != user || about.mode() & 0o022 != 0 {
            return Err(CacheError::Open(folder.to_owned()));
        }
        let mut named = std::path::absolute(folder).map_err(|error| io_error(folder, error))?;
        for _ in 0..LINKS {
            let mut link = None;
            for above in named.ancestors() {
                let about = fs::symlink_metadata(above).map_err(|error| io_error(above, error))?;
                let others = if about.gid() == user { 0o002 } else { 0o022 };
                // in a sticky folder only the owner of an entry replaces it
                let is_closed = about.mode() & others == 0 || about.mode() & 0o1000 != 0;
                if ![0, user].contains(&about.uid()) || !(is_closed || about.is_symlink()) {
                    return Err(CacheError::Above(above.to_owned()));
                }
                if about.is_symlink() {
                    link = Some(above);
                }
            }
            // the link nearest to the root, and the same path without it
            let Some(link) = link else { return Ok(()) };
            let target = fs::read_link(link).map_err(|error| io_error(link, error))?;
            let rest = named.strip_prefix(link).unwrap_or(Path::new(""));
            let there = link.parent().unwrap_or(Path::new("/")).join(target);
            named = if rest == Path::new("") { there } else { there.join(rest) };
        }
        Err(CacheError::Above(named))
    }
}

fn io_error(path: &Path, error: io::Error) -> CacheError {
    CacheError::Io { path: path.to_owned(), error }
}

/// Whether a folder can be written, or made where it is missing.
fn writable(folder: &Path) -> Result<(), CacheError> {
    let there = folder.ancestors().find(|path| path.exists()).unwrap_or(folder);
    let access = rustix::fs::access(there, Access::WRITE_OK | Access::EXEC_OK);
    access.map_err(|error| io_error(there, error.into()))
}

/// Writes the bytes of the compiler's file, which may be a link to another one, to a new file with
/// their hash behind them, and reads it. Its errors name the path under which it will be kept.
fn finished(built: &Path, new: &Path, path: &Path) -> Result<ObjectFile, MakeError> {
    use std::os::unix::fs::PermissionsExt;
    let built = ObjectFile::read_built(built)?;
    let written = File::create_new(new).and_then(|mut file| {
        // the mode of a new file depends on the user's mask
        file.set_permissions(fs::Permissions::from_mode(0o600))?;
        file.write_all(&built.bytes)?;
        file.write_all(sum(&built.bytes).as_bytes())?;
        // a name that is on the disk before its bytes would name a part of them after a power cut
        file.sync_all()
    });
    written.map_err(|error| io_error(path, error))?;
    Ok(ObjectFile::read_kept(new, path)?)
}

/// Marks an object as used: the one that was used longest ago goes first.
fn touch(path: &Path) {
    if let Ok(file) = File::open(path) {
        let _ = file.set_modified(SystemTime::now());
    }
}

fn function_name(model: &Model<f64>, plan: &Plan) -> String {
    let request = plan.query().check(model.info()).map_or("query", |request| request.name());
    format!("{}_{request}", model.name())
}

fn file_name(model: &Model<f64>, plan: &Plan) -> String {
    let query = fnv1a_64(query_text(&bare_query(plan.query())).as_bytes());
    format!("{:016x}-{query:016x}.so", model.fingerprint())
}

fn compiler_name(compiler: &Compiler) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let words = [&compiler.command, compiler.name(), version, HEAD, &FLAGS.join(" ")].join("\n");
    format!("{:016x}", fnv1a_64(words.as_bytes()))
}

/// All but the objects that were used last go.
fn remove_oldest(folder: &Path) {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let objects = entries.map(|entry| entry.path());
    let time = |path: PathBuf| {
        let time = fs::metadata(&path).and_then(|about| about.modified());
        (time.unwrap_or(SystemTime::UNIX_EPOCH), path)
    };
    let is_object = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "so");
    let mut objects: Vec<_> = objects.filter(is_object).map(time).collect();
    objects.sort();
    for (_, path) in objects.iter().rev().skip(KEPT) {
        let _ = fs::remove_file(path);
    }
}

/// The folder of one build, gone when dropped, and the file that is locked as long as its process
/// lives, where there are locks.
struct Build {
    folder: PathBuf,
    _lock: Option<File>,
}

impl Build {
    /// Makes it, and removes those of processes that ended in the middle of theirs.
    fn new(folder: &Path) -> Result<Build, CacheError> {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let is_build = entry.file_name().to_string_lossy().starts_with(BUILD);
            let made = entry.metadata().and_then(|about| about.modified());
            let age = made.ok().and_then(|made| made.elapsed().ok());
            let is_old = age.is_some_and(|age| age > ABANDONED);
            if is_build && (is_old || is_unlocked(&entry.path())) {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
        // no number of a process: other machines and containers may share the folder
        let name = RandomState::new().build_hasher().finish();
        let path = folder.join(format!("{BUILD}{name:016x}"));
        let made = DirBuilder::new().mode(0o700).create(&path);
        made.map_err(|error| io_error(&path, error))?;
        let lock = locked(&path);
        Ok(Build { folder: path, _lock: lock })
    }
}

/// Locks a folder; its lock has its name only when it is locked.
fn locked(folder: &Path) -> Option<File> {
    let new = folder.join("lock.new");
    let file = File::options().write(true).create_new(true).open(&new).ok()?;
    flock(&file, FlockOperation::NonBlockingLockExclusive).ok()?;
    fs::rename(new, folder.join(LOCK)).ok()?;
    Some(file)
}

/// Whether the process that locked a folder has ended.
fn is_unlocked(folder: &Path) -> bool {
    let file = File::options().write(true).open(folder.join(LOCK));
    file.is_ok_and(|file| flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok())
}

impl Drop for Build {
    fn drop(&mut self) {
        // processes that a compiler started may write until the system has ended them
        for _ in 0..20 {
            match fs::remove_dir_all(&self.folder) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    std::thread::sleep(Duration::from_millis(5));
                }
                _ => return,
            }
        }
    }
}
