//! `sarrus compare`: one robot beside another engine.

use clap::Args;
use clap::builder::PossibleValuesParser;
use sarrus_report::peer::compare::{Comparison, compare};
use sarrus_report::peer::engines;

use super::output::{Failure, FormatFlag, Outcome, Results};
use super::robot::RobotFlags;

/// Flags of `compare`.
#[derive(Args)]
pub(crate) struct Compare {
    #[command(flatten)]
    robot: RobotFlags,
    /// The other engine; benches/peers/build.sh builds its program.
    #[arg(long, value_name = "PEER", value_parser = PossibleValuesParser::new(engines()))]
    with: String,
    #[command(flatten)]
    format: FormatFlag,
}

impl Compare {
    pub(crate) fn run(self) -> Outcome {
        let loaded = self.robot.load_and_warn()?;
        let found = compare(&loaded, &self.with).map_err(Failure::start)?;
        let code = u8::from(found.rows.iter().any(|row| row.is_finding));
        Ok(Results { text: self.format.render(&found, in_words), code })
    }
}

/// A head and one line for each method.
fn in_words(found: &Comparison) -> String {
    if !found.is_run {
        return format!("{}\n", found.peer);
    }
    let mut text = format!(
        "{} beside {}\nlargest difference from the exact answer, by size, and time of a call\n",
        found.robot, found.peer
    );
    text += &format!(
        "{:<13} {:<38} {:<22} {:>9} {:>9}  {:>8} {:>8}  why\n",
        "what", "method", "setting", "theirs", "ours", "theirs", "ours"
    );
    for row in &found.rows {
        let theirs = row.theirs.map_or("-".to_owned(), |theirs| format!("{theirs:.1e}"));
        let ours = row.ours.map_or("-".to_owned(), |ours| format!("{ours:.1e}"));
        let micros =
            |ns: Option<f64>| ns.map_or("-".to_owned(), |ns| format!("{:.2} µs", ns / 1e3));
        text += &format!(
            "{:<13} {:<38} {:<22} {:>9} {:>9}  {:>8} {:>8}  {}\n",
            row.quantity,
            row.method,
            row.setting,
            theirs,
            ours,
            micros(row.theirs_ns),
            micros(row.ours_ns),
            row.why
        );
    }
    text
}
