//! The folders of one run of a server: the name that it serves under, and one part of shared memory
//! for each connection.
//!
//! `ROOT/server/NAME` is locked by the process that serves under this name and holds its control
//! socket; `ROOT/INSTANCE` is locked by the same process and holds a folder for each connection. A
//! lock ends with its process, even if the process is killed, so any process may clear an unlocked
//! folder: nothing else decides whether a run is alive.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::prelude::Config;
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate};

pub use crate::domain::free_shared_memory;
use crate::domain::{
    config, is_at, make_folder, node, random, remove_shared, shared_files, used_files,
};
use crate::socket::ControlListener;
use crate::{Domain, DomainError, Node, ServerName};

/// Longest wait of the transport for an unfinished file of a link.
const HALF_MADE: Duration = Duration::from_millis(100);
/// Numbers of links: six hexadecimal digits, for which paths have room.
const LINK_NUMBERS: u64 = 0xff_ffff;

/// Numbers of runs: eight hexadecimal digits.
const INSTANCES: u64 = 0xffff_ffff;

/// A server's name and folder, held until this is dropped, which removes all files of the run.
#[derive(Debug)]
pub struct Run {
    domain: Domain,
    name_folder: PathBuf,
    name_lock: File,
    folder: PathBuf,
    folder_lock: File,
    instance: u64,
}

/// The reason why a run cannot start.
#[derive(Debug)]
pub enum RunError {
    /// Another process serves under this name.
    Taken,
    /// A folder cannot be made or locked.
    Folder {
        /// The folder.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// The domain cannot be entered.
    Domain(DomainError),
}

impl Run {
    /// Takes a name, after the files of dead servers are removed.
    pub fn start(domain: &Domain, name: &ServerName) -> Result<Run, RunError> {
        domain.make_root().map_err(RunError::Domain)?;
        let name_folder = domain.root().join("server").join(name.as_str());
        let name_lock = loop {
            match lock_folder(&name_folder) {
                Ok(Some(lock)) => break lock,
                Ok(None) => return Err(RunError::Taken),
                // another process removed it meanwhile
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(RunError::Folder { path: name_folder, source }),
            }
        };
        clear_dead(domain);
        loop {
            let instance = random() & INSTANCES;
            let folder = instance_folder(domain, instance);
            match lock_folder(&folder) {
                Ok(Some(folder_lock)) => {
                    let domain = domain.clone();
                    let run = Run { domain, name_folder, name_lock, folder, folder_lock, instance };
                    return Ok(run);
                }
                Ok(None) => {}
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(RunError::Folder { path: folder, source }),
            }
        }
    }

    /// Distinguishes the runs of a server.
    pub fn instance(&self) -> u64 {
        self.instance
    }

    /// The folder of the name.
    pub fn name_folder(&self) -> &Path {
        &self.name_folder
    }

    /// The socket that clients connect to.
    ///
    /// # Errors
    /// `AlreadyExists`: another server has taken the name.
    pub fn listen(&self) -> io::Result<ControlListener> {
        if !is_at(&self.name_lock, &self.name_folder) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        ControlListener::new(&self.name_folder)
    }

    /// Makes the folders again if they were removed, as cleaners of temporary files do; true if
    /// they were.
    pub fn restore(&mut self) -> bool {
        // a root of another user stays unchanged
        if self.domain.make_root().is_err() {
            return false;
        }
        let mut any = false;
        let folders =
            [(&self.name_folder, &mut self.name_lock), (&self.folder, &mut self.folder_lock)];
        for (folder, lock) in folders {
            if !is_at(lock, folder)
                && let Ok(Some(fresh)) = lock_folder(folder)
            {
                *lock = fresh;
                any = true;
            }
        }
        any
    }

    /// A part of shared memory for one connection, with its number: random, so that no other
    /// process can take its names in advance.
    pub fn new_link(&self) -> Result<(u64, Link), DomainError> {
        loop {
            let number = random() & LINK_NUMBERS;
            let link = Link::new(&self.domain, self.instance, number)?;
            if !link.root.exists() {
                return Ok((number, link));
            }
        }
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        // a folder that was taken over meanwhile belongs to another process
        if is_at(&self.folder_lock, &self.folder) {
            clear_run(&self.domain, self.instance);
        }
        if is_at(&self.name_lock, &self.name_folder) {
            let _ = fs::remove_dir_all(&self.name_folder);
            let _ = fs::remove_dir(self.domain.root().join("server"));
        }
    }
}

/// The part of shared memory that one client and its server share: a root and a prefix, so that it
/// can be removed as a whole, even if a process died while using it.
#[derive(Clone, Debug)]
pub struct Link {
    root: PathBuf,
    prefix: String,
    config: Config,
    /// All its files in shared memory, once both sides have made theirs.
    files: Option<BTreeSet<PathBuf>>,
}

impl Link {
    /// The link of a connection, as both sides name it.
    pub fn new(domain: &Domain, instance: u64, number: u64) -> Result<Link, DomainError> {
        let root = instance_folder(domain, instance).join(format!("{number:06x}"));
        let prefix = format!("{}{instance:08x}_{number:06x}_", domain.prefix());
        let mut config = config(&root, &prefix)?;
        // the server never waits long for a half-made service of a client
        config.global.creation_timeout = HALF_MADE;
        // the server removes a link as a whole, so no search for dead nodes is needed
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Link { config, root, prefix, files: None })
    }

