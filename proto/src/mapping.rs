//! Memory that server and client share without a name: a file in memory that goes through the
//! control socket, mapped as words. Its size is sealed, so that the other side cannot shrink it,
//! and each word is read and written whole. Words that outlive a process have a name. A page of
//! private memory shows a process that it was forked from another.
// lint: a mapping cannot be made in safe Rust; everything that needs it is in this file
#![allow(unsafe_code)]

use std::ffi::c_void;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::ptr::NonNull;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use rustix::fs::{
    FallocateFlags, MemfdFlags, OFlags, SealFlags, fallocate, fcntl_add_seals, fcntl_get_seals,
    fstat, memfd_create,
};
use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap, mmap_anonymous, munmap};

use crate::domain::SHARED_MEMORY;

/// Words of shared memory, mapped until this is dropped.
pub(crate) struct Mapping {
    start: NonNull<AtomicU64>,
    n_words: usize,
}

// SAFETY: the mapping stays until the value is dropped and holds atomic integers only.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

impl Mapping {
    /// New memory of this many zeros, fully allocated, and its descriptor; its size never changes.
    pub(crate) fn create(name: &str, n_words: usize) -> io::Result<(Mapping, OwnedFd)> {
        let memory = memfd_create(name, MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING)?;
        fallocate(&memory, FallocateFlags::empty(), 0, bytes(n_words) as u64)?;
        fcntl_add_seals(&memory, SealFlags::SHRINK | SealFlags::GROW)?;
        Ok((Mapping::new(&memory, n_words, ProtFlags::READ | ProtFlags::WRITE)?, memory))
    }

    /// Memory of the other side.
    ///
    /// # Errors
    /// `InvalidData` for a file that is smaller or may shrink.
    pub(crate) fn open(memory: &OwnedFd, n_words: usize, write: bool) -> io::Result<Mapping> {
        let sealed = fcntl_get_seals(memory).is_ok_and(|seals| seals.contains(SealFlags::SHRINK));
        if !sealed || fstat(memory)?.st_size < bytes(n_words) as i64 {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let protection = if write { ProtFlags::WRITE } else { ProtFlags::empty() };
        Mapping::new(memory, n_words, ProtFlags::READ | protection)
    }

    fn new(memory: &OwnedFd, n_words: usize, protection: ProtFlags) -> io::Result<Mapping> {
        // no page fault occurs while a client waits
        let flags = MapFlags::SHARED | MapFlags::POPULATE;
        // SAFETY: a fresh mapping at an address that the kernel chooses; the file has this size. It
        // is sealed against shrinking, or this user's; a page that is missing all the same is a
        // fault that the guard of the server answers or that ends the process.
        let start =
            unsafe { mmap(std::ptr::null_mut(), bytes(n_words), protection, flags, memory, 0) }?;
        Mapping::at(start, n_words)
    }

    /// A private word, which is zero again in a child of `fork`.
    fn wiped_on_fork() -> io::Result<Mapping> {
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a fresh mapping at an address that the kernel chooses.
        let start = unsafe {
            mmap_anonymous(std::ptr::null_mut(), bytes(1), protection, MapFlags::PRIVATE)
        }?;
        let mapping = Mapping::at(start, 1)?;
        // SAFETY: the page is this mapping's; zero is a valid atomic integer.
        unsafe { madvise(start, bytes(1), Advice::LinuxWipeOnFork) }?;
        Ok(mapping)
    }

    /// The mapping that was made here.
    fn at(start: *mut c_void, n_words: usize) -> io::Result<Mapping> {
        let start = NonNull::new(start.cast());
        let start = start.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
        Ok(Mapping { start, n_words })
    }

    /// The words.
    #[inline]
    pub(crate) fn words(&self) -> &[AtomicU64] {
        // SAFETY: this many words are mapped, aligned to a page, and any bits are atomic integers;
        // where the mapping is read-only its owner stores nothing.
        unsafe { std::slice::from_raw_parts(self.start.as_ptr(), self.n_words) }
    }

    /// Frees the memory for every process that maps it or keeps its descriptor: reads then give
    /// zeros, and writes allocate again. If that is refused the memory stays unchanged.
    pub(crate) fn empty(&self) {
        // SAFETY: all of it is this mapping's; its words stay mapped and are atomic integers, for
        // which any bits are valid.
        let _ = unsafe {
            madvise(self.start.as_ptr().cast(), bytes(self.n_words), Advice::LinuxRemove)
        };
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping was made by `new` and nothing refers to it any more.
        let _ = unsafe { munmap(self.start.as_ptr().cast(), bytes(self.n_words)) };
    }
}

/// Words that outlive this process, however it ends: those of a file in /dev/shm, which is locked
/// while the process lives. The first word is not 0 until the words are [taken](LeftWords).
pub struct KeptWords {
    mapping: Mapping,
    path: PathBuf,
    _locked: OwnedFd,
}

impl KeptWords {
    /// New words, zero but for the first, fully allocated, in a file that only this user reads.
    ///
    /// # Errors
    /// The name is taken, or there is no room.
    pub fn create(name: &str, n_words: usize) -> io::Result<KeptWords> {
        let path = path_of(name);
        let mut options = File::options();
        let file = options.read(true).write(true).create_new(true).mode(0o600).open(&path)?;
        let make = || {
            file.try_lock()?;
            let memory = OwnedFd::from(file);
            fallocate(&memory, FallocateFlags::empty(), 0, bytes(n_words) as u64)?;
            let mapping = Mapping::new(&memory, n_words, ProtFlags::READ | ProtFlags::WRITE)?;
            if let Some(first) = mapping.words().first() {
                first.store(1, Relaxed);
            }
            Ok((mapping, memory))
        };
        match make() {
            Ok((mapping, _locked)) => Ok(KeptWords { mapping, path, _locked }),
            Err(error) => {
                let _ = fs::remove_file(path);
                Err(error)
            }
        }
    }

