//! `sarrus show`: a robot as a page.

use std::path::PathBuf;

use clap::Args;
use sarrus_show::{Settings, page};

use super::output::{Failure, Outcome, Results};
use super::robot::RobotFlags;

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
}

impl Show {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let settings = Settings::new(&self.robot.source(), &self.robot.options(), self.swing);
        let text = page(&loaded, &settings).map_err(Failure::finding)?;
        // a name in a file leads to no other folder
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let name = || loaded.compiled.model.name().chars().map(plain).collect::<String>();
        let usual = || PathBuf::from(name() + ".html");
        let path = self.out.unwrap_or_else(usual);
        let failed =
            |error| Failure::start(format!("{} cannot be written: {error}", path.display()));
        std::fs::write(&path, text).map_err(failed)?;
        Ok(Results { text: format!("{}\n", path.display()), code: 0 })
    }
}
