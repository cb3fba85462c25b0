//! The file of a shared object, before anything of it runs.

use std::fs::File;
use std::io::{self, Read, Write};
use std::os::fd::{AsRawFd, OwnedFd};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{MemfdFlags, OFlags, SealFlags, fcntl_add_seals, memfd_create};
use sarrus_dynamics::{Model, Plan};
use sarrus_proto::fnv1a_64;

use super::LoadError;
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
    bytes: Vec<u8>,
    manifest: Manifest,
    text: Vec<u8>,
}

impl ObjectFile {
    /// Reads a file of this user or of root that no other user may write.
    ///
    /// # Errors
    /// [`LoadError`]: it cannot be read, others could have written it, it is no object
    /// of sarrus, or not whole. Whether bytes between its ends were changed is not seen.
    pub fn read(path: &Path) -> Result<ObjectFile, LoadError> {
        ObjectFile::read_as((path, OTHERS_WRITE), path)
    }

    /// Reads one that this program has just had compiled, of any mode.
    pub(crate) fn read_built(path: &Path) -> Result<ObjectFile, LoadError> {
        ObjectFile::read_as((path, 0), path)
    }

    /// Reads one that the cache wrote, with the hash of its bytes behind them; errors name it
    /// `path`.
    pub(super) fn read_kept(from: &Path, path: &Path) -> Result<ObjectFile, LoadError> {
        let file = ObjectFile::read_as((from, OTHERS_WRITE), path)?;
        let length = file.bytes.len().saturating_sub(sum(&[]).len());
        let (bytes, end) = file.bytes.split_at(length);
        match sum(bytes).as_bytes() == end {
            true => Ok(file),
            false => Err(LoadError::Damaged(path.to_owned())),
        }
    }

    /// Reads a file whose mode has none of these bits.
    fn read_as((from, refused): (&Path, u32), path: &Path) -> Result<ObjectFile, LoadError> {
        let failed = |error: io::Error| LoadError::Io { path: path.to_owned(), error };
        // opening a pipe would wait for a writer
        let flags = OFlags::RDONLY | OFlags::CLOEXEC | OFlags::NONBLOCK;
        let file = rustix::fs::open(from, flags, rustix::fs::Mode::empty());
        let file = File::from(file.map_err(|error| failed(error.into()))?);
        // of the open file: the checked file is the one that is read
        let about = file.metadata().map_err(failed)?;
        if !about.is_file() {
            return Err(LoadError::NoFile(path.to_owned()));
        }
        let owner = about.uid();
        let user = rustix::process::geteuid().as_raw();
        if owner != user && owner != 0 {
            return Err(LoadError::Owner { path: path.to_owned(), owner, user });
        }
        let mode = about.mode() & 0o7777;
        if mode & refused != 0 {
            return Err(LoadError::Writable { path: path.to_owned(), mode });
        }
        let mut bytes = Vec::new();
        let read = file.take(MOST + 1).read_to_end(&mut bytes).map_err(failed)? as u64;
        if read > MOST {
            return Err(LoadError::TooLarge {
                path: path.to_owned(),
                bytes: about.size(),
                most: MOST,
            });
        }
        let Some((manifest, text)) = Manifest::find(&bytes) else {
            return Err(LoadError::NoKernel(path.to_owned()));
        };
        let text = text.to_owned();
        if !is_whole(&bytes) {
            return Err(LoadError::Broken(path.to_owned()));
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
    /// [`LoadError::WrongRobot`], [`LoadError::WrongQuery`].
    pub(super) fn plan(&self, model: &Model<f64>) -> Result<Plan, LoadError> {
        let path = || self.path.clone();
        let manifest = &self.manifest;
        // the query of another robot may name links that this one lacks
        if manifest.fingerprint != model.fingerprint() {
            return Err(LoadError::WrongRobot {
                path: path(),
                robot: manifest.robot.clone(),
                found: manifest.fingerprint,
                expected: model.fingerprint(),
            });
        }
        Plan::new(model, &manifest.query).map_err(|_| LoadError::WrongQuery(path()))
    }

    /// The text of the manifest as it stands in the object.
    pub(super) fn text(&self) -> &[u8] {
        &self.text
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

/// Whether every part that the loader maps is in the file: reading beyond its end would end the
/// process. The head of a 64-bit ELF file in this computer's order of bytes.
fn is_whole(bytes: &[u8]) -> bool {
    const CLASS_64: u8 = 2;
    const ORDER: u8 = if cfg!(target_endian = "little") { 1 } else { 2 };
    const LOAD: u64 = 1;
    let number = |at: u64, size: u64| -> Option<u64> {
        let part = bytes.get(at as usize..at.checked_add(size)? as usize)?;
        let fold = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(match ORDER {
            1 => part.iter().rev().fold(0, fold),
            _ => part.iter().fold(0, fold),
        })
    };
    let is_inside =
        |from: u64, size: u64| from.checked_add(size).is_some_and(|end| end <= bytes.len() as u64);
    let whole = || -> Option<bool> {
        let kind = bytes.get(..6)? == [0x7f, b'E', b'L', b'F', CLASS_64, ORDER];
        let programs = number(0x20, 8)?;
        let sections = number(0x28, 8)?;
        let [program_size, n_programs] = [number(0x36, 2)?, number(0x38, 2)?];
        let [section_size, n_sections] = [number(0x3a, 2)?, number(0x3c, 2)?];
        let mut inside = kind
            && program_size >= 56
            && is_inside(programs, program_size * n_programs)
            && is_inside(sections, section_size * n_sections);
        for k in 0..n_programs {
            let at = programs.checked_add(k * program_size)?;
            if number(at, 4)? == LOAD {
                inside &= is_inside(number(at.checked_add(8)?, 8)?, number(at + 32, 8)?);
            }
        }
        Some(inside)
    };
    whole().unwrap_or(false)
}
