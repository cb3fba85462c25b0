//! One robot beside one peer: how far its answers are from the exact ones, and why.

use std::time::Duration;

use serde::Serialize;

use super::{Peer, peer};
use crate::Outcome;
use crate::measure::timing::interleaved;
use crate::reference::{References, layout, worse};
use crate::robots::{Own, Planned, Question, Robot, Start, Subject};
use sarrus_dynamics::Plan;
use sarrus_dynamics::description::Description;

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
    /// `state` (q from y), `ID` (τ_u from y, ẏ, ÿ) or `FD` (ÿ from y, ẏ, τ_u).
    pub quantity: &'static str,
    /// Its method.
    pub method: String,
    /// Its setting.
    pub setting: String,
    /// The largest difference from the same model in double-double, by size: the peer's and ours;
    /// none where a number is missing.
    pub theirs: Option<f64>,
    /// Ours.
    pub ours: f64,
    /// Nanoseconds of a call: the peer's and ours.
    pub theirs_ns: f64,
    /// Ours.
    pub ours_ns: f64,
    /// By how much the setting itself makes answers differ.
    pub softness: f64,
    /// The cause of the difference.
    pub why: &'static str,
    /// True if the softness does not explain the difference.
    pub is_finding: bool,
}

/// Compares one robot with one peer on the same random states.
///
/// # Errors
///
/// A robot whose loops do not close at most states; a peer whose program fails.
pub fn compare(description: Description, engine: &str) -> Outcome<Comparison> {
    let robot = Robot::load_some(Subject::Own(Own::new(description)), STATES, |_| true)?;
    let name = robot.description.name.clone();
    let (peer, runs) = match peer(engine, &robot, 0, SECONDS)? {
        Peer::Missing(why) => {
            return Ok(Comparison { robot: name, peer: why, is_run: false, rows: Vec::new() });
        }
        Peer::Measured { engine, runs } => (engine, runs),
    };
    let variant = robot.variants.first().ok_or("no variant")?;
    let model = &variant.compiled.model;
    let start = if variant.closures == "analytic" { Start::None } else { Start::Warm };
    let mut references = References::new(&robot);
    let mut cases = Vec::new();
    for question in Question::CHOSEN {
        let plan = Plan::new(model, &question.query())?;
        cases.push(Planned::new(model, plan, &robot.states, 0));
    }
    let times = interleaved(&mut cases, Duration::from_secs_f64(3.0 * SECONDS), |_| {})?;
    let mut rows = Vec::new();
    for (k, question) in Question::CHOSEN.into_iter().enumerate() {
        let mut ours = 0.0;
        let want = layout(&robot, question);
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
                quantity: question.name(),
                method: run.name.clone(),
                setting: run.setting.clone(),
                theirs: theirs.is_finite().then_some(theirs),
                ours,
                theirs_ns: run.ns,
                ours_ns: times[k].median(),
                softness,
                why: match theirs {
                    _ if !is_finding => why,
                    theirs if theirs.is_finite() => "more than its setting explains: other rows?",
                    _ => "no number",
                },
                is_finding,
            });
        }
    }
    Ok(Comparison { robot: name, peer, is_run: true, rows })
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
    use super::*;
    use crate::robots::catalogue::bundled;

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
            let found = compare(bundled("lambda").unwrap(), engine).unwrap();
            if !found.is_run {
                assert!(found.peer.contains("not run") && found.rows.is_empty());
                println!("{}", found.peer);
                continue;
            }
            assert!(!found.rows.is_empty());
            for row in &found.rows {
                assert!(!row.is_finding && row.ours < 1e-13, "{row:?}");
            }
        }
    }
}
