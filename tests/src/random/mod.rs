//! Random robots as text, from a seed: what they are made of, and how far they can move.

mod mechanisms;
mod planar;
mod platforms;
mod spatial;
mod writer;

use sarrus_models::{LoadError, Loaded, Options, Source, load};

use crate::seed::Seeded;
use writer::Writer;

/// Four-bars, slider-cranks and legs on arms are declared by their own types, else NUMERICAL.
pub const NEW_TYPES: bool = true;
/// Couplers may hang between two ball joints.
pub const SPINNING: bool = false;
/// Joints have damping, springs and rotors now and then.
pub const TERMS: bool = true;
/// Chains hold ball joints now and then.
pub const BALLS: bool = true;

/// A robot as its files hold it.
#[derive(Clone, Debug)]
pub struct Text {
    /// URDF.
    pub urdf: String,
    /// Submechanism YAML.
    pub yaml: String,
    /// What the robot holds.
    pub holds: String,
    /// How far each independent joint may be moved from zero without nearing a singularity, by
    /// name.
    pub reach: Vec<(String, f64)>,
    /// Each mechanism has as many actuators as independent joints.
    pub square: bool,
    /// Numbers stand to six decimals, as in files that people write.
    pub rounded: bool,
    /// The unit in which its lengths are of the order of 1 `[m]`.
    pub scale: f64,
}

impl Text {
    /// Files that someone wrote.
    pub fn of(urdf: &str, yaml: &str) -> Text {
        let (urdf, yaml, holds) = (urdf.to_owned(), yaml.to_owned(), "files".to_owned());
        Text { urdf, yaml, holds, reach: Vec::new(), square: true, rounded: false, scale: 0.3 }
    }

    /// Reads and compiles it.
    pub fn load(&self, options: &Options) -> Result<Loaded, LoadError> {
        let (urdf, submechanisms) =
            (self.urdf.clone().into_bytes(), Some(self.yaml.clone().into_bytes()));
        load(&Source::Text { urdf, submechanisms }, options)
    }
}

/// The robot of a seed.
pub fn random_robot(seed: u64) -> Text {
    write(seed, false)
}

/// The same robot with every closed form declared NUMERICAL; `None` where it has none.
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
