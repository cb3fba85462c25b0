//! Fault files, the same for every frontend: their folder, names and number.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use sarrus_proto::actuators::Reason;

use crate::config::Configuration;
use crate::fault_log::FaultLog;

/// Number of files kept for one bridge.
const FILES: usize = 16;

/// The files of one bridge.
#[derive(Clone, Debug)]
pub struct FaultFiles {
    folder: PathBuf,
    name: String,
}

impl FaultFiles {
    /// The files of the named bridge; the folder is created on first use.
    pub fn new(folder: PathBuf, name: &str) -> FaultFiles {
        FaultFiles { folder, name: name.to_owned() }
    }

    /// The default folder by the XDG conventions; `of` gives environment variables.
    pub fn usual_folder(of: impl Fn(&str) -> Option<OsString>) -> PathBuf {
        let of = |name: &str| of(name).map(PathBuf::from).filter(|path| path.is_absolute());
        of("XDG_STATE_HOME")
            .or_else(|| of("HOME").map(|home| home.join(".local/state")))
            .unwrap_or_else(std::env::temp_dir)
            .join("sarrus/faults")
    }

    /// Their folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes the log of a fault, `ms` after the epoch, and removes all but the newest files.
    ///
    /// # Errors
    /// The system's message.
    pub fn write(
        &self,
        ms: u128,
        reason: Reason,
        log: &FaultLog,
        configuration: &Configuration,
    ) -> io::Result<PathBuf> {
        fs::create_dir_all(&self.folder)?;
        let path = self.folder.join(format!("{}-{ms:015}-{}.jsonl", self.name, reason.name()));
        let mut file = BufWriter::new(File::create(&path)?);
        for line in log.lines() {
            writeln!(file, "{}", line.text(configuration))?;
        }
        file.flush()?;
        self.forget_old()?;
        Ok(path)
    }

    /// Removes all but the newest files; their names begin with the bridge's and then the time.
    fn forget_old(&self) -> io::Result<()> {
        let prefix = format!("{}-", self.name);
        let is_ours = |name: &str| {
            let rest = name.strip_prefix(&prefix).and_then(|rest| rest.strip_suffix(".jsonl"));
            rest.and_then(|rest| rest.get(..15))
                .is_some_and(|time| time.bytes().all(|byte| byte.is_ascii_digit()))
        };
        let names = fs::read_dir(&self.folder)?
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok());
        let mut ours: Vec<String> = names.filter(|name| is_ours(name)).collect();
        ours.sort();
        for old in ours.iter().rev().skip(FILES) {
            fs::remove_file(self.folder.join(old))?;
        }
        Ok(())
    }
}
