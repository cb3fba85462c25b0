//! `sarrus replay`.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use sarrus_client::{LoadError, Source};
use sarrus_models::Loaded;
use sarrus_server::record::{RecordedRobot, Recording, RecordingError, Replayed, replay};

use super::output::{Format, FormatFlag, finish, json_line, table};
use super::progress::Progress;
use super::robot::refuse;

/// Flags of `replay`.
#[derive(Args)]
pub(crate) struct Replay {
    /// What `sarrus serve --record` wrote; it may still be writing.
    file: PathBuf,
    /// A bundled robot instead of the one in the file.
    #[arg(long, value_name = "NAME")]
    robot: Option<String>,
    /// A URDF file, or a SMURF file that names one, instead of the robot in the file.
    #[arg(long, value_name = "FILE", conflicts_with = "robot")]
    urdf: Option<PathBuf>,
    /// Submechanism file that goes with --urdf.
    #[arg(long, value_name = "FILE", requires = "urdf")]
    submechanisms: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Replay {
    pub(crate) fn run(self) -> ExitCode {
        let unreadable = |error: &RecordingError| {
            eprintln!("sarrus replay: {}: {error}", self.file.display());
            ExitCode::from(2)
        };
        let mut recording = match open(&self.file) {
            Ok(recording) => recording,
            Err(error) => return unreadable(&error),
        };
        let loaded = match self.load(recording.robot()) {
            Ok(loaded) => loaded,
            // a recording's robot has no faults of its own: this program reads it in another way
            Err(error) => {
                let _ = refuse("replay", &error);
                return ExitCode::from(2);
            }
        };
        let mut progress = Progress::new();
        let show = |done| progress.show("computing again", done);
        let replayed = replay(&mut recording, &loaded.compiled.model, show);
        drop(progress);
        match replayed {
            Ok(replayed) => {
                let results = match self.format.format {
                    Format::Json => json_line(&replayed),
                    Format::Text => in_words(&replayed),
                };
                finish("replay", &results, u8::from(!replayed.is_same()))
            }
            Err(error) => unreadable(&error),
        }
    }

    fn load(&self, recorded: &RecordedRobot) -> Result<Loaded, LoadError> {
        match (&self.robot, &self.urdf) {
            (Some(name), _) => recorded.load_as(&Source::Bundled(name.clone())),
            (None, Some(urdf)) => recorded.load_as(&Source::Files {
                urdf: urdf.clone(),
                submechanisms: self.submechanisms.clone(),
            }),
            (None, None) => recorded.load(),
        }
    }
}

fn open(path: &Path) -> Result<Recording<File>, RecordingError> {
    // a pipe would never open, a folder has no end to look for
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
    if !replayed.differences.is_empty() {
        let rows: Vec<Vec<String>> = replayed
            .differences
            .iter()
            .map(|found| {
                vec![
                    format!("{:.6}", found.time),
                    found.client.clone(),
                    found.sequence.to_string(),
                    found.plan.to_string(),
                    found.field.clone(),
                    found.recorded.clone(),
                    found.computed.clone(),
                ]
            })
            .collect();
        let heads = ["time", "client", "sequence", "plan", "field", "recorded", "computed"];
        text += &table(&heads, &rows);
    }
    text
}
