//! One case a fixed number of times, for counting its instructions from outside
//! (`benches/count.sh`).

use sarrus_report::Outcome;
use sarrus_report::robots::{Robot, Subject};

use crate::batches::Many;
use crate::bridge;
use crate::cases::{self, passes};
use crate::scaling;

/// States that the calls go through in turn.
const STATES: usize = 16;

/// Runs `CASE REPEATS`: that many passes through the states.
///
/// # Errors
///
/// An unknown case, or a state without an answer.
pub fn run(count: &[String]) -> Outcome {
    let [name, repeats] = count else { return Err("--count takes a case and a number".into()) };
    let repeats: usize = repeats.parse()?;
    if let Some(outcome) = bridge::run(name, repeats) {
        return outcome;
    }
    if let Some(outcome) = scaling::count(name, repeats) {
        return outcome;
    }
    let unknown = || format!("no case `{name}`; `--list` names them all");
    let mut parts = name.split('/');
    let robot = parts.next().unwrap_or_default();
    let closures = parts.next().unwrap_or_default();
    let what = Subject::all()
        .find(|what| what.name() == robot && what.may_have(name))
        .ok_or_else(unknown)?;

    // the same states at once
    let (name, is_batch) = match name.strip_suffix("/batch") {
        Some(name) => (name, true),
        None => (name.as_str(), false),
    };
    let robot = Robot::load_some(what, STATES, |variant| variant == closures)?;
    let mut case = cases::of_robot(&robot)?
        .into_iter()
        .chain(cases::counted(&robot)?)
        .find(|case| case.name() == name)
        .ok_or_else(unknown)?;
    if is_batch {
        let mut many = Many::new(&robot, case.question, STATES)?;
        passes_of_batch(&mut many, repeats);
        return many.check();
    }
    passes(&mut case, repeats)
}

/// Runs a batch of the case.
#[inline(never)]
fn passes_of_batch(many: &mut Many, repeats: usize) {
    for _ in 0..repeats {
        many.abreast();
    }
}
