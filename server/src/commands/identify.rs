//! `sarrus identify`: masses, inertias and friction from a motion.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use sarrus_identify::{Estimate, IdentifyError, Log, identify};
use sarrus_models::{Loaded, texts, with_inertials};

use super::output::{Failure, FormatFlag, Outcome, Results, write};
use super::robot::RobotFlags;
use super::table::table;

/// Flags of `identify`.
#[derive(Args)]
#[command(override_usage = "sarrus identify [OPTIONS] <LOG> <--robot <NAME>|FILE.urdf> [FILE]")]
pub(crate) struct Identify {
    /// A table with the columns that `sarrus time` writes: t, independent joints by name, NAME/yd,
    /// NAME/ydd, ACTUATOR/tau_u. Without NAME/ydd rates come from cubics through the positions.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    robot: RobotFlags,
    /// The URDF to write: the robot's with the new masses and inertias, all other bytes unchanged.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Identify {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let Loaded { description, compiled, .. } = &loaded;
        let (lines, rows, heads) = table(&self.log)?;
        let file = self.log.display();
        let log = Log::of_table(&compiled.model, &heads, &rows)
            .map_err(|error| Failure::start(format!("{file}: {error}")))?;
        let estimate =
            identify(description, &compiled.model, &log).map_err(|error| match error {
                IdentifyError::Sample { row, status } if log.samples.len() == lines.len() => {
                    Failure::finding(format!("{file}:{}: the state is {status}", lines[row]))
                }
                error => Failure::finding(format!("{file}: {error}")),
            })?;
        if let Some(path) = &self.out {
            let (urdf, _) = texts(&self.robot.source())?;
            let links: Vec<_> =
                estimate.links.iter().map(|link| (link.name.as_str(), link.inertial)).collect();
            let text = String::from_utf8(urdf).map_err(Failure::start)?;
            let text = with_inertials(&text, &links).map_err(Failure::start)?;
            write(path, text)?;
        }
        let text = self.format.render(&estimate.to_json(), |_| words(&estimate));
        Ok(Results { text, code: 0 })
    }
}

fn words(estimate: &Estimate) -> String {
    let mut text = String::new();
    let of = &estimate.prediction;
    let sum = |combination: &[(usize, f64)]| {
        let part = |(k, (j, x)): (usize, &(usize, f64))| {
            let name = &estimate.names[*j];
            match k {
                0 => name.clone(),
                _ => format!(" {} {:.4} {name}", if *x < 0.0 { '-' } else { '+' }, x.abs()),
            }
        };
        combination.iter().enumerate().map(part).collect::<String>()
    };
    // writing to text cannot fail
    let excited = estimate.base.iter().filter_map(|of| Some((of, of.standard_error?)));
    let _ = writeln!(text, "{:>12} {:>12} {:>12}  base parameter", "estimate", "error", "model");
    for (of, error) in excited {
        let parts = sum(&of.combination);
        let _ = writeln!(text, "{:>12.5} {error:>12.2e} {:>12.5}  {parts}", of.value, of.model);
    }
    for of in estimate.base.iter().filter(|of| of.standard_error.is_none()) {
        let _ = writeln!(text, "not excited: {}", sum(&of.combination));
    }
    let _ = writeln!(
        text,
        "condition {:.1}; forces left over, in units of their noise: model {:.3}, base parameters \
         {:.3}, of parts that were held out {:.3}, physical links {:.3}",
        estimate.condition, of.model, of.fitted, of.held_out, of.physical
    );
    text
}
