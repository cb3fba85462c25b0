//! The flags that choose a robot.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, Args, Command};
use sarrus_client::{LoadError, Options, Source};
use sarrus_models::{
    Base, CheckReport, Diagnostic, Loaded, Lock, NewZero, Rewritten, Suggestion, assemble, bundled,
    load, suggest,
};
use sarrus_server::record::RecordedRobot;

/// Which robot, and how its files are read.
#[derive(Args)]
pub(crate) struct RobotFlags {
    #[command(flatten)]
    source: SourceFlags,
    /// Submechanism file that goes with --urdf; without it every joint is independent and active.
    #[arg(long, value_name = "FILE", conflicts_with = "robot")]
    submechanisms: Option<PathBuf>,
    /// Gravity in root axes, m/s².
    #[arg(
        long,
        value_name = "X,Y,Z",
        value_parser = gravity,
        default_value = "0,0,-9.81",
        allow_hyphen_values = true
    )]
    gravity: Gravity,
    /// Faults of mass and inertia are warnings.
    #[arg(long)]
    lenient: bool,
    /// The root link hangs on the world by a free joint without actuator, `floating_base`: six
    /// coordinates before all others. LINK, if given, must be the root.
    #[arg(long, value_name = "LINK", num_args = 0..=1, default_missing_value = "")]
    floating_base: Option<String>,
    /// Holds a joint still at VALUE, m or rad; without it where it is at the zero pose. A name as
    /// shells write patterns (`AL*`) stands for all independent joints that it fits. Bodies that do
    /// not move against each other are merged, loops that became rigid are gone. May be given
    /// several times.
    #[arg(long, value_name = "JOINT[=VALUE]", allow_hyphen_values = true)]
    lock: Vec<Lock>,
    /// Keeps the links that are named (patterns as in --lock) with the joints and mechanisms
    /// between them and the root, and what is fixed to these links. All other branches are left out
    /// with their mass: forces are those of the robot without them. May be given several times.
    #[arg(long, value_name = "LINK")]
    only: Vec<String>,
}

#[derive(Args)]
#[group(required = true, multiple = false)]
struct SourceFlags {
    /// A bundled robot.
    #[arg(long, value_name = "NAME", value_parser = RobotName, hide_possible_values = true)]
    robot: Option<String>,
    /// A URDF file, or a SMURF file that names one.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
}

/// Any name is taken, and the loader says what is wrong with it; shells offer the bundled ones.
#[derive(Clone)]
struct RobotName;

impl TypedValueParser for RobotName {
    type Value = String;

    fn parse_ref(
        &self,
        command: &Command,
        flag: Option<&Arg>,
        value: &OsStr,
    ) -> Result<String, clap::Error> {
        StringValueParser::new().parse_ref(command, flag, value)
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(bundled().map(|(name, _)| PossibleValue::new(name))))
    }
}

#[derive(Clone, Copy)]
struct Gravity([f64; 3]);

fn gravity(text: &str) -> Result<Gravity, String> {
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse().unwrap_or(f64::NAN)).collect();
    match numbers.as_slice().try_into() {
        Ok(gravity) if numbers.iter().all(|number| number.is_finite()) => Ok(Gravity(gravity)),
        _ => Err("expected three numbers such as 0,0,-9.81".to_owned()),
    }
}

impl RobotFlags {
    /// Takes files that were named without flags.
    pub(crate) fn add_files(&mut self, urdf: Option<PathBuf>, submechanisms: Option<PathBuf>) {
        self.source.urdf = urdf.or(self.source.urdf.take());
        self.submechanisms = submechanisms.or(self.submechanisms.take());
    }

    /// Reads and compiles the robot.
    pub(crate) fn load(&self) -> Result<Loaded, LoadError> {
        load(&self.source(), &self.options())
    }

    /// As [`RobotFlags::load`]; warnings of the files go to stderr.
    pub(crate) fn load_and_warn(&self) -> Result<Loaded, LoadError> {
        self.load().inspect(|loaded| warn(&loaded.report.warnings))
    }

    /// Reads the robot and closes it near a pose; see [`sarrus_models::assemble`].
    pub(crate) fn assemble<E>(
        &self,
        near: impl FnOnce(&[String], Vec<f64>) -> Result<Vec<f64>, E>,
        weights: impl FnOnce(&[String]) -> Result<Vec<f64>, E>,
    ) -> Result<Result<CheckReport, E>, LoadError> {
        assemble(&self.source(), &self.options(), near, weights)
    }

    /// A submechanism file that fits the robot; see [`sarrus_models::suggest`].
    pub(crate) fn suggest(&self) -> Result<Suggestion, LoadError> {
        suggest(&self.source(), &self.options())
    }

    /// The robot's texts with another zero pose; in words what cannot be written.
    pub(crate) fn rewritten(&self, zero: &NewZero) -> Result<Result<Rewritten, String>, LoadError> {
        zero.write(&self.source(), &self.options())
    }

    /// The robot's texts, for a recording.
    pub(crate) fn recorded(&self) -> Result<RecordedRobot, LoadError> {
        RecordedRobot::new(&self.source(), &self.options())
    }

    fn source(&self) -> Source {
        match (&self.source.robot, &self.source.urdf) {
            (Some(name), _) => Source::Bundled(name.clone()),
            (None, urdf) => Source::Files {
                urdf: urdf.clone().unwrap_or_default(),
                submechanisms: self.submechanisms.clone(),
            },
        }
    }

    fn options(&self) -> Options {
        let base = Base::of_flag(self.floating_base.as_deref());
        Options {
            gravity: self.gravity.0,
            lenient: self.lenient,
            base,
            lock: self.lock.clone(),
            only: self.only.clone(),
        }
    }
}

/// Says on stderr why a robot cannot be loaded: the report of `check` for faulty files; the exit
/// code that goes with it.
pub(crate) fn refuse(command: &str, error: &LoadError) -> ExitCode {
    match error {
        LoadError::Faults(report) => {
            eprint!("{}", diagnostics(&report.errors, &report.warnings));
            ExitCode::from(1)
        }
        other => {
            eprintln!("sarrus {command}: {other}");
            ExitCode::from(2)
        }
    }
}

/// Prints the warnings of a robot that loaded to stderr.
pub(crate) fn warn(warnings: &[Diagnostic]) {
    eprint!("{}", diagnostics(&[], warnings));
}

/// One diagnostic a line, its position first.
pub(crate) fn diagnostics(errors: &[Diagnostic], warnings: &[Diagnostic]) -> String {
    let warning = |diagnostic: &Diagnostic| diagnostic.as_warning() + "\n";
    errors.iter().map(|error| format!("{error}\n")).chain(warnings.iter().map(warning)).collect()
}
