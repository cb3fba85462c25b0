//! `sarrus check`.

mod assembled;
mod closures;
mod plan;
mod pose;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use sarrus_models::{CheckReport, Suggestion};

use super::output::{Format, FormatFlag, finish, json_line};
use super::robot::{RobotFlags, diagnostics, refuse};
use pose::Numbers;

/// Flags of `check`.
#[derive(Args)]
#[command(after_long_help = closures::LEGEND)]
pub(crate) struct Check {
    /// A URDF file, as --urdf.
    #[arg(value_name = "FILE.urdf", group = "SourceFlags")]
    urdf_file: Option<PathBuf>,
    /// Its submechanism file, as --submechanisms.
    #[arg(value_name = "FILE.yml", requires = "urdf_file", conflicts_with = "submechanisms")]
    submechanisms_file: Option<PathBuf>,
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
    /// What each joint's way costs: NAME=W,… (1 elsewhere), W,W,… in the order of `tree`, or a JSON
    /// file. 0: free, inf: kept fixed.
    #[arg(long, value_name = "FILE|NAME=W,…", requires = "assemble", allow_hyphen_values = true)]
    weights: Option<Numbers>,
    /// Print a submechanism file instead: independents that determine every joint, and the types
    /// whose closed forms fit; also for files whose independents or types are wrong or missing.
    #[arg(long, conflicts_with_all = ["assemble", "lock", "only"])]
    suggest: bool,
    /// Print what the plan of a request does and leaves out: steps, bodies, clusters, operations,
    /// nanoseconds, bytes. LINE is one of `ask` with its request:
    /// '{"request": "kinematics", "y": […], "want": ["q"]}'.
    #[arg(long, value_name = "LINE", conflicts_with_all = ["assemble", "suggest"])]
    plan: Option<String>,
    /// Write the files with the found pose as their zero pose: the URDF here, and where cuts need
    /// placements the submechanisms beside it with the ending yml. All else stays byte for byte.
    #[arg(long, value_name = "OUT.urdf", requires = "assemble")]
    write: Option<PathBuf>,
}

impl Check {
    pub(crate) fn run(mut self) -> ExitCode {
        self.robot.add_files(self.urdf_file.take(), self.submechanisms_file.take());
        if self.suggest {
            return self.suggestion();
        }
        if let Some(line) = &self.plan {
            return self.plan_report(line);
        }
        let report = if self.assemble {
            self.assembled()
        } else {
            CheckReport::new(&self.robot.load()).map_err(|error| refuse("check", &error))
        };
        let mut report = match report {
            Ok(report) => report,
            Err(code) => return code,
        };
        if let Err(error) = self.write_files(&mut report) {
            eprintln!("sarrus check: {error}");
            return ExitCode::from(2);
        }
        let failure = report.assembled.as_ref().and_then(|of| of.error.as_ref());
        if let Some(failure) = failure {
            eprintln!("sarrus check: {failure}");
        }
        let code = if report.errors.is_empty() && failure.is_none() { 0 } else { 1 };
        let results = match self.format.format {
            Format::Json => json_line(&report),
            Format::Text if report.errors.is_empty() => in_words(&report),
            Format::Text => {
                diagnostics(&report.errors, &report.warnings)
                    + &report.assembled.as_ref().map(assembled::in_words).unwrap_or_default()
            }
        };
        finish("check", &results, code)
    }

    /// A submechanism file on stdout, and what is still wrong with it on stderr.
    fn suggestion(&self) -> ExitCode {
        let Suggestion { yaml, report, .. } = match self.robot.suggest() {
            Ok(suggestion) => suggestion,
            Err(error) => return refuse("check", &error),
        };
        eprint!("{}", diagnostics(&report.errors, &report.warnings));
        let results = match self.format.format {
            Format::Json => json_line(&serde_json::json!({ "suggestion": yaml })),
            Format::Text => yaml,
        };
        finish("check", &results, u8::from(!report.errors.is_empty()))
    }

    /// Writes the files of a pose that was found; what cannot be written, in words.
    fn write_files(&self, report: &mut CheckReport) -> Result<(), String> {
        let Some(assembled) = report.assembled.as_mut().filter(|_| report.errors.is_empty()) else {
            return Ok(());
        };
        let Some((out, zero)) = self.write.as_ref().zip(assembled.zero.as_ref()) else {
            return Ok(());
        };
        let files = self
            .robot
            .rewritten(zero)
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

    /// The report with an assembly, or the code of what stands in its way.
    fn assembled(&self) -> Result<CheckReport, ExitCode> {
        let near = |names: &[String], zero: Vec<f64>| {
            self.near.as_ref().map_or(Ok(zero.clone()), |near| near.resolve(names, zero))
        };
        let weights = |names: &[String]| {
            let ones = vec![1.0; names.len()];
            let weights = self
                .weights
                .as_ref()
                .map_or(Ok(ones.clone()), |weights| weights.resolve(names, ones))?;
            match weights.iter().zip(names).find(|(weight, _)| **weight < 0.0) {
                Some((weight, name)) => Err(self
                    .weights
                    .as_ref()
                    .map(|of| of.fault(&format!("weight {weight} of {name}, expected 0 or more")))),
                None => Ok(weights),
            }
        };
        match self.robot.assemble(near, weights) {
            Ok(Ok(report)) => Ok(report),
            Ok(Err(fault)) => {
                let fault = fault.unwrap_or_default();
                eprintln!("sarrus check: {}", fault.words);
                Err(ExitCode::from(fault.code))
            }
            Err(error) => Err(refuse("check", &error)),
        }
    }
}

/// A valid robot: what it is called, what it has and in which order, how it is closed, what is
/// remarkable.
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

/// A count and the names that are counted, in lines of about a hundred letters.
fn names(what: &str, names: &[String]) -> String {
    const WIDTH: usize = 84;
    let mut text = format!("{what:<11}  {:>4} ", names.len());
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
