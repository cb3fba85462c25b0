//! `sarrus check`.

mod assembled;
mod closures;
mod corpus;
mod dimensions;
mod plan;
mod pose;

use std::path::PathBuf;

use clap::Args;
use sarrus_models::{CheckReport, Suggestion, assemble, suggest};

use super::output::{Failure, FormatFlag, Outcome, Results};
use super::robot::{RobotFlags, diagnostics, notes};
use pose::Numbers;

/// Flags of `check`.
#[derive(Args)]
#[command(after_long_help = closures::LEGEND)]
// a corpus is a source of robots too
#[command(mut_group("SourceFlags", |group| group.arg("corpus")))]
pub(crate) struct Check {
    #[command(flatten)]
    robot: RobotFlags,
    #[command(flatten)]
    format: FormatFlag,
    /// Find a closed pose near the given one and print it; also for files whose loops are open at
    /// the zero pose.
    #[arg(long, conflicts_with_all = ["lock", "only"])]
    assemble: bool,
    /// The pose: q=X,Y,… in the order of `tree_q`, NAME=X,… (zero elsewhere), or a JSON file: a
    /// list, an object by name, or one with a `q`. Default: the zero pose.
    #[arg(long, value_name = "FILE|q=…", requires = "assemble", allow_hyphen_values = true)]
    near: Option<Numbers>,
    /// Cost of each joint's motion: NAME=W,… (1 elsewhere), W,W,… in the order of `tree`, or a JSON
    /// file. 0: free, inf: kept fixed.
    #[arg(long, value_name = "FILE|NAME=W,…", requires = "assemble", allow_hyphen_values = true)]
    weights: Option<Numbers>,
    /// Print a submechanism file instead: independents that determine every joint, and the types
    /// whose closed forms fit; also for files whose independents or types are wrong or missing.
    #[arg(long, conflicts_with_all = ["assemble", "lock", "only"])]
    suggest: bool,
    /// Print the plan of a request: steps, bodies and clusters out of the robot's, operations,
    /// nanoseconds, bytes. LINE is one of `ask` with its request:
    /// '{"request": "kinematics", "y": […], "want": ["q"]}'.
    #[arg(long, value_name = "LINE", conflicts_with_all = ["assemble", "suggest"])]
    plan: Option<String>,
    /// Write the files with the found pose as their zero pose: the URDF here, and where cuts need
    /// placements the submechanisms beside it with the ending yml. All else stays byte for byte.
    #[arg(long, value_name = "OUT.urdf", requires = "assemble")]
    write: Option<PathBuf>,
    /// In place of a robot: one line for each below DIR, with the submechanism file of its name
    /// where there is one: ok, lenient or refused, with the first fault. Ends with 1 if one is
    /// refused.
    #[arg(long, value_name = "DIR", exclusive = true)]
    corpus: Option<PathBuf>,
}

impl Check {
    pub(crate) fn run(self) -> Outcome {
        if let Some(folder) = &self.corpus {
            return corpus::check(folder);
        }
        if self.suggest {
            return self.suggestion();
        }
        if let Some(line) = &self.plan {
            return self.plan_report(line);
        }
        let mut report = match self.assemble {
            true => self.assembled()?,
            false => {
                let loaded = self.robot.load();
                let conversion = loaded.as_ref().map_or(&[][..], |loaded| &loaded.report.notes);
                eprint!("{}", notes(conversion));
                CheckReport::new(&loaded)?
            }
        };
        self.write_files(&mut report).map_err(Failure::start)?;
        let failure = report.assembled.as_ref().and_then(|assembly| assembly.error.as_ref());
        if let Some(failure) = failure {
            eprintln!("sarrus check: {failure}");
        }
        let code = u8::from(!report.errors.is_empty() || failure.is_some());
        let text = self.format.render(&report, |report| match report.errors.as_slice() {
            [] => in_words(report),
            errors => {
                diagnostics(errors, &report.warnings)
                    + &report.assembled.as_ref().map(assembled::in_words).unwrap_or_default()
            }
        });
        Ok(Results { text, code })
    }

