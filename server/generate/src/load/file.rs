//! The file of a shared object, before anything of it runs.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{MemfdFlags, OFlags, SealFlags, fcntl_add_seals, memfd_create};
use rustix::io::Errno;
use sarrus_dynamics::{Model, Plan};
use sarrus_proto::fnv1a_64;

use super::elf::Elf;
use super::{LoadError, LoadFault, Loaded};
use crate::Manifest;

/// The largest file that is read `[byte]`.
const MOST: u64 = 8 << 20;
/// Writing by the group and by everybody.
const OTHERS_WRITE: u32 = 0o022;

/// Before the hash behind the bytes of a file that is kept.
const SUM: &str = "sarrus fnv1a_64 ";

/// A shared object that was read: its manifest and its bytes. None of its code has run.
#[derive(Clone, Debug)]
pub struct ObjectFile {
    path: PathBuf,
    /// All of the file.
    pub(super) bytes: Vec<u8>,
    manifest: Manifest,
    /// The text of the manifest in the object.
    pub(super) text: Vec<u8>,
}

impl ObjectFile {
    /// Reads a file of this user or of root that no other user may write.
    ///
    /// # Errors
    /// [`LoadError`]: it cannot be read, others could have written it, it is no object
    /// of sarrus, or not whole. Whether bytes between its ends were changed is not seen.
    pub fn read(path: &Path) -> Result<ObjectFile, LoadError> {
        ObjectFile::read_as(path, OFlags::empty(), OTHERS_WRITE, path)
    }

    /// Reads one that this program has just had compiled, of any mode; no link is followed.
    pub(crate) fn read_built(path: &Path) -> Loaded<ObjectFile> {
        ObjectFile::read_as(path, OFlags::NOFOLLOW, 0, path)
    }

    /// Reads one that the cache wrote, with the hash of its bytes behind them; errors name it
    /// `path`.
    pub(super) fn read_kept(from: &Path, path: &Path) -> Loaded<ObjectFile> {
        let file = ObjectFile::read_as(from, OFlags::NOFOLLOW, OTHERS_WRITE, path)?;
        let length = file.bytes.len().saturating_sub(sum(&[]).len());
        let (bytes, end) = file.bytes.split_at(length);
        match sum(bytes).as_bytes() == end {
            true => Ok(file),
            false => Err(LoadFault::Damaged.of(path)),
        }
    }

    /// Reads a file, opened with these flags, whose mode has none of the refused bits; errors name
    /// it `path`.
    fn read_as(from: &Path, flags: OFlags, refused: u32, path: &Path) -> Loaded<ObjectFile> {
        let failed = |error: io::Error| LoadFault::Io(error).of(path);
        // opening a pipe would wait for a writer
        let flags = flags | OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK;
        let file = match rustix::fs::open(from, flags, rustix::fs::Mode::empty()) {
            Err(Errno::LOOP) => return Err(LoadFault::NoFile.of(path)),
            file => File::from(file.map_err(|error| failed(error.into()))?),
        };
        // of the open file: the checked file is the one that is read
        let about = file.metadata().map_err(failed)?;
        if !about.is_file() {
            return Err(LoadFault::NoFile.of(path));
        }
        let owner = about.uid();
        let user = rustix::process::geteuid().as_raw();
        if owner != user && owner != 0 {
            return Err(LoadFault::Owner { owner, user }.of(path));
        }
        let mode = about.mode() & 0o7777;
        if mode & refused != 0 {
            return Err(LoadFault::Writable(mode).of(path));
        }
        let mut bytes = Vec::new();
        let read = file.take(MOST + 1).read_to_end(&mut bytes).map_err(failed)? as u64;
        if read > MOST {
            return Err(LoadFault::TooLarge { bytes: about.size(), most: MOST }.of(path));
        }
        let Some((manifest, text)) = Manifest::find(&bytes) else {
            return Err(LoadFault::NoKernel.of(path));
        };
        let text = text.to_owned();
        let elf = Elf::new(&bytes).filter(|elf| elf.is_whole() == Some(true));
        let stranger = elf.and_then(|elf| elf.first_stranger());
        let stranger = stranger.ok_or_else(|| LoadFault::Broken.of(path))?;
        if let Some(symbol) = stranger {
            return Err(LoadFault::Needs(symbol).of(path));
        }
        Ok(ObjectFile { path: path.to_owned(), bytes, manifest, text })
    }

    /// Its manifest.
    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Where it was.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The plan of the query that it was made for, on the robot that it was made for.
    ///
    /// # Errors
    /// [`LoadFault::WrongRobot`], [`LoadFault::WrongQuery`].
    pub(super) fn plan(&self, model: &Model<f64>) -> Loaded<Plan> {
        let manifest = &self.manifest;
        // the query of another robot may name links that this one lacks
        if manifest.fingerprint != model.fingerprint() {
            let robot = manifest.robot.clone();
            let [found, expected] = [manifest.fingerprint, model.fingerprint()];
            return Err(LoadFault::WrongRobot { robot, found, expected }.of(&self.path));
        }
        Plan::new(model, &manifest.query).map_err(|_| LoadFault::WrongQuery.of(&self.path))
    }

    /// A sealed copy in memory, with a path for the system's loader: the file may be written or cut
    /// short after it was read, and running code must not change under its thread.
    pub(super) fn sealed(&self) -> io::Result<(OwnedFd, PathBuf)> {
        let flags = MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING;
        let mut file = File::from(memfd_create("sarrus_kernel", flags)?);
        file.write_all(&self.bytes)?;
        let seals = SealFlags::WRITE | SealFlags::GROW | SealFlags::SHRINK | SealFlags::SEAL;
        fcntl_add_seals(&file, seals)?;
        let path = PathBuf::from(format!("/proc/self/fd/{}", file.as_raw_fd()));
        Ok((file.into(), path))
    }
}

/// The hash behind the bytes of a kept file.
pub(super) fn sum(bytes: &[u8]) -> String {
    format!("{SUM}{:016x}\n", fnv1a_64(bytes))
}
