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

/// Runs `CASE[,CASE…] REPEATS`: that many passes through the states; several cases are those of one
/// robot with one way to close its loops, which is loaded once.
///
/// # Errors
///
/// An unknown case, or a state without an answer.
pub fn run(count: &[String]) -> Outcome {
    let [names, repeats] = count else { return Err("--count takes cases and a number".into()) };
    let repeats: usize = repeats.parse()?;
    if let Some(outcome) = bridge::run(names, repeats) {
        return outcome;
    }
    if let Some(outcome) = scaling::count(names, repeats) {
        return outcome;
    }
    let name = names.split(',').next().unwrap_or_default();
    let mut parts = name.split('/');
    let of = [parts.next().unwrap_or_default(), parts.next().unwrap_or_default()];
    let what = Subject::all().find(|what| what.name() == of[0] && what.may_have(name));
    let what = what.ok_or_else(|| unknown(name))?;
    let robot = Robot::load_some(what, STATES, |variant| variant == of[1])?;
    names.split(',').try_for_each(|name| one(&robot, name, repeats))
}

fn unknown(name: &str) -> String {
    format!("no case `{name}`; `--list` names them all")
}

/// One case of a robot.
fn one(robot: &Robot, name: &str, repeats: usize) -> Outcome {
    // the same states at once
    let (name, is_batch) = match name.strip_suffix("/batch") {
        Some(name) => (name, true),
        None => (name, false),
    };
    let mut case = cases::of_robot(robot)?
        .into_iter()
        .chain(cases::counted(robot)?)
        .find(|case| case.name() == name)
        .ok_or_else(|| unknown(name))?;
    if is_batch {
        let mut many = Many::new(robot, case.question, STATES)?;
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
