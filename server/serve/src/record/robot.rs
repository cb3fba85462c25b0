//! The robot inside its recording: the texts of its files and how they are read.

use sarrus_models::{Base, LoadError, Loaded, Lock, Options, Source, load, texts};
use serde::{Deserialize, Serialize};

/// The robot's files and the options of its model, from which the answers can be computed again.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RecordedRobot {
    /// Version of the server.
    pub sarrus: String,
    /// The URDF.
    pub urdf: String,
    /// The submechanisms; without them every joint is independent and active.
    pub submechanisms: Option<String>,
    /// Gravity in root axes `[m/s²]`.
    pub gravity: [f64; 3],
    /// Faults of mass and inertia, and effects that are not modelled, are warnings.
    pub lenient: bool,
    /// The root link of a floating base, empty if not named; none for a fixed base.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floating_base: Option<String>,
    /// Joints that are held still.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lock: Vec<Lock>,
    /// Links to which the robot is reduced; none for the whole robot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub only: Vec<String>,
}

impl RecordedRobot {
    /// The texts of a source.
    ///
    /// # Errors
    /// As [`texts`].
    pub fn new(source: &Source, options: &Options) -> Result<RecordedRobot, LoadError> {
        let (urdf, submechanisms) = texts(source)?;
        // loading the robot has refused text that is not UTF-8
        let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
        Ok(RecordedRobot {
            sarrus: env!("CARGO_PKG_VERSION").to_owned(),
            urdf: text(urdf),
            submechanisms: submechanisms.map(text),
            gravity: options.gravity,
            lenient: options.lenient,
            floating_base: match &options.base {
                Base::Floating => Some(String::new()),
                Base::FloatingAt(link) => Some(link.clone()),
                _ => None,
            },
            lock: options.lock.clone(),
            only: options.only.clone(),
        })
    }

    /// The robot as it was recorded.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load(&self) -> Result<Loaded, LoadError> {
        let bytes = |text: &String| text.clone().into_bytes();
        let submechanisms = self.submechanisms.as_ref().map(bytes);
        self.load_as(&Source::Text { urdf: bytes(&self.urdf), submechanisms })
    }

    /// Another source, read with the options of the recording.
    ///
    /// # Errors
    /// As [`load`].
    pub fn load_as(&self, source: &Source) -> Result<Loaded, LoadError> {
        let base = Base::of_flag(self.floating_base.as_deref());
        let RecordedRobot { gravity, lenient, lock, only, .. } = self;
        let options = Options {
            gravity: *gravity,
            lenient: *lenient,
            base,
            lock: lock.clone(),
            only: only.clone(),
        };
        load(source, &options)
    }
}
