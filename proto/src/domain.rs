//! The directory and the file names of one user in shared memory.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::ops::Deref;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use iceoryx2::prelude::{
    Config, FileName, LogLevel, NodeBuilder, SemanticString, ServiceName, SignalHandlingMode,
    set_log_level,
};
use rustix::fs::{Mode, OFlags, statvfs};
use rustix::process::{Resource, getrlimit};

use crate::lane::Threadsafe;
use crate::{Node, fnv1a_64};

/// The longest name that a server may have.
pub const MAX_NAME: usize = 64;

/// Where the kernel keeps named shared memory.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";
/// The file that processes with a node of the domain hold locked.
const ALIVE: &str = "alive";
/// The file with the random part of the names of the domain's nodes.
const PREFIX: &str = "prefix";
/// The file that marks a root directory made by sarrus; a root without it existed before and stays.
const MADE: &str = "made";

/// The directory and the names of all shared memory of one installation, fixed in code: no
/// configuration file changes them.
///
/// Every user has a separate domain: `/run/user/UID/sarrus` if the system makes such folders, else
/// `/tmp/sarrus-UID`; the environment variable `SARRUS_ROOT` names another directory, which is a
/// separate domain. Names in shared memory are [`Domain::prefix`] followed by random digits that
/// only this user can read.
#[derive(Clone, Debug)]
pub struct Domain {
    root: PathBuf,
    /// A second root where a server of this user may be, depending on its start time.
    other: Option<PathBuf>,
}

/// A node of this process in a domain; the domain is not cleared while it exists.
#[derive(Debug)]
pub struct DomainNode {
    // dropped before the lock, under which its files are cleared
    node: Node,
    _alive: Arc<File>,
}

impl Deref for DomainNode {
    type Target = Node;

    fn deref(&self) -> &Node {
        &self.node
    }
}

/// The reason why the shared memory cannot be entered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DomainError {
    /// The root directory can neither be found nor made: its path, the system's error.
    #[error(
        "{0}: {1}; make the directory writable for this user or name another one in \
         SARRUS_ROOT"
    )]
    Root(PathBuf, #[source] io::Error),
    /// The root directory belongs to another user.
    #[error(
        "{path} belongs to user {owner}, expected {user}; remove it or name another directory in \
         SARRUS_ROOT"
    )]
    Foreign {
        /// The directory.
        path: PathBuf,
        /// Its owner.
        owner: u32,
        /// The user of this process.
        user: u32,
    },
    /// Other users may write to the root directory.
    #[error("others may write to {0}, expected this user alone; `chmod 700 {0}`")]
    Open(PathBuf),
    /// The path of the root directory cannot be used.
    #[error(
        "{0} cannot be the root of shared memory; give an absolute path of at most {MAX_ROOT} \
         characters, letters without accents, digits and `/`, `-`, `_`, `.`, in SARRUS_ROOT"
    )]
    Path(PathBuf),
    /// A server's name is empty, too long or has invalid characters.
    #[error(
        "`{0}` is no name for a server; use 1 to {MAX_NAME} letters, digits, `.`, `-` or `_`, \
         and no `.` first"
    )]
    Name(String),
    /// The node of this process cannot be made: the directory, the reason.
    #[error("no node in shared memory under {0}: {1}")]
    Node(PathBuf, String),
}

impl Domain {
    /// The domain of this user.
    pub fn of_user() -> Result<Domain, DomainError> {
        if let Some(root) = std::env::var_os("SARRUS_ROOT").filter(|root| !root.is_empty()) {
            return Domain::at(Path::new(&root));
        }
        let user = rustix::process::geteuid().as_raw();
        let runtime = PathBuf::from(format!("/run/user/{user}"));
        let fallback = PathBuf::from(format!("/tmp/sarrus-{user}"));
        let is_ours =
            fs::metadata(&runtime).is_ok_and(|found| found.is_dir() && found.uid() == user);
        match is_ours {
            true => {
                let domain = Domain::at(&runtime.join("sarrus"))?;
                // a server may have started before the user's folder existed; a directory of
                // another user is not used
                let other = Domain::at(&fallback).ok().map(|domain| domain.root);
                Ok(Domain { other, ..domain })
            }
            false => Domain::at(&fallback),
        }
    }

    /// The domain under a directory, which must belong to this user if it exists.
    pub fn at(root: &Path) -> Result<Domain, DomainError> {
        set_log_level(LogLevel::Fatal);
        if !root.is_absolute() || root.as_os_str().len() > MAX_ROOT {
            return Err(DomainError::Path(root.to_owned()));
        }
        // whatever else the transport does not take
        config(root, "sarrus_")?;
        let domain = Domain { root: root.to_owned(), other: None };
        domain.check_owner()?;
        Ok(domain)
    }

