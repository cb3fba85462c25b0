//! Why a shared object is not used.

use std::io;
use std::path::{Path, PathBuf};

/// A shared object that is not used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {fault}", path.display())]
#[non_exhaustive]
pub struct LoadError {
    /// The file.
    pub path: PathBuf,
    /// Why it is not used.
    pub fault: LoadFault,
}

/// Why a shared object is not used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadFault {
    /// It cannot be read.
    #[error("{0}")]
    Io(io::Error),
    /// It is a folder or a device.
    #[error("no file; expected a shared object of `sarrus generate`")]
    NoFile,
    /// Another user owns it and could replace its contents.
    #[error(
        "belongs to user {owner}, and code is loaded from files of user {user} or of root only; \
         copy it"
    )]
    Owner {
        /// Whose it is.
        owner: u32,
        /// Who loads.
        user: u32,
    },
    /// Others may write it, by its mode.
    #[error("others may write it (mode {0:03o}); chmod go-w it")]
    Writable(u32),
    /// It is larger than any kernel.
    #[error("{bytes} bytes, expected at most {most}")]
    TooLarge {
        /// Its size.
        bytes: u64,
        /// The bound.
        most: u64,
    },
    /// It has no description, or one of another version.
    #[error("no kernel of this version of sarrus; expected a shared object of `sarrus generate`")]
    NoKernel,
    /// It is no shared object, or its end is missing.
    #[error("no whole shared object of this kind of computer")]
    Broken,
    /// It takes a symbol from another object that no kernel takes.
    #[error(
        "needs `{0}` of another library; compile it with a CC without sanitizers, profiles and \
         further code"
    )]
    Needs(String),
    /// The process that tried it before this one crashed, hung or refused it; how that ended.
    #[error("tried in a process of its own: {0}")]
    Trial(String),
    /// It needs instructions that this processor does not have.
    #[error(
        "made for a processor with {0}, which this one does not have; generate it again with a \
         portable build of sarrus"
    )]
    Processor(String),
    /// It was made for another robot.
    #[error(
        "made for the robot `{robot}` with the fingerprint {found:016x}, expected \
         {expected:016x}; generate it again"
    )]
    WrongRobot {
        /// The name of its robot.
        robot: String,
        /// That robot's fingerprint.
        found: u64,
        /// This robot's.
        expected: u64,
    },
    /// It was made for another query, or for one that does not fit the robot.
    #[error("made for another query; generate it again")]
    WrongQuery,
    /// The system's loader refuses it, with this message.
    #[error("not loaded: {0}")]
    Loader(String),
    /// Its hash is not that of its bytes, or is missing.
    #[error("damaged, or not written by the cache")]
    Damaged,
    /// Loading it changed how the thread that loads it computes.
    #[error("it turns small numbers into zeros; link it without -ffast-math")]
    ChangesRounding,
    /// It answers otherwise than the generic kernels.
    #[error(
        "other bits than the generic kernel's in state {state} of {states}: {what}; generate it \
         again with a CC that has no -ffast-math and fuses no multiplications (gcc does but for \
         -ffp-contract=off -fno-tree-slp-vectorize)"
    )]
    Differs {
        /// Number of the state.
        state: u64,
        /// How many are compared.
        states: u64,
        /// Which number it gives and which is right, or which status.
        what: String,
    },
    /// It leaves every state to the generic kernels, of so many that were tried.
    #[error("answers none of {0} states")]
    Unserved(u64),
}

impl LoadFault {
    /// The error of a file with this fault.
    pub(super) fn of(self, path: &Path) -> LoadError {
        LoadError { path: path.to_owned(), fault: self }
    }
}