    /// The words.
    #[inline]
    pub fn words(&self) -> &[AtomicU64] {
        self.mapping.words()
    }
}

impl Drop for KeptWords {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

/// The words that a dead process left, locked for this one.
pub struct LeftWords {
    file: File,
    path: PathBuf,
}

impl LeftWords {
    /// Whether there is a file of this name.
    pub fn exist(name: &str) -> bool {
        fs::symlink_metadata(path_of(name)).is_ok()
    }

    /// Takes the words that a process of this user left under the name; waits while another process
    /// has taken them. `None` where there are none, or their process lives.
    ///
    /// # Errors
    /// The file is another user's, or is taken for too long; the words name the process.
    pub fn take(name: &str) -> io::Result<Option<LeftWords>> {
        LeftWords::take_within(name, LOOKS)
    }

    /// As `take`, with so many looks at words that another process has taken.
    fn take_within(name: &str, most: u32) -> io::Result<Option<LeftWords>> {
        let path = path_of(name);
        let file = match open_own(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            opened => opened?,
        };
        let mut first = [0; 8];
        let mut lives = 0;
        let mut looks = 0;
        while let Err(error) = file.try_lock() {
            if let TryLockError::Error(error) = error {
                return Err(error);
            }
            // a process that takes them marks them soon after it locked them
            lives = match file.read_exact_at(&mut first, 0) {
                Ok(()) if first != [0; 8] => lives + 1,
                _ => 0,
            };
            if lives > ALIVE {
                return Ok(None);
            }
            looks += 1;
            if looks > most {
                return Err(held(&file, &path));
            }
            std::thread::sleep(LOOK);
        }
        if file.metadata()?.nlink() == 0 {
            return Ok(None);
        }
        file.write_all_at(&[0; 8], 0)?;
        Ok(Some(LeftWords { file, path }))
    }