    /// The directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The prefix of this domain's files in /dev/shm.
    pub fn prefix(&self) -> String {
        // the files of all roots lie side by side there
        format!("sarrus_{:08x}_", hash(&self.root.to_string_lossy()))
    }

    /// The folders where a server of this name may be, the likely one first.
    pub fn server_folders(&self, name: &ServerName) -> impl Iterator<Item = PathBuf> {
        let roots = [Some(self.root.clone()), self.other.clone()];
        roots.into_iter().flatten().map(move |root| root.join("server").join(name.as_str()))
    }

    /// A node of this process in the domain; removes the files of dead processes.
    pub fn node(&self) -> Result<DomainNode, DomainError> {
        let _lock = self.lock(File::lock_shared)?;
        let failed = |source| DomainError::Root(self.root.clone(), source);
        let alive = self.open(ALIVE).map_err(failed)?;
        alive.lock_shared().map_err(failed)?;
        let random = self.random_part().map_err(failed)?;
        let config = config(&self.root, &format!("{}{random}_", self.prefix()))?;
        Ok(DomainNode { node: node(&self.root, &config)?, _alive: Arc::new(alive) })
    }

    /// Removes the files of nodes after the last node has closed, and the root directory if it is
    /// empty and made by sarrus.
    pub(crate) fn clear_nodes(&self) -> Vec<PathBuf> {
        let lock = self.lock_existing(|directory| directory.try_lock().map_err(io::Error::from));
        let Ok(Some(_lock)) = lock else { return Vec::new() };
        let Ok(alive) = self.open(ALIVE) else { return Vec::new() };
        if alive.try_lock().is_err() {
            return Vec::new();
        }
        let mut cleared = Vec::new();
        if let Ok(random) = fs::read_to_string(self.root.join(PREFIX)) {
            cleared.extend(remove_shared(&format!("{}{random}_", self.prefix())));
        }
        for folder in ["nodes", "services"].map(|name| self.root.join(name)) {
            if folder.exists() && fs::remove_dir_all(&folder).is_ok() {
                cleared.push(folder);
            }
        }
        for file in [PREFIX, ALIVE] {
            let _ = fs::remove_file(self.root.join(file));
        }
        if self.remove_root() {
            cleared.push(self.root.clone());
        }
        cleared
    }

    /// Removes the root directory if sarrus made it and no process uses it; true if it is gone.
    fn remove_root(&self) -> bool {
        let made = self.root.join(MADE);
        let is_ours = fs::symlink_metadata(&made).is_ok_and(|found| found.is_file());
        let is_only = |entry: io::Result<fs::DirEntry>| entry.is_ok_and(|x| x.file_name() == MADE);
        if !is_ours || !fs::read_dir(&self.root).is_ok_and(|mut found| found.all(is_only)) {
            return false;
        }
        let gone = fs::remove_file(&made).and_then(|()| fs::remove_dir(&self.root)).is_ok();
        if !gone {
            // another process has entered meanwhile
            let _ = self.open(MADE);
        }
        gone
    }

    /// The random part of the names of nodes, made on first use.
    fn random_part(&self) -> io::Result<String> {
        let path = self.root.join(PREFIX);
        loop {
            match fs::read_to_string(&path) {
                Ok(text) if text.len() == 8 => return Ok(text),
                // half-written by a process that died
                Ok(_) => fs::remove_file(&path)?,
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
            // a character that no number of a run has
            let text = format!("n{:07x}", random() & 0xfff_ffff);
            let draft = self.root.join(format!("{PREFIX}.{text}"));
            fs::write(&draft, &text)?;
            // the first one stays
            let _ = fs::hard_link(&draft, &path);
            fs::remove_file(&draft)?;
        }
    }

    fn open(&self, name: &str) -> io::Result<File> {
        let flags = OFlags::NOFOLLOW | OFlags::CLOEXEC;
        fs::OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(flags.bits() as i32)
            .open(self.root.join(name))
    }

    /// The root directory, created if missing, and locked: no process tidies while another creates
    /// a node.
    fn lock(&self, lock: impl Fn(&File) -> io::Result<()>) -> Result<File, DomainError> {
        loop {
            self.make_root()?;
            if let Some(directory) = self.lock_existing(&lock)? {
                return Ok(directory);
            }
        }
    }

    /// The locked root directory; `None` if it does not exist.
    fn lock_existing(
        &self,
        lock: impl Fn(&File) -> io::Result<()>,
    ) -> Result<Option<File>, DomainError> {
        let failed = |source| DomainError::Root(self.root.clone(), source);
        let directory = match File::open(&self.root) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            other => other.map_err(failed)?,
        };
        lock(&directory).map_err(failed)?;
        // it may have been removed between opening and locking
        Ok(is_at(&directory, &self.root).then_some(directory))
    }