    /// A submechanism file on stdout, and its remaining faults on stderr.
    fn suggestion(&self) -> Outcome {
        let Suggestion { yaml, report, .. } = suggest(&self.robot.source(), &self.robot.options())?;
        eprint!("{}", diagnostics(&report.errors, &report.warnings));
        let value = serde_json::json!({ "suggestion": yaml });
        let text = self.format.render(&value, |_| yaml);
        Ok(Results { text, code: u8::from(!report.errors.is_empty()) })
    }

    /// Writes the files of the assembled pose, where `--write` asks for them.
    fn write_files(&self, report: &mut CheckReport) -> Result<(), String> {
        let Some(assembled) = report.assembled.as_mut().filter(|_| report.errors.is_empty()) else {
            return Ok(());
        };
        let Some((out, zero)) = self.write.as_ref().zip(assembled.zero.as_ref()) else {
            return Ok(());
        };
        let files = zero
            .write(&self.robot.source(), &self.robot.options())
            .map_err(|error| error.to_string())?
            .map_err(|why| format!("{why}; write the origins and placements by hand"))?;
        let beside = files.submechanisms.map(|text| (out.with_extension("yml"), text));
        for (file, text) in [(out.clone(), files.urdf)].into_iter().chain(beside) {
            std::fs::write(&file, text)
                .map_err(|error| format!("cannot write {}: {error}", file.display()))?;
            assembled.written.push(file.display().to_string());
        }
        Ok(())
    }

    /// The report with an assembly.
    fn assembled(&self) -> Result<CheckReport, Failure> {
        let near = |names: &[String], zero: Vec<f64>| match &self.near {
            Some(near) => near.resolve(names, zero),
            None => Ok(zero),
        };
        let weights = |names: &[String]| {
            let ones = vec![1.0; names.len()];
            let Some(flag) = &self.weights else { return Ok(ones) };
            let weights = flag.resolve(names, ones)?;
            match weights.iter().zip(names).find(|(weight, _)| **weight < 0.0) {
                Some((weight, name)) => {
                    Err(flag.fault(&format!("weight {weight} of {name}, expected 0 or more")))
                }
                None => Ok(weights),
            }
        };
        assemble(&self.robot.source(), &self.robot.options(), near, weights)?
    }
}

/// A valid robot: its name, its coordinates in their order, its closures and its warnings.
fn in_words(report: &CheckReport) -> String {
    let mut text = format!("robot        {}\n", report.robot.as_deref().unwrap_or_default());
    text += &format!(
        "fingerprint  {}\n\n",
        report.fingerprint.as_deref().unwrap_or("none, the files are open at zero")
    );
    if let Some(model) = &report.model {
        text += &names("tree", &model.tree);
        if model.tree_q.len() != model.tree.len() {
            text += &names("tree q", &model.tree_q);
        }
        text += &names("independent", &model.independent);
        text += &names("active", &model.active);
        text += &names("loop rows", &model.loops);
    }

    if !report.closures.is_empty() {
        text += "\n";
        text += &closures::in_words(&report.closures);
        text += "\n";
        text += closures::LEGEND;
    }
    if let Some(bound) = &report.bound {
        let us = bound.ns / 1e3;
        text += &format!("\nbound        {} Newton steps, {us:.0} µs a state\n", bound.steps);
    }
    if let Some(dimensions) = &report.dimensions {
        text += &dimensions::in_words(dimensions);
    }
    if let Some(assembled) = &report.assembled {
        text += "\n";
        text += &assembled::in_words(assembled);
    }
    text += "\n";
    text += &match report.warnings.len() {
        0 => "valid, no warnings\n".to_owned(),
        1 => "valid, 1 warning\n".to_owned(),
        n => format!("valid, {n} warnings\n"),
    };
    text + &diagnostics(&[], &report.warnings)
}

/// The number of names and the names, in lines of at most a hundred letters.
fn names(label: &str, names: &[String]) -> String {
    const WIDTH: usize = 84;
    let mut text = format!("{label:<11}  {:>4} ", names.len());
    let mut width = 0;
    for name in names {
        let length = name.chars().count() + 1;
        if width > 0 && width + length > WIDTH {
            text += &format!("\n{:18}", "");
            width = 0;
        }
        text += " ";
        text += name;
        width += length;
    }
    text.trim_end().to_owned() + "\n"
}
