//! Shared memory that runs out, or that a client cuts short, must not end the server.
//!
//! A page of a shared file that has no memory behind it ends the process that touches it by SIGBUS:
//! where /dev/shm is full, or where a client truncates a file. Segments are reserved when they are
//! made, but the transport touches them earlier, and a client controls its own file. The guard puts
//! a page of zeros, private to this process, in place of the missing one and counts; only the
//! client of that page gets wrong answers, and a segment that is being set up is refused. Pages of
//! private mappings, such as this program's code and constants, are never replaced: there a fault
//! ends the process.
// lint: a handler of a memory fault cannot be written in safe Rust; everything that needs it is in
// this file
#![allow(unsafe_code)]

use std::io;
use std::mem::MaybeUninit;
use std::ops::Range;
use std::os::fd::{BorrowedFd, IntoRawFd};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicI32, AtomicU64, AtomicUsize, Ordering::Relaxed};

use rustix::fs::{Mode, OFlags};

/// Bytes of a page on this machine.
static PAGE: AtomicUsize = AtomicUsize::new(4096);

static PAGES: AtomicU64 = AtomicU64::new(0);

/// The kernel's list of this process's mappings.
static MAPS: AtomicI32 = AtomicI32::new(-1);

/// Installs the guard for the whole process.
pub(crate) fn install() -> io::Result<()> {
    // SAFETY: asks for a number.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    PAGE.store(usize::try_from(page).unwrap_or(4096), Relaxed);
    // opened once: later the process may have no descriptor left
    let flags = OFlags::RDONLY | OFlags::CLOEXEC;
    let maps = rustix::fs::open(c"/proc/self/maps", flags, Mode::empty())?;
    MAPS.store(maps.into_raw_fd(), Relaxed);
    let mut action = MaybeUninit::<libc::sigaction>::zeroed();
    // SAFETY: all fields of `sigaction` may be zero; the handler has the signature that SA_SIGINFO
    // asks for.
    let outcome = unsafe {
        let fields = &mut *action.as_mut_ptr();
        fields.sa_sigaction = replace_page as *const () as usize;
        fields.sa_flags = libc::SA_SIGINFO;
        libc::sigaction(libc::SIGBUS, action.as_ptr(), null_mut())
    };
    if outcome == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

/// Number of replaced pages since the start.
pub(crate) fn replaced_pages() -> u64 {
    PAGES.load(Relaxed)
}

extern "C" fn replace_page(
    _signal: libc::c_int,
    info: *mut libc::siginfo_t,
    _context: *mut libc::c_void,
) {
    // SAFETY: the kernel gives a valid record; only async-signal-safe calls are made. The fault was
    // that of an access to a shared mapping, whose file has no memory for this page. The accessing
    // thread borrows the mapping, so that no other can lie there before the page is replaced.
    // Another thread may have replaced the page already, or the client may have given it memory:
    // what was written there is lost, as the words of a mapping may change at any time. No
    // reference to them exists that assumes otherwise (the rule stands in `proto/src/lane.rs`).
    unsafe {
        let address = (*info).si_addr() as usize;
        let missing = (*info).si_code == libc::BUS_ADRERR;
        let mapping = if missing { mapping_of(address) } else { None };
        if mapping == Some(Mapping::Anonymous) {
            return;
        }
        if mapping == Some(Mapping::Shared) {
            let size = PAGE.load(Relaxed);
            let page = (address & !(size - 1)) as *mut libc::c_void;
            let protection = libc::PROT_READ | libc::PROT_WRITE;
            let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
            if libc::mmap(page, size, protection, flags, -1, 0) != libc::MAP_FAILED {
                PAGES.fetch_add(1, Relaxed);
                return;
            }
        }
        // any other fault ends the process as without the guard: the fault comes again, or the
        // signal
        libc::signal(libc::SIGBUS, libc::SIG_DFL);
        libc::raise(libc::SIGBUS);
    }
}

/// A kind of mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mapping {
    Shared,
    /// Of a file, such as the program.
    Private,
    /// Of no file: a page that another thread has just replaced.
    Anonymous,
}

