//! `sarrus capability`: force, speed and inertia that the motors have at the joints.

use std::path::PathBuf;

use clap::Args;
use sarrus_show::{CapabilityError, Choices, capability, capability_page};

use super::output::{Failure, Outcome, Results, write};
use super::progress::Progress;
use super::robot::RobotFlags;

/// Flags of `capability`.
#[derive(Args)]
pub(crate) struct Capability {
    #[command(flatten)]
    robot: RobotFlags,
    /// Names or patterns of independent joints, with commas between them; without them each
    /// submechanism by itself.
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    joints: Vec<String>,
    /// Points along each coordinate; the default has at most 20000 of them altogether.
    #[arg(long, value_name = "N")]
    grid: Option<usize>,
    /// A line such as {"y": [0, 0.1]}: where the joints stand that the map does not move.
    #[arg(long, value_name = "LINE")]
    at: Option<String>,
    /// Writes a page (.html), a table (.csv) or JSON (any other ending) and prints its path;
    /// without it JSON goes to stdout.
    #[arg(long, value_name = "PAGE")]
    out: Option<PathBuf>,
}

impl Capability {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let choices = Choices { joints: self.joints, grid: self.grid, at: at(self.at.as_deref())? };
        let mut progress = Progress::new();
        let maps = capability(&loaded, &choices, &mut |done| progress.show("points", done));
        drop(progress);
        let maps = maps.map_err(|error| match error {
            CapabilityError::Query(_) => Failure::finding(error),
            _ => Failure::start(error),
        })?;
        for map in &maps {
            if !map.no_limit.is_empty() {
                eprintln!(
                    "warning: {}: no limit of force or speed: {}",
                    map.name,
                    map.no_limit.join(", ")
                );
            }
        }
        let json = || maps.iter().map(|map| map.to_json().to_string() + "\n").collect::<String>();
        let Some(path) = self.out else { return Ok(Results { text: json(), code: 0 }) };
        let ending = path.extension().and_then(|ending| ending.to_str());
        let text = match ending {
            Some("html") => capability_page(loaded.compiled.model.name(), &maps),
            Some("csv") => maps.iter().map(|map| map.to_csv()).collect::<Vec<_>>().join("\n"),
            _ => json(),
        };
        write(&path, text)?;
        Ok(Results { text: format!("{}\n", path.display()), code: 0 })
    }
}

/// The independents of a line.
fn at(line: Option<&str>) -> Result<Option<Vec<f64>>, Failure> {
    let Some(line) = line else { return Ok(None) };
    let value: Option<serde_json::Value> = serde_json::from_str(line).ok();
    let y = value.as_ref().and_then(|value| value.get("y")?.as_array());
    let numbers: Option<Vec<f64>> = y.and_then(|y| y.iter().map(|x| x.as_f64()).collect());
    match numbers {
        Some(numbers) => Ok(Some(numbers)),
        None => Err(Failure::start("--at is no line with y, expected such as {\"y\": [0, 0.1]}")),
    }
}
