//! `sarrus show`: a robot as a page.

use std::path::PathBuf;

use clap::Args;
use sarrus_show::{Meshes, Settings, page};

use super::output::{Failure, Outcome, Results, file_name, write};
use super::robot::RobotFlags;
use super::{Choices, choice};

/// Flags of `show`.
#[derive(Args)]
pub(crate) struct Show {
    #[command(flatten)]
    robot: RobotFlags,
    /// The page; the default is the robot's name with the ending html, here.
    #[arg(long, value_name = "PAGE")]
    out: Option<PathBuf>,
    /// The robot swings as soon as the page opens.
    #[arg(long)]
    swing: bool,
    /// Shapes that the URDF draws.
    #[arg(long, value_parser = choice(&MESHES), value_name = "CHOICE", default_value = "all")]
    meshes: Meshes,
}

const MESHES: Choices<Meshes, 3> = [
    (Meshes::None, "none", "None"),
    (Meshes::Hull, "hull", "Boxes, cylinders, spheres, and hulls of meshes"),
    (Meshes::All, "all", "Meshes too, and the hulls of those that would make the page too long"),
];

impl Show {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let settings = Settings::new(&self.robot.source(), &self.robot.options(), self.swing);
        let settings = Settings { meshes: self.meshes, ..settings };
        let text = page(&loaded, &settings).map_err(Failure::finding)?;
        let usual = || PathBuf::from(file_name(loaded.compiled.model.name()) + ".html");
        let path = self.out.unwrap_or_else(usual);
        write(&path, text)?;
        Ok(Results { text: format!("{}\n", path.display()), code: 0 })
    }
}