/// The mapping of an address, by the kernel's list; async-signal-safe.
fn mapping_of(address: usize) -> Option<Mapping> {
    // SAFETY: the descriptor was opened by `install` and is never closed.
    let maps = unsafe { BorrowedFd::borrow_raw(MAPS.load(Relaxed)) };
    let mut chunk = [0; 1024];
    let mut at = 0;
    // the fields of a line before the path: addresses, permissions, offset, device, inode
    let mut head = [0; 96];
    let mut length = 0;
    while let Ok(n @ 1..) = rustix::io::pread(maps, &mut chunk, at) {
        at += n as u64;
        for byte in &chunk[..n] {
            if *byte == b'\n' {
                let found = mapping(&head[..length]);
                if let Some((_, kind)) = found.filter(|(range, _)| range.contains(&address)) {
                    return Some(kind);
                }
                length = 0;
            } else if length < head.len() {
                head[length] = *byte;
                length += 1;
            }
        }
    }
    None
}

/// The addresses of a line of the list, and the kind of mapping.
fn mapping(line: &[u8]) -> Option<(Range<usize>, Mapping)> {
    // a path may be cut within a letter
    let fields = line.split(|byte| *byte == b' ').filter(|field| !field.is_empty());
    let mut fields = fields.map_while(|field| core::str::from_utf8(field).ok());
    let (start, end) = fields.next()?.split_once('-')?;
    let permissions = fields.next()?;
    let inode = fields.nth(2)?;
    let address = |digits| usize::from_str_radix(digits, 16).ok();
    let kind = match (permissions.as_bytes().get(3)?, inode) {
        (b's', _) => Mapping::Shared,
        (_, "0") => Mapping::Anonymous,
        _ => Mapping::Private,
    };
    Some((address(start)?..address(end)?, kind))
}

/// Held by tests that replace pages, and by tests that fail after a replaced page: the count is per
/// process.
#[cfg(test)]
pub(crate) static REPLACING: std::sync::Mutex<()> = std::sync::Mutex::new(());

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_is_missing_reads_as_zeros() {
        let _replacing = REPLACING.lock();
        install().unwrap();
        let size = PAGE.load(Relaxed);
        let before = replaced_pages();
        // SAFETY: a mapping of two pages of a file of one page; it is unmapped at the end.
        unsafe {
            let file = libc::memfd_create(c"short".as_ptr(), 0);
            assert!(file >= 0 && libc::ftruncate(file, size as libc::off_t) == 0);
            let protection = libc::PROT_READ | libc::PROT_WRITE;
            let start = libc::mmap(null_mut(), 2 * size, protection, libc::MAP_SHARED, file, 0)
                .cast::<u8>();
            assert_eq!(start.add(size).read_volatile(), 0);
            start.add(size).write_volatile(7);
            assert_eq!(start.add(size).read_volatile(), 7);
            libc::munmap(start.cast(), 2 * size);
            libc::close(file);
        }
        assert_eq!(replaced_pages(), before + 1);
    }

    #[test]
    fn a_private_page_that_is_missing_ends_the_process() {
        let _replacing = REPLACING.lock();
        install().unwrap();
        let size = PAGE.load(Relaxed);
        // SAFETY: a mapping as above, but private; the forked child makes no call but the read that
        // ends it.
        unsafe {
            let file = libc::memfd_create(c"short".as_ptr(), 0);
            assert!(file >= 0 && libc::ftruncate(file, size as libc::off_t) == 0);
            let start =
                libc::mmap(null_mut(), 2 * size, libc::PROT_READ, libc::MAP_PRIVATE, file, 0)
                    .cast::<u8>();
            let child = libc::fork();
            if child == 0 {
                start.add(size).read_volatile();
                libc::_exit(0);
            }
            let mut status = 0;
            assert_eq!(libc::waitpid(child, &mut status, 0), child);
            assert!(libc::WIFSIGNALED(status), "{status}");
            assert_eq!(libc::WTERMSIG(status), libc::SIGBUS);
            libc::munmap(start.cast(), 2 * size);
            libc::close(file);
        }
    }
}
