//! Unfounded warnings: counts good answers of bundled robots with one.

use sarrus_dynamics::{Plan, Status};

use crate::Outcome;
use crate::page::{Table, columns};
use crate::reference::Reference;
use crate::robots::catalogue::bundled_names;
use crate::robots::random::Random;
use crate::robots::{Planned, Question, Robot, Start, Subject};

use super::families::dead_points_in_series::everything;
use super::harness;
use super::harness::{Cases, HELD, State, bundled, numerical, warned};

/// Error by size up to which an answer keeps eleven digits.
const GOOD: f64 = 1e-11;

/// Counts of answers of a robot, or of all of them.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Count {
    /// Answers that were ok and had a reference.
    pub(crate) answers: usize,
    /// Answers that keep eleven digits, and those of them that warn of `ill_conditioned`.
    pub(crate) good: usize,
    pub(crate) alarms: usize,
    /// Answers that keep fewer than nine digits, and those of them without a warning.
    pub(crate) bad: usize,
    pub(crate) silent: usize,
}

impl Count {
    fn add(&mut self, other: Count) {
        self.answers += other.answers;
        self.good += other.good;
        self.alarms += other.alarms;
        self.bad += other.bad;
        self.silent += other.silent;
    }

    fn answer(&mut self, error: f64, warns: bool) {
        self.answers += 1;
        self.good += usize::from(error <= GOOD);
        self.alarms += usize::from(error <= GOOD && warns);
        self.bad += usize::from(error > HELD);
        self.silent += usize::from(error > HELD && !warns);
    }

    /// In a sentence.
    pub(crate) fn sentence(self, what: &str) -> String {
        format!(
            "False alarms, {what}: of {} answers of the bundled robots at generic states, {} keep \
            eleven digits and {} of these warn of ill_conditioned; {} keep fewer than nine, {} of \
            these silently.",
            self.answers, self.good, self.alarms, self.bad, self.silent
        )
    }
}

/// The counts of every bundled robot, closed in each of its ways, at this many states: state,
/// inverse and forward dynamics.
pub(crate) fn count(states: usize) -> Outcome<Vec<(&'static str, Count)>> {
    bundled_names().into_iter().map(|name| Ok((name, of_robot(name, states)?))).collect()
}

/// Counts by every question of the families, each field judged by itself, at this many states.
pub(crate) fn fields(states: u64) -> Outcome<Cases> {
    let mut cases = Cases::default();
    for name in bundled_names() {
        for of in [bundled(name)?, numerical(bundled(name)?)] {
            let robot = harness::Robot::new(name, of)?;
            for seed in 0..states {
                let mut random = Random(7 << 32 | seed);
                let mut state = State::of(&robot, random.between(0.05, 0.25))?;
                // a quaternion is not scaled
                if state.y.len() == state.yd.len() {
                    state.y.iter_mut().for_each(|y| *y *= random.next());
                }
                state.yd.iter_mut().chain(&mut state.ydd).for_each(|x| *x *= random.next());
                state.forces(&robot)?;
                everything(&mut cases, &robot, 0.0, &state)?;
            }
        }
    }
    Ok(cases)
}

/// The counts of these cases.
pub(crate) fn of_cases(cases: &Cases) -> Count {
    let mut count = Count::default();
    for case in &cases.all {
        if let Some(error) = case.error {
            count.answer(error, case.warnings.iter().any(|name| name == "ill_conditioned"));
        }
    }
    count
}

/// All of them.
pub(crate) fn sum(counts: &[(&'static str, Count)]) -> Count {
    let mut sum = Count::default();
    counts.iter().for_each(|(_, count)| sum.add(*count));
    sum
}

fn of_robot(name: &'static str, states: usize) -> Outcome<Count> {
    let robot = Robot::load(Subject::Bundled(name), states)?;
    let mut count = Count::default();
    for (place, variant) in robot.variants.iter().enumerate() {
        let model = &variant.compiled.model;
        for question in Question::CHOSEN {
            let mut reference = Reference::new(&robot, place, question, Start::None)?;
            let plan = Plan::new(model, &question.query())?;
            let mut planned = Planned::new(model, plan, &robot.states, place);
            for state in 0..robot.states.len() {
                reference.compute(&robot, state)?;
                let answer = planned.answer(state);
                if answer.status == Status::Ok {
                    let error = reference.error(planned.plan.want(), state, &planned.output);
                    count.answer(error, warned(answer.warnings, "ill_conditioned"));
                }
            }
        }
    }
    Ok(count)
}

/// A row for each robot.
pub(crate) fn table(counts: &[(&'static str, Count)]) -> Table {
    let row = |(name, count): &(&'static str, Count)| {
        let Count { answers, good, alarms, bad, silent } = *count;
        let numbers = [answers, good, alarms, bad, silent].map(|n| n.to_string());
        [vec![(*name).to_owned()], numbers.to_vec()].concat()
    };
    Table {
        id: "extremes-false-alarms".into(),
        title: "Warnings of good answers".into(),
        caption: "State, inverse and forward dynamics of the bundled robots at random states, \
            closed in each of their ways, against double-double; warnings are ill_conditioned."
            .into(),
        columns: columns(
            "robot | answers | eleven digits | of these warn | below nine | of these silent",
        ),
        rows: counts.iter().map(row).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::Assessment;

    /// Of a thousand answers that keep eleven digits one may warn.
    fn check(count: Count, what: &str) {
        println!("{}", count.sentence(what));
        assert!(count.good > 0 && 1000 * count.alarms <= count.good, "{what}: {count:?}");
        assert_eq!(count.silent, 0, "{what}: {count:?}");
    }

    fn check_fields(states: u64) {
        let cases = fields(states).expect("answers");
        for case in &cases.all {
            if case.assessment == Assessment::FailedSilently {
                println!("{case:?}");
            }
        }
        check(of_cases(&cases), "every field");
    }

    #[test]
    fn good_answers_hardly_ever_warn() {
        check(sum(&count(20).expect("answers")), "usual fields");
        check_fields(2);
    }

    #[test]
    #[ignore = "takes a minute"]
    fn of_a_hundred_thousand_good_answers_hardly_any_warns() {
        let count = sum(&count(1400).expect("answers"));
        assert!(count.answers > 100_000, "{count:?}");
        check(count, "usual fields");
        check_fields(30);
    }
}
