//! One robot beside one peer: how far its answers are from the exact ones, and why.

use std::time::Duration;

use serde::Serialize;

use super::exported::{Deviation, Difference, Found, deviation, pythons};
use super::{Peer, Run, peer};
use crate::Outcome;
use crate::measure::Folder;
use crate::measure::timing::interleaved;
use crate::reference::{References, layout, worse};
use crate::robots::{Own, Planned, Question, Robot, Start, Subject};
use sarrus_dynamics::Plan;
use sarrus_models::{Loaded, Target, export};

/// Random states.
const STATES: usize = 64;
/// Seconds for each method of the peer, and for our answers.
const SECONDS: f64 = 0.1;
/// A difference above this many times the peer's softness has another cause.
const AMPLIFIED: f64 = 100.0;
/// Rounding of an engine in double precision, by size, amplified by the robot.
const ROUNDING: f64 = 1e-11;

/// A robot beside a peer.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The robot's name.
    pub robot: String,
    /// The peer's name with its version, or why it was not run.
    pub peer: String,
    /// False without answers of the peer.
    pub is_run: bool,
    /// Every method of the peer with every setting.
    pub rows: Vec<Row>,
}

/// A method of a peer beside our default.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// `state` (q from y), `ID` (τ_u from y, ẏ, ÿ) or `FD` (ÿ from y, ẏ, τ_u); of the files of
    /// `sarrus export` the quantities of [`super::exported::Difference`].
    pub quantity: String,
    /// Its method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// The largest difference from the same model in double-double, by size: the peer's and ours;
    /// none where a number is missing.
    pub theirs: Option<f64>,
    /// Ours; none where theirs is compared with ours.
    pub ours: Option<f64>,
    /// Nanoseconds of a call: the peer's and ours; none where it was not timed.
    pub theirs_ns: Option<f64>,
    /// Ours.
    pub ours_ns: Option<f64>,
    /// By how much the setting itself makes answers differ.
    pub softness: f64,
    /// The cause of the difference.
    pub why: String,
    /// True if the softness does not explain the difference.
    pub is_finding: bool,
}

/// Compares one robot with one peer on the same random states: methods of the peer's program, which
/// are timed, then the files that `sarrus export` writes for it.
///
/// # Errors
///
/// A robot whose loops do not close at most states; a peer whose program fails.
pub fn compare(loaded: &Loaded, engine: &str) -> Outcome<Comparison> {
    let own = Own::new(loaded.description.clone());
    let robot = Robot::load_some(Subject::Own(own), STATES, |_| true)?;
    let mut found = match peer(engine, &robot, 0, SECONDS)? {
        Peer::Missing(why) => Comparison {
            robot: robot.description.name.clone(),
            peer: why,
            is_run: false,
            rows: Vec::new(),
        },
        Peer::Measured { engine, runs } => timed(&robot, engine, &runs)?,
    };
    match of_files(loaded, engine)? {
        Some(Deviation::Measured(Found { engine, why, rows })) => {
            if found.is_run {
                found.peer += &format!("; files by {engine}");
            } else {
                found.peer = format!("{engine} ({})", found.peer);
            }
            found.is_run = true;
            found.rows.extend(rows.into_iter().map(|row| of_difference(row, &why)));
        }
        Some(Deviation::NotRun(why)) => found.peer += &format!(" Its files: not run, {why}."),
        None => {}
    }
    Ok(found)
}

/// The difference of the exported files by the peer; none for a peer that reads none.
fn of_files(loaded: &Loaded, engine: &str) -> Outcome<Option<Deviation>> {
    let (target, name) = match engine {
        "mujoco" => (Target::Mjcf, "MuJoCo"),
        "pinocchio" => (Target::Pinocchio, "Pinocchio"),
        _ => return Ok(None),
    };
    let exported = match export(loaded, target, "robot", false) {
        Ok(exported) => exported,
        Err(error) => {
            let why = error.to_string();
            return Ok(Some(Deviation::NotRun(why.trim().to_owned())));
        }
    };
    let folder = Folder::new("compare");
    std::fs::create_dir_all(&folder.0)?;
    let file = |ending: &str| folder.0.join(format!("robot{ending}"));
    for (ending, text) in &exported.files {
        std::fs::write(file(ending), text)?;
    }
    let first = file(exported.files.first().map_or("", |(ending, _)| ending));
    deviation(&loaded.description, &exported.held, name, &first, &pythons()).map(Some)
}

