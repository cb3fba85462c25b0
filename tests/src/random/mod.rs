//! Random robots as text, drawn from a seed, with the mechanisms that they contain and the reach of
//! their independent joints.

mod mechanisms;
mod planar;
mod platforms;
mod spatial;
mod writer;

use sarrus_models::{LoadError, Loaded, Options, Source, load};

use crate::seed::Seeded;
use writer::Writer;

/// Four-bars, slider-cranks and legs on arms are declared by their own types; otherwise NUMERICAL.
pub const NEW_TYPES: bool = true;
/// A coupler may hang between two ball joints.
pub const SPINNING: bool = false;
/// Some joints have damping, springs and rotors.
pub const TERMS: bool = true;
/// Some chains hold ball joints.
pub const BALLS: bool = true;

/// A robot in the text of its files.
#[derive(Clone, Debug)]
pub struct Text {
    /// URDF.
    pub urdf: String,
    /// Submechanism YAML.
    pub yaml: String,
    /// The mechanisms that the robot contains.
    pub holds: String,
    /// Largest distance of each independent joint from zero, by name, that stays clear of
    /// singularities.
    pub reach: Vec<(String, f64)>,
    /// Each mechanism has as many actuators as independent joints.
    pub square: bool,
    /// Numbers have six decimals, as in files written by hand.
    pub rounded: bool,
    /// Unit of length in which the robot's lengths are about 1 `[m]`.
    pub scale: f64,
}

impl Text {
    /// A robot of given files.
    pub fn of(urdf: &str, yaml: &str) -> Text {
        let urdf = urdf.to_owned();
        let yaml = yaml.to_owned();
        let holds = "files".to_owned();
        Text { urdf, yaml, holds, reach: Vec::new(), square: true, rounded: false, scale: 0.3 }
    }

    /// Reads and compiles the robot.
    pub fn load(&self, options: &Options) -> Result<Loaded, LoadError> {
        let urdf = self.urdf.clone().into_bytes();
        let submechanisms = Some(self.yaml.clone().into_bytes());
        load(&Source::Text { urdf, submechanisms }, options)
    }
}

/// Draws the robot of a seed.
pub fn random_robot(seed: u64) -> Text {
    write(seed, false)
}

/// [`random_robot`] with every closed form declared NUMERICAL; `None` if it has none.
pub fn random_robot_numerical(seed: u64) -> Option<Text> {
    let text = write(seed, true);
    (text.yaml != write(seed, false).yaml).then_some(text)
}

fn write(seed: u64, numerical: bool) -> Text {
    let mut seeded = Seeded::new(seed);
    let scale = match seed % 20 {
        17 => 1e-3,
        18 => 1e3,
        _ => 10f64.powf(seeded.within(-1.0, 0.0)),
    };
    let rounded = seed % 7 == 3;
    let mut writer = Writer::new(seeded, scale, rounded, numerical);
    if writer.seeded.chance(0.25) {
        writer.floating_base();
    }
    for _ in 0..1 + writer.seeded.below(4) {
        writer.mechanism();
    }
    writer.finish(seed)
}