    /// The second root where a server may be.
    pub(crate) fn other(&self) -> Option<Domain> {
        let root = self.other.clone()?;
        Some(Domain { root, other: None })
    }

    pub(crate) fn make_root(&self) -> Result<(), DomainError> {
        let failed = |source| DomainError::Root(self.root.clone(), source);
        make_root(&self.root).map_err(failed)?;
        self.check_owner()
    }

    fn check_owner(&self) -> Result<(), DomainError> {
        let user = rustix::process::geteuid().as_raw();
        let failed = |source| DomainError::Root(self.root.clone(), source);
        match fs::symlink_metadata(&self.root) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(source) => Err(failed(source)),
            Ok(found) if found.uid() == user && found.is_dir() => {
                // a group of the user's own number has no other member
                let others = if found.gid() == user { 0o002 } else { 0o022 };
                match found.mode() & others {
                    0 => Ok(()),
                    _ => Err(DomainError::Open(self.root.clone())),
                }
            }
            Ok(found) if found.uid() == user => Err(failed(io::ErrorKind::NotADirectory.into())),
            Ok(found) => {
                Err(DomainError::Foreign { path: self.root.clone(), owner: found.uid(), user })
            }
        }
    }
}

/// The longest path of a root. The transport ends a process whose paths get longer than 255; the
/// longest is that of a connection in a link: 1 + 8 and 1 + 6 for the folders, 1 + 32 for the
/// prefix, 41 for the service, 11 for the suffix, and two port identifiers of at most 31 digits
/// each, if a link has fewer than 126 ports.
const MAX_ROOT: usize = 90;

/// The transport's settings for a part of shared memory.
pub(crate) fn config(root: &Path, prefix: &str) -> Result<Config, DomainError> {
    let path_error = || DomainError::Path(root.to_owned());
    let text = root.to_str().ok_or_else(path_error)?;
    let mut config = Config::default();
    config
        .global
        .set_root_path(&iceoryx2::prelude::Path::new(text.as_bytes()).map_err(|_| path_error())?);
    config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| path_error())?;
    Ok(config)
}

/// A node in a part of shared memory.
pub(crate) fn node(root: &Path, config: &Config) -> Result<Node, DomainError> {
    let builder =
        NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).config(config);
    let node = builder
        .create::<Threadsafe>()
        .map_err(|error| DomainError::Node(root.to_owned(), reason(&error)))?;
    // the transport lets every user write the counter of nodes
    close_to_others(&config.global.prefix.to_string());
    Ok(Node::new(node))
}

/// The name of the transport's counter of nodes behind the prefix: the hash of a type's name and
/// the version.
const COUNTER: &str = "9204dd183d1c4d8e1ff592a30766ffa6765aa8b5_node.0_10_0.global_mgmt";

/// The counter of nodes, which no process maps for long; searched for if another compiler gave it
/// another name.
fn counter(prefix: &str) -> Option<PathBuf> {
    let path = Path::new(SHARED_MEMORY).join(format!("{prefix}{COUNTER}"));
    let is_counter = |path: &PathBuf| path.extension().is_some_and(|end| end == "global_mgmt");
    if path.exists() { Some(path) } else { shared_files(prefix).find(is_counter) }
}

/// Removes other users' access to the counter of nodes.
fn close_to_others(prefix: &str) {
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    if let Some(path) = counter(prefix)
        && let Ok(file) = rustix::fs::open(&path, flags, Mode::empty())
        && rustix::fs::fstat(&file).is_ok_and(|found| found.st_mode & 0o077 != 0)
    {
        // a file of another user stays unchanged
        let _ = rustix::fs::fchmod(&file, Mode::RUSR | Mode::WUSR);
    }
}

/// Descriptors that a process needs for one more client or server.
const DESCRIPTORS: u64 = 24;
/// Least shared memory for making anything `[byte]`.
const LEAST_MEMORY: u64 = 64 << 10;