    /// The bytes of at most `n_words`.
    ///
    /// # Errors
    /// There are more.
    pub fn bytes(&self, n_words: usize) -> io::Result<Vec<u8>> {
        if self.file.metadata()?.len() > bytes(n_words) as u64 {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let mut words = Vec::new();
        (&self.file).read_to_end(&mut words)?;
        Ok(words)
    }

    /// Removes them.
    pub fn remove(self) {
        let _ = fs::remove_file(&self.path);
    }

    /// Removes those of dead processes of this user whose names begin so; their paths.
    pub fn clear(prefix: &str) -> Vec<PathBuf> {
        let all = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
        let names = all.filter_map(|entry| entry.file_name().into_string().ok());
        let names = names.filter_map(|name| Some(name.strip_prefix(PREFIX)?.to_owned()));
        let left = names.filter(|name| name.starts_with(prefix));
        let left = left.filter_map(|name| LeftWords::take(&name).ok()?);
        left.map(|left| (left.path.clone(), left.remove()).0).collect()
    }
}

/// Opens a file of this user for reading and writing, and follows no link.
///
/// # Errors
/// It is another user's, no file, or cannot be opened.
pub fn open_own(path: &Path) -> io::Result<File> {
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
    let file = File::options().read(true).write(true).custom_flags(flags).open(path)?;
    let found = file.metadata()?;
    if !found.is_file() || found.uid() != rustix::process::geteuid().as_raw() {
        let words = format!("{} belongs to user {}", path.display(), found.uid());
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, words));
    }
    Ok(file)
}

/// The error of a file that another process holds, with its number where the kernel tells it.
fn held(file: &File, path: &Path) -> io::Error {
    let holder = holder(file).map_or("another process".to_owned(), |pid| format!("process {pid}"));
    let words = format!("{} is held by {holder}; end it, or try again later", path.display());
    io::Error::new(io::ErrorKind::WouldBlock, words)
}

/// The process that holds the lock of a file, if this one sees it.
fn holder(file: &File) -> Option<u32> {
    let found = file.metadata().ok()?;
    let [major, minor] = [rustix::fs::major, rustix::fs::minor].map(|part| part(found.dev()));
    let place = format!("{major:02x}:{minor:02x}:{}", found.ino());
    let locks = fs::read_to_string("/proc/locks").ok()?;
    let mut holders = locks.lines().filter_map(|line| {
        // `1: FLOCK  ADVISORY  WRITE 4321 00:1a:77 0 EOF`
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            [_, "FLOCK", _, _, process, at, ..] if at == place => process.parse().ok(),
            _ => None,
        }
    });
    // 0 stands for a process of another namespace
    holders.find(|process| *process != 0)
}

/// Looks at words that are locked and not marked, after which their process counts as alive, and at
/// those that another process has taken, after which it takes too long.
const ALIVE: u32 = 3;
const LOOKS: u32 = 500;
const LOOK: Duration = Duration::from_millis(20);
/// The names of all files in shared memory begin so.
const PREFIX: &str = "sarrus_";

fn path_of(name: &str) -> PathBuf {
    Path::new(SHARED_MEMORY).join(format!("{PREFIX}{name}"))
}

/// A number of this process, other than that of each process from which it was forked. Makes no
/// system call after the first time.
#[inline]
pub fn process_number() -> u64 {
    static MARK: OnceLock<Option<Mapping>> = OnceLock::new();
    match MARK.get_or_init(|| Mapping::wiped_on_fork().ok()) {
        Some(mark) => match mark.words()[0].load(Relaxed) {
            0 => number_process(&mark.words()[0]),
            number => number,
        },
        // a kernel before 4.14: a system call each time
        None => std::process::id().into(),
    }
}

/// Numbers this process after its start or after a fork.
#[cold]
fn number_process(mark: &AtomicU64) -> u64 {
    // a forked process continues the count of its parent
    static LAST: AtomicU64 = AtomicU64::new(0);
    let fresh = LAST.fetch_add(1, Relaxed) + 1;
    // another thread may have been first
    mark.compare_exchange(0, fresh, Relaxed, Relaxed).map_or_else(|found| found, |_| fresh)
}

