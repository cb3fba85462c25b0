//! `sarrus identify`: masses, inertias and friction from a motion; `sarrus calibrate`: geometry
//! from redundant encoders.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use sarrus_identify::{Calibration, Estimate, IdentifyError, Log, calibrate, identify};
use sarrus_models::{Loaded, NewZero, texts, with_inertials};

use super::output::{Failure, FormatFlag, Outcome, Results, write};
use super::robot::RobotFlags;
use super::table::table;

/// Flags of `identify` and `calibrate`.
#[derive(Args)]
#[command(override_usage = "sarrus identify|calibrate [OPTIONS] <LOG> <--robot <NAME>|FILE.urdf> \
                            [FILE]")]
pub(crate) struct Identify {
    /// A table with a head. `identify`: the columns that `sarrus time` writes, t, independent
    /// joints by name, NAME/yd, NAME/ydd, ACTUATOR/tau_u; without NAME/ydd rates come from cubics
    /// through the positions. `calibrate`: independent joints, and dependent ones with an encoder.
    #[arg(value_name = "LOG")]
    log: PathBuf,
    #[command(flatten)]
    robot: RobotFlags,
    /// The URDF to write: the robot's with the new numbers, all other bytes unchanged. `calibrate`
    /// writes the submechanisms beside it, with the ending yml.
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
            if !estimate.prediction.physical.is_finite() {
                let error = IdentifyError::Unexplained;
                return Err(Failure::finding(format!("{file}: {error}")));
            }
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

    pub(crate) fn calibrate(self) -> Outcome {
        let Loaded { description, .. } = self.robot.load_and_warn()?;
        let (_, rows, heads) = table(&self.log)?;
        let failed = |error| Failure::finding(format!("{}: {error}", self.log.display()));
        let found = calibrate(&description, &heads, &rows).map_err(failed)?;
        if let Some(path) = &self.out {
            let of_type = description.submechanisms.iter().zip(&found.description.submechanisms);
            if let Some((of, _)) = of_type.clone().find(|(a, b)| a.loops.len() != b.loops.len()) {
                let words = format!("the type of {} defines its loops: give it", of.name);
                return Err(Failure::finding(format!("{words} loop_constraints and NUMERICAL")));
            }
            let zero = NewZero { old: description, new: found.description.clone() };
            let files = zero.write(&self.robot.source(), &self.robot.options())?;
            let files = files.map_err(Failure::finding)?;
            write(path, files.urdf)?;
            if let Some(text) = files.submechanisms {
                write(&path.with_extension("yml"), text)?;
            }
        }
        let text = self.format.render(&found.to_json(), |_| calibrated(&found));
        Ok(Results { text, code: 0 })
    }
}

fn calibrated(found: &Calibration) -> String {
    let mut text = format!("{:>12} {:>12}  parameter\n", "estimate", "error");
    let mut hidden = Vec::new();
    for of in &found.parameters {
        match of.standard_error {
            // writing to text cannot fail
            Some(error) => {
                let _ = writeln!(text, "{:>12.4e} {error:>12.2e}  {}", of.value, of.name);
            }
            None => hidden.push(&of.name[..]),
        }
    }
    let [model, fitted] = found.noise;
    let _ = writeln!(text, "not identifiable: {}", hidden.join(", "));
    let _ = writeln!(text, "noise of an encoder: {model:.3e} by the model, {fitted:.3e} now");
    text
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
