//! Where everything of one user lives in shared memory, and what it is called there.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::prelude::{
    Config, FileName, LogLevel, NodeBuilder, SemanticString, SignalHandlingMode, set_log_level,
};
use iceoryx2::prelude::{Node, Service, ServiceName};

/// The longest name that a server may have.
pub const MAX_NAME: usize = 64;

/// The directory and the prefix of all shared memory of one installation, fixed in code: no
/// configuration file changes it.
///
/// Every user has a domain of their own, `/tmp/sarrus-UID`; the environment variable `SARRUS_ROOT`
/// names another directory, which is a domain apart from all others.
#[derive(Clone, Debug)]
pub struct Domain {
    root: PathBuf,
    config: Config,
}

/// Why the shared memory cannot be entered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DomainError {
    /// The root directory can neither be found nor made.
    #[error(
        "{path}: {source}; make the directory writable for this user or name another one in \
         SARRUS_ROOT"
    )]
    Root {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The root directory belongs to somebody else.
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
    /// The path of the root directory cannot be used.
    #[error(
        "{path} cannot be the root of shared memory; give an absolute path of at most 100 \
         characters in SARRUS_ROOT"
    )]
    Path {
        /// The directory.
        path: PathBuf,
    },
    /// A server's name is empty, too long or has letters that a name must not have.
    #[error(
        "`{name}` is no name for a server; use 1 to {MAX_NAME} letters, digits, `.`, `-` or `_`"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// The node of this process cannot be made.
    #[error(
        "no node in shared memory under {path}: {reason}; check the free space of /dev/shm and \
         the rights of the directory"
    )]
    Node {
        /// The root directory.
        path: PathBuf,
        /// What the transport says.
        reason: String,
    },
}

impl Domain {
    /// The domain of this user.
    pub fn of_user() -> Result<Domain, DomainError> {
        let root =
            std::env::var_os("SARRUS_ROOT").filter(|root| !root.is_empty()).map(PathBuf::from);
        Domain::at(&root.unwrap_or_else(|| {
            PathBuf::from(format!("/tmp/sarrus-{}", rustix::process::getuid().as_raw()))
        }))
    }

    /// The domain under a directory, which is made if it is missing and must belong to this user.
    pub fn at(root: &Path) -> Result<Domain, DomainError> {
        set_log_level(LogLevel::Fatal);
        let path_error = || DomainError::Path { path: root.to_owned() };
        let text = root
            .to_str()
            .filter(|text| root.is_absolute() && text.len() <= 100)
            .ok_or_else(path_error)?;

        let mut config = Config::default();
        config.global.set_root_path(
            &iceoryx2::prelude::Path::new(text.as_bytes()).map_err(|_| path_error())?,
        );
        // files in /dev/shm lie side by side whatever their root: the prefix keeps domains and
        // users apart
        config.global.prefix = FileName::new(format!("sarrus_{:08x}_", hash(text)).as_bytes())
            .map_err(|_| path_error())?;

        let domain = Domain { root: root.to_owned(), config };
        domain.make_root()?;
        Ok(domain)
    }

    /// The directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What the names of this domain's files in /dev/shm begin with.
    pub fn prefix(&self) -> String {
        self.config.global.prefix.to_string()
    }

    /// A node of this process in the domain; clears away what dead processes left.
    pub fn node<S: Service>(&self) -> Result<Node<S>, DomainError> {
        let _lock = self.lock(File::lock_shared)?;
        let builder = NodeBuilder::new()
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .config(&self.config);
        let failed =
            |error| DomainError::Node { path: self.root.clone(), reason: format!("{error:?}") };
        let node = builder.create::<S>().map_err(failed)?;
        // the transport lets everybody write its counter of nodes
        for path in self.counters() {
            let _ = fs::set_permissions(path, fs::Permissions::from_mode(0o600));
        }
        Ok(node)
    }

    /// Removes what outlives the last node: empty directories and the transport's counter. Call it
    /// when the nodes of this process are gone; does nothing while another process has one.
    pub fn tidy(&self) {
        let Ok(_lock) = self.lock(|directory| directory.try_lock().map_err(io::Error::from)) else {
            return;
        };
        let nodes = self.root.join("nodes");
        for entry in fs::read_dir(&nodes).into_iter().flatten().flatten() {
            let _ = fs::remove_dir(entry.path());
        }
        // a directory that somebody uses is not empty and stays
        let used = |path: &Path| {
            fs::remove_dir(path).is_err_and(|error| error.kind() != io::ErrorKind::NotFound)
        };
        if !used(&nodes) {
            for path in self.counters() {
                let _ = fs::remove_file(path);
            }
            let _ = used(&self.root.join("services")) || used(&self.root);
        }
    }