/// The cause of a transport failure. The transport seldom reports it, so the usual causes are
/// checked.
pub(crate) fn reason(error: &dyn std::fmt::Debug) -> String {
    let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
    // no descriptor is left to inspect them
    let open = fs::read_dir("/proc/self/fd").map_or(limit, |found| found.count() as u64);
    let free = free_shared_memory();
    if open.saturating_add(DESCRIPTORS) > limit {
        format!(
            "{error:?}: this process has {open} files open of {limit} that it may; raise the \
             limit, `ulimit -n`"
        )
    } else if free < LEAST_MEMORY {
        format!(
            "{error:?}: {SHARED_MEMORY} has {} KiB left; remove what is not needed there \
             (`sarrus tidy`) or give it more room",
            free / 1024
        )
    } else {
        format!(
            "{error:?}; see whether the directory and {SHARED_MEMORY} can be written, and clear \
             what dead processes left, `sarrus tidy`"
        )
    }
}

/// Shared memory that is still free `[byte]`.
pub fn free_shared_memory() -> u64 {
    // an unknown value is no reason for a refusal
    statvfs(SHARED_MEMORY).map_or(u64::MAX, |found| found.f_bavail.saturating_mul(found.f_frsize))
}

/// A folder of this user alone, with those above it.
pub(crate) fn make_folder(path: &Path) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// Makes a root and marks it as made here.
pub(crate) fn make_root(path: &Path) -> io::Result<()> {
    if let Some(parent) = path.parent() {
        make_folder(parent)?;
    }
    match fs::DirBuilder::new().mode(0o700).create(path) {
        // if the process dies here, the root is not marked as made here, and stays
        Ok(()) => fs::OpenOptions::new()
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(path.join(MADE))
            .map(drop)
            .or_else(|error| match error.kind() {
                // removed again meanwhile
                io::ErrorKind::NotFound | io::ErrorKind::AlreadyExists => Ok(()),
                _ => Err(error),
            }),
        Err(_) if path.is_dir() => Ok(()),
        Err(error) => Err(error),
    }
}

/// True while this open directory is the one at `path`.
pub(crate) fn is_at(directory: &File, path: &Path) -> bool {
    let id = |found: fs::Metadata| (found.dev(), found.ino());
    let there = fs::symlink_metadata(path).map(id);
    directory.metadata().map(id).is_ok_and(|ours| there.is_ok_and(|there| ours == there))
}

/// The files in shared memory that this process maps and whose names begin with `prefix`, and the
/// counter of nodes. Takes no longer for the files of other programs there.
pub(crate) fn used_files(prefix: &str) -> BTreeSet<PathBuf> {
    let Ok(maps) = fs::read_to_string("/proc/self/maps") else {
        return shared_files(prefix).collect();
    };
    let start = format!("{SHARED_MEMORY}/{prefix}");
    let names = maps.lines().filter_map(|line| line.find(&start).map(|at| &line[at..]));
    // a removed file has a remark behind its name
    let mapped = names.filter(|name| !name.contains(' ')).map(PathBuf::from);
    mapped.chain(counter(prefix)).collect()
}

/// The files in shared memory whose names begin with `prefix`; takes time for each file there.
pub(crate) fn shared_files(prefix: &str) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(SHARED_MEMORY)
        .into_iter()
        .flatten()
        .flatten()
        .filter(move |entry| {
            entry.file_name().to_str().is_some_and(|name| name.starts_with(prefix))
        })
        .map(|entry| entry.path())
}

/// Removes the files in shared memory whose names begin with `prefix`; returns them.
pub(crate) fn remove_shared(prefix: &str) -> Vec<PathBuf> {
    shared_files(prefix).filter(|path| fs::remove_file(path).is_ok()).collect()
}

/// A random number that cannot be guessed.
pub(crate) fn random() -> u64 {
    let mut bytes = [0; 8];
    // a kernel without random numbers cannot run this server
    let _ = rustix::rand::getrandom(&mut bytes, rustix::rand::GetRandomFlags::empty());
    u64::from_le_bytes(bytes)
}

/// The services of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerName(String);

impl ServerName {
    /// Checks a name.
    pub fn new(name: &str) -> Result<ServerName, DomainError> {
        let good =
            |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-' | '_');
        // `.` and `..` are other folders
        if name.is_empty()
            || name.starts_with('.')
            || name.len() > MAX_NAME
            || !name.chars().all(good)
        {
            return Err(DomainError::Name(name.to_owned()));
        }
        Ok(ServerName(name.to_owned()))
    }

    /// The name as given.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// A service of the CAN bridge of this name.
    pub fn bridge(&self, part: &str) -> Result<ServiceName, DomainError> {
        ServiceName::new(&format!("sarrus/{}/can/{part}", self.0))
            .map_err(|_| DomainError::Name(self.0.clone()))
    }
}

/// FNV-1a, folded to 32 bits.
fn hash(text: &str) -> u32 {
    let hash = fnv1a_64(text.as_bytes());
    (hash ^ hash >> 32) as u32
}

#[cfg(test)]
mod tests;