    /// The transport's settings for nodes in the link.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// A node of this process in the link.
    pub fn node(&self) -> Result<Node, DomainError> {
        node(&self.root, &self.config)
    }

    /// Reserves the memory of every file of the link that this process uses, so that it cannot run
    /// out later. With `is_complete`, no further file comes.
    ///
    /// # Errors
    /// `StorageFull`: there is not enough shared memory; `InvalidData`: a file is empty.
    pub fn reserve(&mut self, is_complete: bool) -> io::Result<()> {
        let files = used_files(&self.prefix);
        for path in &files {
            let flags = OFlags::RDWR | OFlags::NOFOLLOW | OFlags::CLOEXEC;
            let file = match rustix::fs::open(path, flags, Mode::empty()) {
                // gone meanwhile
                Err(rustix::io::Errno::NOENT) => continue,
                other => File::from(other?),
            };
            let size = match file.metadata()?.len() {
                0 => return Err(io::ErrorKind::InvalidData.into()),
                size => size,
            };
            fallocate(&file, FallocateFlags::empty(), 0, size)?;
        }
        self.files = is_complete.then_some(files);
        Ok(())
    }

    /// True if a file of the link is empty, as none is that a client has made; lists all files in
    /// shared memory.
    pub fn has_empty_file(&self) -> bool {
        shared_files(&self.prefix)
            .any(|path| fs::metadata(path).is_ok_and(|found| found.len() == 0))
    }

    /// Removes the whole link; call it after this process's node in it is dropped. An incomplete
    /// link is searched for.
    pub fn remove(&self) {
        match &self.files {
            Some(files) => files.iter().for_each(|path| drop(fs::remove_file(path))),
            None => drop(remove_shared(&self.prefix)),
        }
        let _ = fs::remove_dir_all(&self.root);
    }
}

impl Domain {
    /// Removes the files of dead processes: runs of servers, nodes, empty folders. Files in use
    /// stay. Returns the removed paths.
    pub fn tidy(&self) -> Vec<PathBuf> {
        let domains = [Some(self.clone()), self.other()].into_iter().flatten();
        domains.flat_map(|of| [clear_dead(&of), of.clear_nodes()].concat()).collect()
    }
}

/// Removes the files of dead servers and returns their paths.
fn clear_dead(domain: &Domain) -> Vec<PathBuf> {
    let mut cleared = Vec::new();
    for entry in fs::read_dir(domain.root()).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some(instance) = name.to_str().and_then(instance_of) else { continue };
        // a locked folder belongs to a living process
        if let Ok(Some(_lock)) = lock_existing(&entry.path()) {
            cleared.extend(clear_run(domain, instance));
        }
    }
    // files in shared memory without a folder: the folder was removed before the server died
    let prefix = domain.prefix();
    for path in shared_files(&prefix) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let instance = name.strip_prefix(&prefix).and_then(|rest| instance_of(rest.get(..8)?));
        if instance.is_some_and(|instance| !instance_folder(domain, instance).exists())
            && fs::remove_file(&path).is_ok()
        {
            cleared.push(path);
        }
    }
    // names without a server; a supervisor's reason stays
    let servers = domain.root().join("server");
    for entry in fs::read_dir(&servers).into_iter().flatten().flatten() {
        if let Ok(Some(_lock)) = lock_existing(&entry.path()) {
            // and half-written files of a supervisor
            let is_rest = |name: &str| name == "control" || name.starts_with("state.");
            for file in fs::read_dir(entry.path()).into_iter().flatten().flatten() {
                if file.file_name().to_str().is_some_and(is_rest) {
                    let _ = fs::remove_file(file.path());
                }
            }
            if fs::remove_dir(entry.path()).is_ok() {
                cleared.push(entry.path());
            }
        }
    }
    let _ = fs::remove_dir(&servers);
    cleared
}

fn clear_run(domain: &Domain, instance: u64) -> Vec<PathBuf> {
    let mut cleared = remove_shared(&format!("{}{instance:08x}_", domain.prefix()));
    let folder = instance_folder(domain, instance);
    if fs::remove_dir_all(&folder).is_ok() {
        cleared.push(folder);
    }
    cleared
}

fn instance_folder(domain: &Domain, instance: u64) -> PathBuf {
    domain.root().join(format!("{instance:08x}"))
}

/// The number of a run by its eight digits.
fn instance_of(digits: &str) -> Option<u64> {
    let is_number = digits.len() == 8 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_number.then(|| u64::from_str_radix(digits, 16).ok()).flatten()
}

/// A folder, made if missing, and locked; `None` if another process holds it.
fn lock_folder(path: &Path) -> io::Result<Option<File>> {
    make_folder(path)?;
    lock_existing(path)
}

fn lock_existing(path: &Path) -> io::Result<Option<File>> {
    let flags = OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC | OFlags::RDONLY;
    let folder = File::from(rustix::fs::open(path, flags, Mode::empty())?);
    match folder.try_lock() {
        Ok(()) if is_at(&folder, path) => Ok(Some(folder)),
        Ok(()) => Err(io::ErrorKind::NotFound.into()),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(error),
    }
}