    /// The transport's counter of nodes, which it never removes itself.
    fn counters(&self) -> impl Iterator<Item = PathBuf> {
        let prefix = self.prefix();
        let ours = move |path: &PathBuf| {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            name.starts_with(&prefix) && name.ends_with(".global_mgmt")
        };
        fs::read_dir("/dev/shm")
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| entry.path())
            .filter(ours)
    }

    /// The root directory, made if it is missing, and locked: nobody tidies while a node is being
    /// made.
    fn lock(&self, lock: impl Fn(&File) -> io::Result<()>) -> Result<File, DomainError> {
        let failed = |source| DomainError::Root { path: self.root.clone(), source };
        loop {
            self.make_root()?;
            let directory = match File::open(&self.root) {
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                other => other.map_err(failed)?,
            };
            lock(&directory).map_err(failed)?;
            // it may have been removed between opening and locking
            let same = |path: fs::Metadata| {
                directory.metadata().is_ok_and(|ours| ours.ino() == path.ino())
            };
            if fs::metadata(&self.root).is_ok_and(same) {
                return Ok(directory);
            }
        }
    }

    fn make_root(&self) -> Result<(), DomainError> {
        let failed = |source| DomainError::Root { path: self.root.clone(), source };
        fs::DirBuilder::new().recursive(true).mode(0o700).create(&self.root).map_err(failed)?;
        let owner = fs::symlink_metadata(&self.root).map_err(failed)?.uid();
        let user = rustix::process::geteuid().as_raw();
        if owner == user {
            Ok(())
        } else {
            Err(DomainError::Foreign { path: self.root.clone(), owner, user })
        }
    }
}

/// The services of one server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ServerName(String);

impl ServerName {
    /// Checks a name.
    pub fn new(name: &str) -> Result<ServerName, DomainError> {
        let good =
            |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '.' | '-' | '_');
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(good) {
            return Err(DomainError::Name { name: name.to_owned() });
        }
        Ok(ServerName(name.to_owned()))
    }

    /// The name as given.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Attaching and information; the one service that outlives a run of the server.
    pub fn control(&self) -> Result<ServiceName, DomainError> {
        self.service("control")
    }

    /// The service of one run of the server.
    pub fn compute(&self, instance: u64) -> Result<ServiceName, DomainError> {
        self.service(&format!("{instance:x}/compute"))
    }

    /// The status board of one run of the server.
    pub fn status(&self, instance: u64) -> Result<ServiceName, DomainError> {
        self.service(&format!("{instance:x}/status"))
    }

    /// The request and the response board of one lane.
    pub fn lane(&self, instance: u64, lane: LaneId) -> Result<[ServiceName; 2], DomainError> {
        let base = format!("{instance:x}/lane/{}/{}", lane.slot, lane.generation);
        Ok([self.service(&format!("{base}/request"))?, self.service(&format!("{base}/response"))?])
    }

    /// A service of the CAN bridge of this name.
    pub fn bridge(&self, part: &str) -> Result<ServiceName, DomainError> {
        self.service(&format!("can/{part}"))
    }

    fn service(&self, rest: &str) -> Result<ServiceName, DomainError> {
        ServiceName::new(&format!("sarrus/{}/{rest}", self.0))
            .map_err(|_| DomainError::Name { name: self.0.clone() })
    }
}

/// A lane: its slot and how many lanes have been there before. A lane dies with its client and is
/// never used again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[repr(C)]
pub struct LaneId {
    /// Index among the server's lanes.
    pub slot: u32,
    /// Lanes made in this slot so far.
    pub generation: u32,
}

/// FNV-1a, folded to 32 bits.
fn hash(text: &str) -> u32 {
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    (hash ^ hash >> 32) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_leave_the_domain_are_refused() {
        for name in ["", "a/b", "a b", "ä", &"x".repeat(MAX_NAME + 1)] {
            assert!(matches!(ServerName::new(name), Err(DomainError::Name { .. })), "{name}");
        }
        assert_eq!(ServerName::new("rh5.v2_upper-body").unwrap().as_str(), "rh5.v2_upper-body");
    }

    #[test]
    fn domains_have_prefixes_of_their_own() {
        let base = std::env::temp_dir().join(format!("sarrus-domain-test-{}", std::process::id()));
        let [a, b] = ["a", "b"].map(|name| Domain::at(&base.join(name)).unwrap());
        assert_ne!(a.prefix(), b.prefix());
        a.tidy();
        b.tidy();
        fs::remove_dir(&base).unwrap();
    }

    #[test]
    fn a_directory_of_somebody_else_is_refused() {
        let error = Domain::at(Path::new("relative")).unwrap_err();
        assert!(matches!(error, DomainError::Path { .. }), "{error}");
        // the directory of the system's processes is never ours unless we are root
        if !rustix::process::geteuid().is_root() {
            assert!(matches!(Domain::at(Path::new("/proc/1")), Err(DomainError::Foreign { .. })));
        }
    }
}