/// A line for a quantity of the files.
fn of_difference(of: Difference, why: &str) -> Row {
    let is_finding = of.is_finding();
    let is_soft = of.quantity == "accelerations";
    Row {
        method: "the files of sarrus export".to_owned(),
        setting: String::new(),
        theirs: Some(of.difference).filter(|x| x.is_finite()),
        ours: None,
        theirs_ns: None,
        ours_ns: None,
        softness: 0.0,
        why: match is_soft {
            _ if is_finding => "more than its setting explains".to_owned(),
            true => why.to_owned(),
            false => "rounding".to_owned(),
        },
        is_finding,
        quantity: of.quantity,
    }
}

/// The methods of a peer's program beside ours.
fn timed(robot: &Robot, peer: String, runs: &[Run]) -> Outcome<Comparison> {
    let variant = robot.variants.first().ok_or("no variant")?;
    let model = &variant.compiled.model;
    let start = if variant.closures == "analytic" { Start::None } else { Start::Warm };
    let mut references = References::new(robot);
    let mut cases = Vec::new();
    for question in Question::CHOSEN {
        let plan = Plan::new(model, &question.query())?;
        cases.push(Planned::new(model, plan, &robot.states, 0));
    }
    let times = interleaved(&mut cases, Duration::from_secs_f64(3.0 * SECONDS), |_| {})?;
    let mut rows = Vec::new();
    for (k, question) in Question::CHOSEN.into_iter().enumerate() {
        let mut ours = 0.0;
        let want = layout(robot, question);
        for state in 0..robot.states.len() {
            cases[k].answer(state).ok()?;
            let key = (question, 0, Start::None);
            ours = worse(ours, references.error(key, &want, state, &cases[k].output)?);
        }
        for run in runs.iter().filter(|run| run.question == question) {
            let key = (question, start);
            let theirs = run.worst(|state, answer| references.of_peer(key, state, answer))?;
            let (softness, why) = softness(&run.setting);
            let is_finding = theirs.is_nan() || theirs > AMPLIFIED * softness.max(ROUNDING);
            rows.push(Row {
                quantity: question.name().to_owned(),
                method: run.name.clone(),
                setting: run.setting.clone(),
                theirs: theirs.is_finite().then_some(theirs),
                ours: Some(ours),
                theirs_ns: Some(run.ns),
                ours_ns: Some(times[k].median()),
                softness,
                why: match theirs {
                    _ if !is_finding => why,
                    theirs if theirs.is_finite() => "more than its setting explains: other rows?",
                    _ => "no number",
                }
                .to_owned(),
                is_finding,
            });
        }
    }
    Ok(Comparison { robot: robot.description.name.clone(), peer, is_run: true, rows })
}

/// By how much a setting makes answers differ, by size, and why.
fn softness(setting: &str) -> (f64, &'static str) {
    let mut words = setting.split([' ', ',']);
    let parameter = words.next().unwrap_or_default();
    let number: f64 = words.next().and_then(|word| word.parse().ok()).unwrap_or_default();
    match parameter {
        "tolerance" => (number, "its closing of loops stops at this residual"),
        "dmax" => (1.0 - number, "a soft constraint gives way by the part 1 - dmax"),
        // the proximal term, and the rounding that its inverse amplifies
        "mu" => (number + f64::EPSILON / number, "a proximal term of mu, few iterations"),
        _ => (0.0, "rounding"),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test that fails panics")]
mod tests {
    use sarrus_models::{Options, Source, load};

    use super::*;

    #[test]
    fn softness_is_that_of_the_setting() {
        assert_eq!(softness("tolerance 1e-6").0, 1e-6);
        assert!((softness("dmax 0.99").0 - 0.01).abs() < 1e-15);
        assert!((softness("mu 1e-8, iterations 2").0 - 3.2e-8).abs() < 1e-9);
        assert_eq!(softness("accuracy of doubles").0, 0.0);
    }

    #[test]
    fn a_peer_that_is_built_agrees_within_its_softness_and_an_absent_one_is_no_finding() {
        for engine in crate::peer::engines() {
            let source = Source::Bundled("lambda".to_owned());
            let loaded = load(&source, &Options::default()).unwrap();
            let found = compare(&loaded, engine).unwrap();
            if !found.is_run {
                assert!(found.peer.contains("not run") && found.rows.is_empty());
                println!("{}", found.peer);
                continue;
            }
            assert!(!found.rows.is_empty());
            for row in &found.rows {
                assert!(!row.is_finding && row.ours.is_none_or(|x| x < 1e-13), "{row:?}");
            }
        }
    }
}
