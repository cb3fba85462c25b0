//! The reason why a server does not start or did not end well.

use std::io;
use std::path::{Path, PathBuf};

use sarrus_proto::DomainError;

use crate::record::RecordError;
use crate::system::placement::PlacementError;

/// Most lanes of one server.
pub const MAX_LANES: usize = 256;

/// The reason why a server does not start or did not end well.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServeError {
    /// The shared memory cannot be entered.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Another server runs under this name.
    #[error("a server named `{0}` is running already; stop it or choose another name with --name")]
    NameTaken(String),
    /// A folder of the server cannot be made or locked: its path, the system's error.
    #[error("{path}: {1}; {owner}", path = .0.display(), owner = owner_of(.0))]
    Folder(PathBuf, #[source] io::Error),
    /// The socket that clients connect to cannot be made: its folder, the system's error.
    #[error(
        "no socket in {path}: {1}; see whether the folder can be written, and how many files this \
         process may open, `ulimit -n`",
        path = .0.display()
    )]
    Socket(PathBuf, #[source] io::Error),
    /// The page of the heartbeat cannot be made.
    #[error("no memory for the heartbeat: {0}; see how many files it may open, `ulimit -n`")]
    Heartbeat(io::Error),
    /// The handler of missing memory cannot be installed.
    #[error("SIGBUS cannot be handled: {0}")]
    Guard(io::Error),
    /// A generated kernel cannot be used, for this reason.
    #[error("--kernel: {0}")]
    Kernel(String),
    /// Recording is impossible.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// More lanes than there can be, so many.
    #[error("{0} lanes, expected 0 to {MAX_LANES}; choose fewer with --lanes")]
    TooManyLanes(usize),
    /// The requested placement of threads or memory is impossible.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// The answering thread cannot be started.
    #[error("the answering thread does not start: {0}; check the limits of this process")]
    Thread(#[source] std::io::Error),
    /// The answering thread hangs since so many seconds.
    #[error(
        "the answering thread hangs: no heartbeat for {0} s, while another thread ran; its \
         processor is taken, or a client has overwritten shared memory"
    )]
    Hung(u64),
    /// The answering thread ended without an order to stop.
    #[error(
        "the answering thread ended by itself; this is a defect of sarrus, please report it with \
         the model"
    )]
    Died,
}

/// Describes the owner of the nearest existing path.
fn owner_of(path: &Path) -> String {
    use std::os::unix::fs::MetadataExt;
    let found = path.ancestors().find_map(|path| Some((path, path.symlink_metadata().ok()?.uid())));
    match found {
        Some((path, user)) => format!(
            "{} belongs to user {user}; remove it or name another directory in SARRUS_ROOT",
            path.display()
        ),
        None => "name another directory in SARRUS_ROOT".to_owned(),
    }
}
