//! Errors of recordings.

use std::io;
use std::path::PathBuf;

use super::format::FORMAT;

/// An error that prevents recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file is not a recording.
    #[error("{} is no recording and is left as it is; choose another --record", .0.display())]
    Foreign(PathBuf),
    /// Another server records to the file.
    #[error("another server records to {}; choose another --record", .0.display())]
    InUse(PathBuf),
    /// The disk has no room for so many bytes of the file.
    #[error(
        "no room for {1} bytes of {file}; free some, or keep less with --record-seconds or --lanes",
        file = .0.display()
    )]
    NoSpace(PathBuf, u64),
    /// The file cannot be made: its path, the system's error.
    #[error("cannot record to {file}: {1}; choose another --record", file = .0.display())]
    Make(PathBuf, #[source] io::Error),
    /// The memory between the threads cannot be made.
    #[error("the recorder has no memory in /dev/shm: {0}; see `df /dev/shm` and `ulimit -a`")]
    Ring(#[source] io::Error),
    /// The thread that writes cannot be started.
    #[error("the recorder does not start: {0}; check the limits of this process")]
    Thread(#[source] io::Error),
}

/// An error that prevents reading a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The system cannot read it.
    #[error("it cannot be read: {0}; give the path of a readable file")]
    Read(#[from] io::Error),
    /// It is not a recording.
    #[error("it is no recording; give a file that `sarrus serve --record` wrote")]
    Foreign,
    /// It has this version, which is another one.
    #[error("it is a recording of format {0}, expected {FORMAT}; use the sarrus that wrote it")]
    Format(u64),
    /// Its first page is damaged.
    #[error("its header is damaged; take another copy of the file")]
    Header,
    /// A part is missing.
    #[error("it has {found} bytes, expected {expected}; copy the whole file")]
    Truncated {
        /// Its size.
        found: u64,
        /// The size that its header names.
        expected: u64,
    },
    /// Its segments are all but empty: more than so many bytes hold no record.
    #[error("more than {0} bytes of it hold no record; take another copy of the file")]
    Holes(u64),
    /// The robot in it is damaged.
    #[error("the robot in it is damaged; take another copy of the file")]
    Robot,
    /// The robot is another one.
    #[error(
        "the robot has the fingerprint {found:016x}, the recording {expected:016x}; give the \
         recording's robot with --urdf, and the sarrus that recorded it"
    )]
    WrongModel {
        /// The fingerprint of the robot.
        found: u64,
        /// The fingerprint of the recording.
        expected: u64,
    },
}
