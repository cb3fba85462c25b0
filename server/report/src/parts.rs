//! Section `parts`: times of questions that need only a part of the robot, compared with the whole
//! question.

use std::time::Duration;

use sarrus_counting::operations;
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query};

use crate::Outcome;
use crate::measure::Effort;
use crate::measure::progress::Progress;
use crate::measure::timing::{Timed, interleaved};
use crate::page::{Section, Table, columns};
use crate::robots::catalogue::bundled_names;
use crate::robots::{Planned, Question, Robot, State, Subject, links_by_bodies};

/// A partial question: the words of the table, the question and its part.
struct Pair {
    words: String,
    whole: Query,
    part: Query,
    /// The fields of the part that the whole answer has too, row by row.
    same: FieldSet,
    /// The state is at rest in the whole question, which gives rates of zero.
    rest: bool,
}

impl Pair {
    /// A part whose fields are all in the whole answer.
    fn new(words: String, whole: Query, part: Query) -> Pair {
        Pair { words, whole, part, same: part.want, rest: false }
    }
}

/// Fills the section.
pub(crate) fn run(effort: &Effort, own: Option<Subject>, progress: &Progress) -> Outcome<Section> {
    let (n_states, rounds) = if effort.quick { (16, 150) } else { (64, 2500) };
    let mut section = Section::new("parts", "Answers that need a part of the robot");
    let mut rows = Vec::new();
    let bundled = || bundled_names().into_iter().map(Subject::Bundled).collect();
    let subjects: Vec<Subject> = own.map_or_else(bundled, |own| vec![own]);
    for (k, subject) in subjects.iter().enumerate() {
        progress.show(subject.name(), k as f64 / subjects.len() as f64);
        let robot = Robot::load(*subject, n_states)?;
        rows.extend(of_robot(&robot, Duration::from_millis(rounds))?);
    }
    let least = rows.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    let least = least.map_or("-".to_owned(), |(cells, ratio)| {
        format!("{ratio:.2} ({} of {})", cells[1], cells[0])
    });
    let rows: Vec<Vec<String>> = rows.into_iter().map(|(cells, _)| cells).collect();
    section.summary.push(format!(
        "Questions that need a part of a robot: same bits as in the whole answer at {} of {} \
            pairs; least time against the whole {least}",
        rows.iter().filter(|row| row.last().is_some_and(|cell| cell == "yes")).count(),
        rows.len()
    ));
    section.tables.push(Table {
        id: "parts-pairs".into(),
        title: "In part and in whole".into(),
        caption: "Bodies and loops that the plan of the part computes, of all; operations as \
            counted by a scalar (a fused multiply-add is one, so is a pair of sine and cosine); \
            medians of batches that take turns, from y without a guess; the ratio of the times. \
            Bits: every number of the part is that of the whole answer."
            .into(),
        columns: columns(
            "robot | asked | bodies | loops | operations | of the whole | ns | ns of the whole | \
            ratio | same bits",
        ),
        rows,
    });
    Ok(section)
}

/// A row for each question, and the ratio of the times.
fn of_robot(robot: &Robot, rounds: Duration) -> Outcome<Vec<(Vec<String>, f64)>> {
    let model = &robot.variants.first().ok_or("no variant")?.compiled.model;
    let pairs = pairs(model)?;
    let mut runs = Vec::new();
    let mut same = Vec::new();
    let still = |rates: &[f64]| vec![0.0; rates.len()];
    let at_rest =
        |state: &State| State { yd: still(&state.yd), ydd: still(&state.ydd), ..state.clone() };
    let at_rest: Vec<State> = robot.states.iter().map(at_rest).collect();
    for pair in &pairs {
        let states = if pair.rest { &at_rest } else { &robot.states };
        let mut both = [
            Planned::new(model, Plan::new(model, &pair.part)?, &robot.states, 0),
            Planned::new(model, Plan::new(model, &pair.whole)?, states, 0),
        ];
        same.push(has_same_bits(pair, &mut both));
        runs.extend(both);
    }
    let times = interleaved(&mut runs, rounds, |_| {})?;
    let mut rows = Vec::new();
    let of_pairs = pairs.iter().zip(runs.chunks_exact(2)).zip(times.chunks_exact(2)).zip(same);
    for (((pair, runs), times), same) in of_pairs {
        let [part, whole] = [&runs[0], &runs[1]];
        let outline = part.plan.outline(model);
        let ns = times[0].median();
        let ns_of_whole = times[1].median();
        rows.push((
            vec![
                robot.name.to_owned(),
                pair.words.clone(),
                format!("{} of {}", outline.bodies, outline.bodies_of_robot),
                format!("{} of {}", outline.closed, outline.closed_of_robot),
                operations(&part.plan, model, &part.inputs[0]).to_string(),
                operations(&whole.plan, model, &whole.inputs[0]).to_string(),
                format!("{ns:.0}"),
                format!("{ns_of_whole:.0}"),
                format!("{:.2}", ns / ns_of_whole),
                if same { "yes" } else { "no" }.to_owned(),
            ],
            ns / ns_of_whole,
        ));
    }
    Ok(rows)
}

/// The partial questions to each robot: poses of its nearest and of its farthest link, positions of
/// a moving robot, forces of one joint, gravity.
fn pairs(model: &Model) -> Outcome<Vec<Pair>> {
    use Field::*;
    let mut pairs = Vec::new();
    let state = Question::State.query();

    let links = links_by_bodies(model)?;
    for (_, link, part) in links.first().into_iter().chain(links.last()) {
        let mut whole = *part;
        whole.want |= FieldSet::of(&[Q, U]);
        pairs.push(Pair::new(format!("pose of {}", model.link_names()[*link]), whole, *part));
    }

    let part = Query { want: FieldSet::of(&[Q, U]), ..state };
    pairs.push(Pair::new("positions of a motion".into(), state, part));

    let whole = Question::InverseDynamics.query();
    let last = model.active_names().last();
    let joint = last.and_then(|name| model.tree_names().iter().position(|other| other == name));
    if let Some((name, v)) = last.zip(joint) {
        let part = whole.with_joints([v as u16]);
        let pair = Pair::new(format!("force of {name}"), whole, part);
        pairs.push(Pair { same: FieldSet::EMPTY, ..pair });
    }
    let part = Query { given: FieldSet::of(&[Y]), ..whole };
    pairs.push(Pair { rest: true, ..Pair::new("gravity".into(), whole, part) });
    Ok(pairs)
}

/// True if the whole answer has every number of the part, bit for bit.
fn has_same_bits(pair: &Pair, [part, whole]: &mut [Planned; 2]) -> bool {
    (0..part.states()).all(|state| {
        part.call(state);
        whole.call(state);
        let rows = |run: &Planned, field| -> Vec<u64> {
            run.get(field).iter().map(|x| x.to_bits()).collect()
        };
        if pair.same.is_empty() {
            // one row: the last joint of the whole answer
            let [one, all] = [&*part, &*whole].map(|run| rows(run, Field::TauU).last().copied());
            return one.is_some() && one == all;
        }
        pair.same.iter().all(|field| {
            let numbers = rows(part, field);
            !numbers.is_empty() && numbers == rows(whole, field)
        })
    })
}
