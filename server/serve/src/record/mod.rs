//! The last seconds of requests and answers in a file: the black box of a robot that fell.
//!
//! The answering thread copies each request with its answer into a ring (`ring.rs`), which outlives
//! the process; a thread of normal priority moves them into a file (`file.rs`, `format.rs`) that
//! holds robot, plans and numbers, so that [`replay()`] needs nothing else. Answers are functions
//! of model, plan and input alone, so they can be computed again and compared bit by bit.

mod error;
mod file;
mod format;
mod header;
mod read;
mod replay;
mod ring;
mod robot;
#[cfg(test)]
mod tests;

use std::path::PathBuf;
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use quanta::Clock;
use sarrus_dynamics::Model;
use sarrus_proto::{PROTOCOL_VERSION, Sizes};
use tracing::{error, info};

pub use error::{RecordError, RecordingError};
pub use format::Client;
pub use read::{Entry, Gaps, Recording};
pub use replay::{Difference, Replayed, replay};
pub(crate) use ring::Recorder;
pub use robot::RecordedRobot;

use crate::system::stderr::line;
pub use file::complete;
use file::{RecordFile, remove_oldest};
use format::{checksum, words};
use header::Header;
use ring::Records;
pub use ring::clear;

/// Sleep of the recorder when nothing is pending.
const NAP: Duration = Duration::from_millis(2);

/// Options of a recording.
#[derive(Clone, Debug)]
pub struct RecordOptions {
    /// The file; those of the last runs are kept with `.1` to `.4` after its name.
    pub file: PathBuf,
    /// The least recorded time, with 1 kHz through each lane `[s]`.
    pub seconds: u32,
    /// The robot to store in the file.
    pub robot: RecordedRobot,
    /// Whether the server answers without a recording rather than not at all, and with a shorter
    /// one where the disk has no room; a warning on stderr reports either.
    pub is_optional: bool,
}

/// As [`start`]; with a warning instead of an error for an optional recording.
///
/// # Errors
/// [`RecordError`].
pub(crate) fn start_or_warn(
    options: &RecordOptions,
    model: &Model<f64>,
    lanes: usize,
    clock: Clock,
    place: impl FnOnce() + Send + 'static,
) -> Result<Option<(Recorder, JoinHandle<()>)>, RecordError> {
    match start(options, model, lanes, clock, place) {
        Err(error) if options.is_optional => {
            line(format_args!("sarrus serve: warning: nothing is recorded: {error}"));
            error!(%error, "nothing is recorded");
            Ok(None)
        }
        started => started.map(Some),
    }
}

/// Makes the file and starts the thread that writes it.
///
/// The file has room for `seconds` of requests for inverse dynamics (y, ẏ, ÿ to τ_y, τ_u) at 1 kHz
/// through each of `lanes`; larger or more frequent ones shorten the recording. The thread begins
/// with `place`.
///
/// # Errors
/// [`RecordError`]; a new file is then removed.
fn start(
    options: &RecordOptions,
    model: &Model<f64>,
    lanes: usize,
    clock: Clock,
    place: impl FnOnce() + Send + 'static,
) -> Result<(Recorder, JoinHandle<()>), RecordError> {
    let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let start = since_1970.as_nanos() as u64;
    let ticks = clock.raw();
    // texts and numbers can always be written
    let robot = serde_json::to_vec(&options.robot).unwrap_or_default();
    let header = Header {
        protocol: PROTOCOL_VERSION.into(),
        fingerprint: model.fingerprint(),
        start,
        seconds: options.seconds.into(),
        run: checksum(start, [std::process::id().into()]),
        robot: robot.len() as u64,
        robot_checksum: checksum(0, words(&robot)),
        ..Header::default()
    };
    let Sizes { n_vy, n_u, .. } = model.sizes();
    let create = |seconds| {
        let header = Header { seconds, ..header }
            .sized(lanes as u64, (4 * n_vy + n_u) as u64)
            .ok_or_else(|| RecordError::NoSpace(options.file.clone(), u64::MAX))?;
        RecordFile::create(&options.file, header, &robot)
    };
    let mut seconds = options.seconds.into();
    let mut file = create(seconds);
    while let Err(RecordError::NoSpace(..)) = file {
        if !remove_oldest(&options.file) {
            if !options.is_optional || seconds <= 1 {
                break;
            }
            seconds /= 2;
        }
        file = create(seconds);
    }
    let file = file?;
    if seconds < options.seconds.into() {
        line(format_args!("sarrus serve: warning: the disk has room to record {seconds} s only"));
    }

    let ends = ring::ring(header.run, ticks, file.end, ring::CAPACITY).inspect_err(|_| {
        let _ = std::fs::remove_file(&options.file);
    });
    let (recorder, records) = ends.map_err(RecordError::Ring)?;
    let writer = Writer { records, file, clock, start: ticks };
    let thread = std::thread::Builder::new()
        .name("sarrus-record".to_owned())
        .spawn(move || {
            place();
            writer.run();
        })
        .map_err(RecordError::Thread)?;
    info!(file = %options.file.display(), "recording");
    Ok((recorder, thread))
}

/// The thread that writes.
struct Writer {
    records: Records,
    file: RecordFile,
    clock: Clock,
    start: u64,
}

impl Writer {
    fn run(mut self) {
        loop {
            // read before the last write, which then includes all records
            let is_last = self.records.is_abandoned();
            if let Err(error) = self.write() {
                line(format_args!("sarrus serve: warning: the recording ends here: {error}"));
                error!(%error, "the recording ends");
                return;
            }
            if is_last {
                return;
            }
            std::thread::sleep(NAP);
        }
    }

    /// Writes all pending records.
    fn write(&mut self) -> std::io::Result<()> {
        let mut body = Vec::with_capacity(format::MAX_BODY);
        while self.records.next(&mut body) {
            ring::since(self.start, &self.clock, &mut body);
            self.file.add(&body)?;
        }
        self.file.flush()?;
        self.records.settle(self.file.end);
        Ok(())
    }
}
