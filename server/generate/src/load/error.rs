//! Why a shared object is not used.

use std::io;
use std::path::PathBuf;

/// Why a shared object is not used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// It cannot be read.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        error: io::Error,
    },
    /// It is a folder or a device.
    #[error("{}: no file; expected a shared object of `sarrus generate`", .0.display())]
    NoFile(PathBuf),
    /// Another user owns it and could replace its contents.
    #[error(
        "{}: belongs to user {owner}, and code is loaded from files of user {user} or of root \
         only; copy it",
        path.display()
    )]
    Owner {
        /// The file.
        path: PathBuf,
        /// Whose it is.
        owner: u32,
        /// Who loads.
        user: u32,
    },
    /// Others may write it.
    #[error("{}: others may write it (mode {mode:03o}); chmod go-w it", path.display())]
    Writable {
        /// The file.
        path: PathBuf,
        /// Its mode.
        mode: u32,
    },
    /// It is larger than any kernel.
    #[error("{}: {bytes} bytes, expected at most {most}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The bound.
        most: u64,
    },
    /// It has no description, or one of another version.
    #[error(
        "{}: no kernel of this version of sarrus; expected a shared object of `sarrus generate`",
        .0.display()
    )]
    NoKernel(PathBuf),
    /// It is no shared object, or its end is missing.
    #[error("{}: no whole shared object of this kind of computer", .0.display())]
    Broken(PathBuf),
    /// It takes a symbol from another object that no kernel takes.
    #[error(
        "{}: needs `{symbol}` of another library; compile it with a CC without sanitizers, \
         profiles and further code",
        path.display()
    )]
    Needs {
        /// The file.
        path: PathBuf,
        /// The symbol.
        symbol: String,
    },
    /// The process that tried it before this one crashed, hung or refused it.
    #[error("{}: tried in a process of its own: {reason}", path.display())]
    Trial {
        /// The file.
        path: PathBuf,
        /// How that process ended.
        reason: String,
    },
    /// It needs instructions that this processor does not have.
    #[error(
        "{}: made for a processor with {missing}, which this one does not have; generate it again \
         with a portable build of sarrus",
        path.display()
    )]
    Processor {
        /// The file.
        path: PathBuf,
        /// The instructions.
        missing: String,
    },
    /// It was made for another robot.
    #[error(
        "{}: made for the robot `{robot}` with the fingerprint {found:016x}, expected \
         {expected:016x}; generate it again",
        path.display()
    )]
    WrongRobot {
        /// The file.
        path: PathBuf,
        /// The name of its robot.
        robot: String,
        /// That robot's fingerprint.
        found: u64,
        /// This robot's.
        expected: u64,
    },
    /// It was made for another query, or for one that does not fit the robot.
    #[error("{}: made for another query; generate it again", .0.display())]
    WrongQuery(PathBuf),
    /// The system's loader refuses it.
    #[error("{}: not loaded: {reason}", path.display())]
    Loader {
        /// The file.
        path: PathBuf,
        /// The loader's message.
        reason: String,
    },
    /// Its hash is not that of its bytes, or is missing.
    #[error("{}: damaged, or not written by the cache", .0.display())]
    Damaged(PathBuf),
    /// Loading it changed how the thread that loads it computes.
    #[error(
        "{}: it turns small numbers into zeros; link it without -ffast-math",
        .0.display()
    )]
    ChangesRounding(PathBuf),
    /// It answers otherwise than the generic kernels.
    #[error(
        "{}: other bits than the generic kernel's in state {state} of {states}: {what}; generate \
         it again with a CC that has no -ffast-math and fuses no multiplications (gcc does but \
         for -ffp-contract=off -fno-tree-slp-vectorize)",
        path.display()
    )]
    Differs {
        /// The file.
        path: PathBuf,
        /// Number of the state.
        state: u64,
        /// How many are compared.
        states: u64,
        /// Which number it gives and which is right, or which status.
        what: String,
    },
    /// It leaves every state to the generic kernels.
    #[error("{}: answers none of {states} states", path.display())]
    Unserved {
        /// The file.
        path: PathBuf,
        /// How many were tried.
        states: u64,
    },
}
