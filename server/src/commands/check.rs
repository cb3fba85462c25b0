//! `sarrus check`.

use std::process::ExitCode;

use clap::Args;
use sarrus_models::CheckReport;

use super::output::{Format, FormatFlag, finish, json_line, table};
use super::robot::{RobotFlags, findings, refuse};

/// Flags of `check`.
#[derive(Args)]
pub(crate) struct Check {
    #[command(flatten)]
    robot: RobotFlags,
    #[command(flatten)]
    format: FormatFlag,
}

impl Check {
    pub(crate) fn run(self) -> ExitCode {
        let report = match CheckReport::new(&self.robot.load()) {
            Ok(report) => report,
            Err(error) => return refuse("check", &error),
        };
        let code = if report.errors.is_empty() { 0 } else { 1 };
        let results = match self.format.format {
            Format::Json => json_line(&report),
            Format::Text if code == 0 => in_words(&report),
            Format::Text => findings(&report.errors, &report.warnings),
        };
        finish("check", &results, code)
    }
}

/// A valid robot: what it is called, what it has and in which order, how it is closed, what is remarkable.
fn in_words(report: &CheckReport) -> String {
    let mut text = format!("robot        {}\n", report.robot.as_deref().unwrap_or_default());
    text += &format!("fingerprint  {}\n\n", report.fingerprint.as_deref().unwrap_or_default());
    text += &names("tree", &report.tree);
    if report.tree_q.len() != report.tree.len() {
        text += &names("tree q", &report.tree_q);
    }
    text += &names("independent", &report.independent);
    text += &names("active", &report.active);
    text += &names("loop rows", &report.loops);

    let row = |closure: &sarrus_models::ClosureReport| {
        vec![
            closure.name.clone(),
            closure.type_name.clone(),
            closure.kind.to_owned(),
            closure.rows.to_string(),
            closure.rank.to_string(),
            if closure.misfit == 0.0 { "0".to_owned() } else { format!("{:.1e}", closure.misfit) },
        ]
    };
    if !report.closures.is_empty() {
        let rows: Vec<Vec<String>> = report.closures.iter().map(row).collect();
        text += "\n";
        text += &table(&["submechanism", "type", "closure", "rows", "rank", "misfit"], &rows);
    }
    text += "\n";
    text += &match report.warnings.len() {
        0 => "valid, no warnings\n".to_owned(),
        1 => "valid, 1 warning\n".to_owned(),
        n => format!("valid, {n} warnings\n"),
    };
    text + &findings(&[], &report.warnings)
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
