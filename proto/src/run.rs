//! The folders of one run of a server: the name that it serves under, and one part of shared memory
//! for each connection.
//!
//! `ROOT/server/NAME` is locked by the process that serves under this name and holds its control
//! socket; `ROOT/INSTANCE` is locked by the same process and holds a folder for each connection.
//! Locks end with their process, whatever ends it, so whoever finds a folder unlocked may clear it:
//! nothing else decides whether a run is alive.

use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::{Config, Service};
use rustix::fs::{FallocateFlags, Mode, OFlags, fallocate, statvfs};

use crate::domain::{
    SHARED_MEMORY, config, is_at, make_folder, node, random, remove_shared, shared_files,
};
use crate::socket::ControlListener;
use crate::{Domain, DomainError, ServerName};

/// How long the transport waits for a file of a link whose maker has not finished it.
const HALF_MADE: Duration = Duration::from_millis(100);
/// Numbers of links: as many as eight digits say, which paths have room for.
const LINK_NUMBERS: u64 = 0xffff_ffff;

/// A server's name and folder, held until this is dropped; then nothing of the run is left.
#[derive(Debug)]
pub struct Run {
    domain: Domain,
    name_folder: PathBuf,
    name_lock: File,
    folder: PathBuf,
    folder_lock: File,
    instance: u64,
}

/// Why a run cannot start.
#[derive(Debug)]
pub enum RunError {
    /// Another process serves under this name.
    Taken,
    /// A folder cannot be made or locked.
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The domain cannot be entered.
    Domain(DomainError),
}

impl Run {
    /// Takes a name, after what dead servers left was cleared away.
    pub fn start(domain: &Domain, name: &ServerName) -> Result<Run, RunError> {
        domain.make_root().map_err(RunError::Domain)?;
        let name_folder = domain.root().join("server").join(name.as_str());
        let name_lock = loop {
            match lock_folder(&name_folder) {
                Ok(Some(lock)) => break lock,
                Ok(None) => return Err(RunError::Taken),
                // somebody removed it meanwhile
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(RunError::Folder { path: name_folder, source }),
            }
        };
        clear_dead(domain);
        loop {
            let instance = random();
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
    pub fn listen(&self) -> io::Result<ControlListener> {
        ControlListener::new(&self.name_folder)
    }

    /// Makes the folders again where somebody cleared them away, as cleaners of temporary files do;
    /// true where that was so.
    pub fn restore(&mut self) -> bool {
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

    /// A part of shared memory for one connection, with its number: random, so that nobody can
    /// take the names in it before they are needed.
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
        // a folder that was taken over meanwhile is another's
        if is_at(&self.folder_lock, &self.folder) {
            clear_run(&self.domain, self.instance);
        }
        if is_at(&self.name_lock, &self.name_folder) {
            let _ = fs::remove_dir_all(&self.name_folder);
            let _ = fs::remove_dir(self.domain.root().join("server"));
        }
    }
}

/// The part of shared memory that one client and its server share: a root and a prefix of its own,
/// so that it can be removed whole, whatever state a process that died left it in.
#[derive(Clone, Debug)]
pub struct Link {
    root: PathBuf,
    prefix: String,
    config: Config,
}

impl Link {
    /// The link of a connection, as both sides name it.
    pub fn new(domain: &Domain, instance: u64, number: u64) -> Result<Link, DomainError> {
        let root = instance_folder(domain, instance).join(format!("{number:08x}"));
        let prefix = format!("{}{instance:016x}_{number:08x}_", domain.prefix());
        let mut config = config(&root, &prefix)?;
        // the server never waits long for what a client has half made
        config.global.creation_timeout = HALF_MADE;
        // the server removes a link whole: nobody needs to look for dead nodes in it
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(Link { config, root, prefix })
    }

    /// A node of this process in the link.
    pub fn node<S: Service>(&self) -> Result<Node<S>, DomainError> {
        node(&self.root, &self.config)
    }

    /// Gives every file of the link its memory now, so that none can run out of it later.
    ///
    /// # Errors
    /// `StorageFull`: there is not enough shared memory.
    pub fn reserve(&self) -> io::Result<()> {
        for path in shared_files(&self.prefix) {
            let flags = OFlags::RDWR | OFlags::NOFOLLOW | OFlags::CLOEXEC;
            let file = match rustix::fs::open(&path, flags, Mode::empty()) {
                // gone meanwhile
                Err(rustix::io::Errno::NOENT) => continue,
                other => File::from(other?),
            };
            let size = file.metadata()?.len();
            if size > 0 {
                fallocate(&file, FallocateFlags::empty(), 0, size)?;
            }
        }
        Ok(())
    }

    /// Removes the link whole; call it when this process's node in it is gone.
    pub fn remove(&self) {
        remove_shared(&self.prefix);
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// Shared memory that is still free `[byte]`.
pub fn free_shared_memory() -> u64 {
    // unknown is no reason to refuse anybody
    statvfs(SHARED_MEMORY).map_or(u64::MAX, |found| found.f_bavail.saturating_mul(found.f_frsize))
}

impl Domain {
    /// Removes what dead processes left: runs of servers, nodes, empty folders. What living
    /// processes use stays. Gives the paths that it removed.
    pub fn tidy(&self) -> Vec<PathBuf> {
        let mut cleared = clear_dead(self);
        cleared.extend(self.clear_nodes());
        cleared
    }
}

/// Removes what servers left that are dead; what it removed.
fn clear_dead(domain: &Domain) -> Vec<PathBuf> {
    let mut cleared = Vec::new();
    for entry in fs::read_dir(domain.root()).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let instance = name.to_str().filter(|name| name.len() == 16);
        let Some(instance) = instance.and_then(|name| u64::from_str_radix(name, 16).ok()) else {
            continue;
        };
        // what is locked is alive
        if let Ok(Some(_lock)) = lock_existing(&entry.path()) {
            cleared.extend(clear_run(domain, instance));
        }
    }
    // names that nobody serves under; a reason that a supervisor left stays
    let servers = domain.root().join("server");
    for entry in fs::read_dir(&servers).into_iter().flatten().flatten() {
        if let Ok(Some(_lock)) = lock_existing(&entry.path()) {
            let _ = fs::remove_file(entry.path().join("control"));
            if fs::remove_dir(entry.path()).is_ok() {
                cleared.push(entry.path());
            }
        }
    }
    let _ = fs::remove_dir(&servers);
    cleared
}

fn clear_run(domain: &Domain, instance: u64) -> Vec<PathBuf> {
    let mut cleared = remove_shared(&format!("{}{instance:016x}_", domain.prefix()));
    let folder = instance_folder(domain, instance);
    if fs::remove_dir_all(&folder).is_ok() {
        cleared.push(folder);
    }
    cleared
}

fn instance_folder(domain: &Domain, instance: u64) -> PathBuf {
    domain.root().join(format!("{instance:016x}"))
}

/// A folder, made if it is missing, and locked; `None` where another process holds it.
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
