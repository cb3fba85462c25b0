//! `sarrus replay`.

use std::fs::File;
use std::path::{Path, PathBuf};

use clap::Args;
use sarrus_client::{LoadError, Source};
use sarrus_models::Loaded;
use sarrus_serve::record::{
    Difference, RecordedRobot, Recording, RecordingError, Replayed, complete, replay,
};

use super::output::{Failure, FormatFlag, Outcome, Results, table};
use super::progress::Progress;

/// Flags of `replay`.
#[derive(Args)]
pub(crate) struct Replay {
    /// The file of `sarrus serve --record`, also of a server that is still running.
    file: PathBuf,
    /// A bundled robot instead of the one in the file; a URDF file likewise.
    #[arg(long, value_name = "NAME", group = "source")]
    robot: Option<String>,
    /// A URDF file, as --urdf.
    #[arg(value_name = "FILE.urdf", group = "source")]
    urdf_file: Option<PathBuf>,
    /// Its submechanism file, as --submechanisms.
    #[arg(value_name = "FILE.yml", requires = "urdf_file", conflicts_with = "submechanisms")]
    submechanisms_file: Option<PathBuf>,
    /// A URDF file, or a SMURF file that names one, instead of the robot in the file.
    #[arg(long, value_name = "FILE", group = "source")]
    urdf: Option<PathBuf>,
    /// Submechanism file that goes with a URDF file.
    #[arg(long, value_name = "FILE", requires = "source", conflicts_with = "robot")]
    submechanisms: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Replay {
    pub(crate) fn run(self) -> Outcome {
        let unreadable =
            |error: RecordingError| Failure::start(format!("{}: {error}", self.file.display()));
        let completed = complete(&self.file);
        if let Err(error) = &completed {
            eprintln!("sarrus replay: the last records of its server may be missing: {error}");
        }
        let mut recording = open(&self.file).map_err(unreadable)?;
        // faults of a recorded robot are this program's: the recording server read it without
        let loaded =
            self.load(recording.robot()).map_err(|error| Failure { code: 2, ..error.into() })?;
        let mut progress = Progress::new();
        let show = |done| progress.show("computing again", done);
        let replayed = replay(&mut recording, &loaded.compiled.model, show).map_err(unreadable)?;
        let code = u8::from(!replayed.is_same() || completed.is_err());
        Ok(Results { text: self.format.render(&replayed, in_words), code })
    }

    fn load(&self, recorded: &RecordedRobot) -> Result<Loaded, LoadError> {
        match (&self.robot, self.urdf_file.as_ref().or(self.urdf.as_ref())) {
            (Some(name), _) => recorded.load_as(&Source::Bundled(name.clone())),
            (None, Some(urdf)) => recorded.load_as(&Source::Files {
                urdf: urdf.clone(),
                submechanisms: self.submechanisms_file.clone().or(self.submechanisms.clone()),
            }),
            (None, None) => recorded.load(),
        }
    }
}

fn open(path: &Path) -> Result<Recording<File>, RecordingError> {
    // opening a pipe would block, and a folder has no end to seek
    match std::fs::metadata(path)?.is_file() {
        true => Recording::open(File::open(path)?),
        false => Err(RecordingError::Foreign),
    }
}

fn in_words(replayed: &Replayed) -> String {
    let Replayed { requests, seconds, asked_seconds, clients, lost, damaged, .. } = replayed;
    let Replayed { refused, unplanned, differing_answers, differing_bits, .. } = replayed;
    let mut text = format!("requests {requests} in {seconds:.3} s, clients {clients}\n");
    let statuses = replayed.statuses.iter().map(|(status, n)| format!("{status} {n}"));
    text += &format!("statuses {}\n", statuses.collect::<Vec<_>>().join(", "));
    text += &format!("lost {lost}, damaged {damaged}, refused {refused}, unplanned {unplanned}\n");
    text += &format!("differing answers {differing_answers}, differing bits {differing_bits}\n");
    if replayed.overwritten && *seconds < *asked_seconds as f64 {
        text += &format!(
            "shorter than the {asked_seconds} s that were to be kept: larger or more \
             frequent requests than the file has room for\n"
        );
    }
    if replayed.cut_off {
        text += "the last record was cut off while it was written\n";
    }
    if replayed.differences.is_empty() {
        return text;
    }
    let row = |found: &Difference| {
        vec![
            format!("{:.6}", found.time),
            found.client.clone(),
            found.sequence.to_string(),
            found.plan.to_string(),
            found.field.clone(),
            found.recorded.clone(),
            found.computed.clone(),
        ]
    };
    let rows: Vec<Vec<String>> = replayed.differences.iter().map(row).collect();
    text + &table("time | client | sequence | plan | field | recorded | computed", &rows)
}
