//! The recorder's file: a ring of segments, reserved before the server is ready.
//!
//! Written frames are in the kernel's cache and survive any end of this process, but not a crash of
//! the machine. The whole file is reserved at the start, so that a disk that fills up later does no
//! harm.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use quanta::Clock;
use rustix::fs::{FallocateFlags, OFlags, fallocate};
use rustix::io::Errno;
use sarrus_proto::open_own;

use super::error::{RecordError, RecordingError};
use super::format::{
    FRAME, FRAME_HEAD, MAGIC, PAGE, SEGMENT, SEGMENT_HEAD, WORD, checksum, join, word, words,
};
use super::header::Header;
use super::ring::{self, Left, Settled};
use crate::system::stderr::line;

/// Most bytes in one write.
const BATCH: usize = 1 << 20;
/// Recordings of earlier runs that are kept, one fewer than the deaths after which a supervisor
/// gives up.
const KEPT: usize = 4;

/// A file that is being recorded to.
pub(super) struct RecordFile {
    file: File,
    header: Header,
    /// The end, with the pending frames.
    pub(super) end: Settled,
    /// Frames not written yet; they end at `end`.
    batch: Vec<u8>,
}

impl RecordFile {
    /// Makes the file and reserves all of it; renames an existing one.
    ///
    /// # Errors
    /// [`RecordError`]; a new file is then removed.
    pub(super) fn create(
        path: &Path,
        header: Header,
        robot: &[u8],
    ) -> Result<RecordFile, RecordError> {
        set_aside(path)?;
        let failed = |source| RecordError::Make(path.to_owned(), source);
        let mut options = OpenOptions::new();
        let file = options
            .read(true)
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(path)
            .map_err(failed)?;
        let made = file
            .try_lock()
            .map_err(io::Error::from)
            .and_then(|()| file.write_all_at(&header.to_bytes(), 0))
            .and_then(|()| reserve(&file, header.file().unwrap_or(u64::MAX)))
            .and_then(|()| file.write_all_at(robot, PAGE as u64));
        if let Err(source) = made {
            let _ = fs::remove_file(path);
            return Err(match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    RecordError::NoSpace(path.to_owned(), header.file().unwrap_or(u64::MAX))
                }
                _ => failed(source),
            });
        }
        let batch = Vec::with_capacity(BATCH);
        // no room: the first frame begins the first segment
        let end = Settled { at: header.segment, ..Settled::default() };
        Ok(RecordFile { file, header, end, batch })
    }

    /// Adds a frame.
    ///
    /// # Errors
    /// The error of a write, if one was due.
    pub(super) fn add(&mut self, body: &[u64]) -> io::Result<()> {
        let n_bytes = WORD * (FRAME_HEAD + body.len());
        if self.end.at + n_bytes as u64 > self.header.segment {
            self.flush()?;
            self.end.segment += 1;
            self.end.at = 0;
            let head = segment_head(self.header.run, self.end.segment, self.end.sequence);
            self.put(head);
        }
        let head = frame_head(self.header.run, self.end.segment, self.end.sequence, body);
        self.put(head);
        self.put(body.iter().copied());
        self.end.sequence += 1;
        if self.batch.len() >= BATCH / 2 { self.flush() } else { Ok(()) }
    }

    /// Writes the pending frames.
    ///
    /// # Errors
    /// The error of the write; the pending frames are dropped.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        if self.batch.is_empty() {
            return Ok(());
        }
        let index = (self.end.segment - 1) % self.header.segments;
        let start = self.header.segment_at(index) + self.end.at - self.batch.len() as u64;
        let written = self.file.write_all_at(&self.batch, start);
        self.batch.clear();
        written
    }

    fn put(&mut self, words: impl IntoIterator<Item = u64>) {
        let before = self.batch.len();
        self.batch.extend(words.into_iter().flat_map(u64::to_le_bytes));
        self.end.at += (self.batch.len() - before) as u64;
    }
}

/// The words before the first frame of a segment.
pub(super) fn segment_head(run: u64, number: u64, first: u64) -> [u64; SEGMENT_HEAD] {
    let head = [SEGMENT, number, first];
    [head[0], head[1], head[2], checksum(run, head)]
}

/// The words before a body.
pub(super) fn frame_head(run: u64, segment: u64, sequence: u64, body: &[u64]) -> [u64; FRAME_HEAD] {
    let head = [join(body.len() as u32, FRAME), sequence];
    let seed = checksum(run ^ segment, head);
    [head[0], head[1], seed, checksum(seed, body.iter().copied())]
}

/// Reserves the whole file; writes zeros if the file system cannot reserve.
fn reserve(file: &File, bytes: u64) -> io::Result<()> {
    match fallocate(file, FallocateFlags::empty(), 0, bytes) {
        Err(Errno::OPNOTSUPP | Errno::NOSYS) => {
            let zeros = vec![0; BATCH];
            let mut file = file;
            file.seek(SeekFrom::Start(PAGE as u64))?;
            let mut rest = bytes.saturating_sub(PAGE as u64);
            while rest > 0 {
                let n = rest.min(BATCH as u64);
                file.write_all(zeros.get(..n as usize).unwrap_or_default())?;
                rest -= n;
            }
            Ok(())
        }
        outcome => outcome.map_err(io::Error::from),
    }
}