const fn bytes(n_words: usize) -> usize {
    n_words * size_of::<AtomicU64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::process::CommandExt;
    use std::process::{Command, Stdio};
    use std::sync::Arc;

    use rustix::fs::ftruncate;

    #[test]
    fn both_sides_see_the_same_words_and_nobody_can_change_their_number() {
        let (mine, memory) = Mapping::create("words", 1000).unwrap();
        let theirs = Mapping::open(&memory, 1000, true).unwrap();
        assert!(mine.words().iter().all(|word| word.load(Relaxed) == 0));
        theirs.words()[999].store(7, Relaxed);
        assert_eq!(mine.words()[999].load(Relaxed), 7);
        assert!(ftruncate(&memory, 8).is_err() && ftruncate(&memory, 1 << 20).is_err());
        assert!(Mapping::open(&memory, 1001, true).is_err());
    }

    #[test]
    fn what_is_emptied_takes_no_memory_whoever_keeps_its_descriptor() {
        let blocks = |memory: &OwnedFd| fstat(memory).unwrap().st_blocks;
        let (mine, memory) = Mapping::create("words", 1 << 17).unwrap();
        let theirs = Mapping::open(&memory, 1 << 17, true).unwrap();
        theirs.words().iter().for_each(|word| word.store(7, Relaxed));
        assert_eq!(blocks(&memory), 1 << 11);
        mine.empty();
        assert_eq!(blocks(&memory), 0);
        drop(mine);
        assert!([0, (1 << 17) - 1].iter().all(|k| theirs.words()[*k].load(Relaxed) == 0));
    }

    #[test]
    fn the_wait_for_words_that_another_process_holds_ends_with_its_number_and_the_file() {
        let name = format!("held_{}", std::process::id());
        let path = path_of(&name);
        fs::write(&path, [0; 16]).unwrap();
        // another process holds them, and goes on for longer than anybody waits
        let mut holder = Command::new("flock");
        holder.args(["--exclusive", "--no-fork"]).arg(&path).args(["sh", "-c", "echo && cat"]);
        let mut holder = holder.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        holder.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
        let error = LeftWords::take_within(&name, 2).err().unwrap();
        let words = error.to_string();
        assert_eq!(error.kind(), io::ErrorKind::WouldBlock);
        for part in [format!("{} is held", path.display()), format!("process {};", holder.id())] {
            assert!(words.contains(&part), "{words}");
        }
        // then they are free again
        drop(holder.stdin.take());
        assert!(holder.wait().unwrap().success());
        LeftWords::take_within(&name, 0).unwrap().unwrap().remove();
    }

    #[test]
    fn a_forked_process_has_a_number_of_its_own() {
        let number = process_number();
        let seen = Arc::new(Mapping::create("seen", 2).unwrap().0);
        let theirs = Arc::clone(&seen);
        let mut command = Command::new("true");
        let look = move || {
            theirs.words().iter().for_each(|word| word.store(process_number(), Relaxed));
            Ok(())
        };
        // SAFETY: in the forked process `look` allocates nothing and takes no lock.
        unsafe { command.pre_exec(look) };
        assert!(command.status().unwrap().success());
        let [first, second] = [0, 1].map(|k| seen.words()[k].load(Relaxed));
        assert!(first != 0 && first == second && first != number);
        assert_eq!(process_number(), number);
    }

    #[test]
    fn a_file_that_may_shrink_is_refused() {
        let memory = memfd_create("loose", MemfdFlags::ALLOW_SEALING).unwrap();
        ftruncate(&memory, 8000).unwrap();
        assert!(Mapping::open(&memory, 1000, false).is_err());
        fcntl_add_seals(&memory, SealFlags::SHRINK).unwrap();
        assert!(Mapping::open(&memory, 1000, false).is_ok());
    }
}
