//! The flags that choose a robot.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::str::FromStr;

use clap::builder::{PossibleValue, StringValueParser, TypedValueParser};
use clap::{Arg, Args, Command};
use sarrus_client::{LoadError, Options, Source};
use sarrus_models::{Base, Diagnostic, Loaded, Lock, bundled, load};

/// The choice of a robot, and options for its files.
#[derive(Args)]
pub(crate) struct RobotFlags {
    #[command(flatten)]
    source: SourceFlags,
    /// Its submechanism file, as --submechanisms.
    #[arg(value_name = "FILE.yml", requires = "urdf_file", conflicts_with = "submechanisms")]
    submechanisms_file: Option<PathBuf>,
    /// Submechanism file that goes with --urdf; without it every joint is independent and active.
    #[arg(long, value_name = "FILE", conflicts_with = "robot")]
    submechanisms: Option<PathBuf>,
    /// Gravity in root axes, m/s².
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,-9.81", allow_hyphen_values = true)]
    gravity: Gravity,
    /// Faults of mass and inertia, and effects that are not modelled, are warnings.
    #[arg(long)]
    lenient: bool,
    /// The root link hangs on the world by a free joint without actuator, `floating_base`: six
    /// coordinates before all others. LINK, if given, must be the root.
    #[arg(long, value_name = "LINK", num_args = 0..=1, default_missing_value = "")]
    floating_base: Option<String>,
    /// Holds a joint still at VALUE, m or rad; without VALUE at the zero pose. A shell pattern
    /// (`AL*`) stands for all independent joints that it matches. Bodies without motion against
    /// each other are merged, rigid loops are removed. May be given several times.
    #[arg(long, value_name = "JOINT[=VALUE]", allow_hyphen_values = true)]
    lock: Vec<Lock>,
    /// Keeps the named links (patterns as in --lock), the joints and mechanisms between them and
    /// the root, and the bodies fixed to them. All other branches are left out with their mass:
    /// forces are those of the robot without them. May be given several times.
    #[arg(long, value_name = "LINK")]
    only: Vec<String>,
}

#[derive(Args)]
#[group(required = true, multiple = false)]
struct SourceFlags {
    /// A URDF file, or one of another format, as --urdf.
    #[arg(value_name = "FILE.urdf")]
    urdf_file: Option<PathBuf>,
    /// A bundled robot.
    #[arg(long, value_name = "NAME", value_parser = RobotName, hide_possible_values = true)]
    robot: Option<String>,
    /// A URDF file, a SMURF file that names one, a file of MJCF or SDF, or YAML of Gepetto's tools.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
}

/// Accepts any name, for the loader reports the unknown ones; shells complete the bundled ones.
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

impl FromStr for Gravity {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Gravity, &'static str> {
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|part| part.trim().parse()).collect();
        let gravity = numbers.ok().and_then(|numbers| numbers.try_into().ok());
        gravity
            .filter(|gravity: &[f64; 3]| gravity.iter().all(|number| number.is_finite()))
            .map(Gravity)
            .ok_or("expected three numbers such as 0,0,-9.81")
    }
}

impl RobotFlags {
    /// Reads and compiles the robot.
    pub(crate) fn load(&self) -> Result<Loaded, LoadError> {
        load(&self.source(), &self.options())
    }

    /// As [`RobotFlags::load`]; warnings of the files go to stderr.
    pub(crate) fn load_and_warn(&self) -> Result<Loaded, LoadError> {
        self.load().inspect(|loaded| warn(&loaded.report.warnings))
    }

    /// The robot's files.
    pub(crate) fn source(&self) -> Source {
        let SourceFlags { urdf_file, robot, urdf } = &self.source;
        match robot {
            Some(name) => Source::Bundled(name.clone()),
            None => Source::Files {
                urdf: urdf_file.as_ref().or(urdf.as_ref()).cloned().unwrap_or_default(),
                submechanisms: self
                    .submechanisms_file
                    .as_ref()
                    .or(self.submechanisms.as_ref())
                    .cloned(),
            },
        }
    }

    /// The options of the model.
    pub(crate) fn options(&self) -> Options {
        Options {
            gravity: self.gravity.0,
            lenient: self.lenient,
            base: Base::of_flag(self.floating_base.as_deref()),
            lock: self.lock.clone(),
            only: self.only.clone(),
        }
    }
}

/// Prints the warnings of a robot that loaded to stderr.
pub(crate) fn warn(warnings: &[Diagnostic]) {
    eprint!("{}", diagnostics(&[], warnings));
}

/// The notes of a conversion, likewise.
pub(crate) fn notes(notes: &[Diagnostic]) -> String {
    notes.iter().map(|note| note.as_note() + "\n").collect()
}

/// One diagnostic a line, its position first.
pub(crate) fn diagnostics(errors: &[Diagnostic], warnings: &[Diagnostic]) -> String {
    let warning = |diagnostic: &Diagnostic| diagnostic.as_warning() + "\n";
    errors.iter().map(|error| format!("{error}\n")).chain(warnings.iter().map(warning)).collect()
}