/// Adds to a recording the records that a killed server had not yet written. The recording of a
/// living server, and a file that is none, stay as they are.
///
/// # Errors
/// The records cannot be added, and stay where they are.
pub fn complete(path: &Path) -> io::Result<()> {
    let Ok(path) = fs::canonicalize(path) else { return Ok(()) };
    let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits() as i32;
    let Ok(file) = File::options().read(true).custom_flags(flags).open(&path) else {
        return Ok(());
    };
    let Ok(header) = header_of(&file) else { return Ok(()) };
    if !ring::is_there(header.run) {
        return Ok(());
    }
    // one descriptor for the checks and the writes
    let file = open_own(&path)?;
    let Some((Left { start, end, bodies }, ring)) = ring::left(header.run)? else { return Ok(()) };
    if header_of(&file).ok() != Some(header) || !ends_at(&file, &header, end) {
        return Err(io::Error::other("the records in /dev/shm do not continue the file"));
    }
    let mut file = RecordFile { file, header, end, batch: Vec::with_capacity(BATCH) };
    if !bodies.is_empty() {
        let clock = Clock::new();
        for mut body in bodies {
            ring::since(start, &clock, &mut body);
            file.add(&body)?;
        }
        file.flush()?;
    }
    ring.remove();
    Ok(())
}

fn header_of(file: &File) -> Result<Header, RecordingError> {
    let mut page = vec![0; PAGE];
    file.read_exact_at(&mut page, 0)?;
    Header::read(&page)
}

/// Whether a recording, of its full size, may end there: in a segment of its own, or before the
/// first.
fn ends_at(file: &File, header: &Header, end: Settled) -> bool {
    let head_of = |number: u64| {
        let mut head = [0; WORD * SEGMENT_HEAD];
        let at = header.segment_at((number - 1) % header.segments);
        file.read_exact_at(&mut head, at).ok()?;
        let first = word(&head, 2);
        words(&head).eq(segment_head(header.run, number, first)).then_some(first)
    };
    let is_whole =
        file.metadata().ok().zip(header.file()).is_some_and(|(found, all)| found.len() >= all);
    let begun = match end.segment {
        0 => end.at == header.segment,
        number => {
            end.at <= header.segment && head_of(number).is_some_and(|first| first <= end.sequence)
        }
    };
    is_whole && begun
}

/// Keeps the recording of an earlier run as `FILE.1`, and those before it under the next numbers;
/// one without a record is removed.
fn set_aside(path: &Path) -> Result<(), RecordError> {
    let failed = |source| RecordError::Make(path.to_owned(), source);
    if let Err(error) = complete(path) {
        line(format_args!(
            "sarrus serve: warning: the last records of {} may be missing: {error}",
            path.display()
        ));
    }
    let Some((file, page)) = claim(path)? else { return Ok(()) };
    if !has_records(&file, &page) {
        return fs::remove_file(path).map_err(failed);
    }
    let mut kept = Vec::new();
    while kept.len() < KEPT
        && let Some(claimed) = claim(&earlier(path, kept.len() + 1))?
    {
        kept.push(claimed);
    }
    for n in (1..=kept.len()).rev().filter(|n| *n < KEPT) {
        fs::rename(earlier(path, n), earlier(path, n + 1)).map_err(failed)?;
    }
    fs::rename(path, earlier(path, 1)).map_err(failed)
}

/// Removes the oldest recording but `FILE.1`; false if there is none.
pub(super) fn remove_oldest(path: &Path) -> bool {
    let paths = (2..=KEPT).rev().map(|n| earlier(path, n));
    let mut oldest = paths.filter(|path| claim(path).is_ok_and(|claimed| claimed.is_some()));
    oldest.next().is_some_and(|path| fs::remove_file(path).is_ok())
}

/// A recording to which no server records, locked, and its first page; `None` where there is no
/// file.
fn claim(path: &Path) -> Result<Option<(File, Vec<u8>)>, RecordError> {
    let failed = |source| RecordError::Make(path.to_owned(), source);
    let metadata = match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        found => found.map_err(failed)?,
    };
    let foreign = || RecordError::Foreign(path.to_owned());
    if !metadata.is_file() {
        return Err(foreign());
    }
    let mut file = File::open(path).map_err(failed)?;
    let mut page = Vec::new();
    Read::by_ref(&mut file).take(PAGE as u64).read_to_end(&mut page).map_err(failed)?;
    if !page.is_empty() && word(&page, 0) != MAGIC {
        return Err(foreign());
    }
    match file.try_lock() {
        Ok(()) => Ok(Some((file, page))),
        Err(fs::TryLockError::WouldBlock) => Err(RecordError::InUse(path.to_owned())),
        Err(fs::TryLockError::Error(source)) => Err(failed(source)),
    }
}

/// Whether the first segment was begun; true if that cannot be read.
fn has_records(file: &File, page: &[u8]) -> bool {
    let Ok(header) = Header::read(page) else { return !page.is_empty() };
    let mut first = [0; WORD];
    match file.read_exact_at(&mut first, header.segment_at(0)) {
        Ok(()) => u64::from_le_bytes(first) == SEGMENT,
        Err(_) => false,
    }
}

/// The path for the recording of the last run, for n = 1, or of an earlier one.
fn earlier(path: &Path, n: usize) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{n}"));
    name.into()
}
