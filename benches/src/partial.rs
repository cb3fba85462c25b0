//! The saving of partial questions (`--partial`): work and time of a part of a question as a
//! fraction of the whole question, on every bundled robot.
//!
//! The work is predicted from the plan, as operations that a scalar counts. The time is measured
//! for one state and for a row of a batch, in turns with the whole question. Locked joints and a
//! part of the robot are reductions at load: the same question to a smaller model. Numbers that
//! part and whole share are compared.

use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use sarrus_counting::operations;
use sarrus_dynamics::{Field, FieldSet, Model, Plan, Query, Request, Status, Workspace};
use sarrus_models::{Lock, Options, Source, bundled, load};
use sarrus_report::Outcome;
use sarrus_report::measure::machine::machine;
use sarrus_report::measure::timing::{Timed, interleaved};
use sarrus_report::robots::{Question, Robot, State, Subject, packed};
use serde_json::{Value, json};

use crate::batches::Many;
use crate::cores::Cores;
use crate::printed::Printed;
use crate::table::{Format, Table, error, ns};

/// States of a question alone, and those of its mean count of operations.
const STATES: usize = 32;
const COUNTED: usize = 8;
/// Rows of a batch.
const ROWS: usize = 256;
/// Robots with limbs: the joints of one, and its end.
const LIMBS: [(&str, &str, &str); 4] = [
    ("rh5v2_upper_body", "AL*", "ALWristRoll_Link"),
    ("rh5v2_full", "AL*", "ALHandRoll_Link"),
    ("cassie", "left_*", "left_foot"),
    ("wheel_leg", "left_*", "left_wheel"),
];
/// The parts, as columns.
const PARTS: [&str; 6] = ["pose", "motor", "gravity", "limb", "locked", "scene"];

/// How much is measured, and the destination of the results.
#[derive(Clone, Debug)]
pub struct PartialOptions {
    /// Fewer repetitions.
    pub quick: bool,
    /// Only the robots whose name has this in it.
    pub only: String,
    /// How the tables are printed.
    pub format: Format,
    /// The file for every batch of every case.
    pub out: PathBuf,
}

/// A question to a robot or to the rest of a reduced one.
struct Asked {
    model: Arc<Model>,
    plan: Plan,
    workspace: Workspace<f64>,
    inputs: Vec<Vec<f64>>,
    output: Vec<f64>,
    /// The motors whose forces are wanted, in the order of the answer.
    motors: Vec<String>,
}

/// A part of a question beside the whole one.
struct Pair {
    part: usize,
    /// The part in words.
    words: String,
    /// The start of the names of the motors that part and whole must agree on.
    shared: &'static str,
    both: [Asked; 2],
}

/// Operations and nanoseconds of a part and of the whole, the latter also for a row of a batch.
struct Found {
    robot: &'static str,
    part: usize,
    words: String,
    /// Bodies and closed loops, of all.
    work: [String; 2],
    operations: [f64; 2],
    ns: [f64; 2],
    ns_of_row: [f64; 2],
    /// The largest difference of shared numbers, by size.
    difference: f64,
}

/// Measures, prints and keeps.
///
/// # Errors
///
/// A robot that does not load or answer, a file that cannot be written.
pub fn run(options: &PartialOptions) -> Outcome {
    let rounds = Duration::from_millis(if options.quick { 250 } else { 2000 });
    Cores::choose()?.pin_client();
    let mut found = Vec::new();
    let mut samples = Vec::new();
    for name in bundled().map(|(name, _)| name).filter(|name| name.contains(&options.only)) {
        let mut pairs = pairs(name)?;
        let differences = pairs.iter_mut().map(Pair::difference).collect::<Outcome<Vec<_>>>()?;
        let mut rows = Vec::new();
        for pair in &pairs {
            rows.extend([pair.both[0].batch(), pair.both[1].batch()]);
        }
        let of_rows = interleaved(&mut rows, rounds, |_| ())?;
        let mut work = Vec::new();
        let mut alone = Vec::new();
        for pair in pairs {
            let [part, whole] = pair.both;
            let operations = [part.operations(), whole.operations()];
            work.push((pair.part, pair.words, part.work(&whole.model), operations));
            alone.extend([part, whole]);
        }
        let of_alone = interleaved(&mut alone, rounds, |_| ())?;
        for (k, (part, words, work, operations)) in work.into_iter().enumerate() {
            let both = [2 * k, 2 * k + 1];
            found.push(Found {
                robot: name,
                part,
                words,
                work,
                operations,
                ns: both.map(|run| of_alone[run].median()),
                ns_of_row: both.map(|run| of_rows[run].median() / ROWS as f64),
                difference: differences[k],
            });
        }
        samples.extend(of_alone);
        samples.extend(of_rows);
    }
    let printed = Printed {
        package: "sarrus-benches",
        machine: machine()?,
        tables: vec![fractions(&found), in_full(&found)],
        values: json!({ "partial": found.iter().map(Found::value).collect::<Vec<_>>() }),
        samples,
    };
    printed.finish(options.format, &options.out)
}

/// The partial questions to a robot.
fn pairs(name: &'static str) -> Outcome<Vec<Pair>> {
    let robot = Robot::load_some(Subject::Bundled(name), STATES, |_| true)?;
    let model = Arc::new(robot.variants.first().ok_or("no variant")?.compiled.model.clone());
    let states = &robot.states;
    let inverse = Question::InverseDynamics.query();
    let whole = || Asked::new(&model, inverse, states);
    let mut pairs = Vec::new();

    let limb = LIMBS.iter().find(|(robot, ..)| *robot == name);
    let (link, pose) = farthest(&model, limb.map(|(.., end)| *end))?;
    let mut all = pose;
    all.want |= FieldSet::of(&[Field::Q, Field::U]);
    let both = [Asked::new(&model, pose, states)?, Asked::new(&model, all, states)?];
    pairs.push(Pair { part: 0, words: link, shared: "", both });

    // a robot with one motor has no part in this sense
    if let Some(motor) = model.active_names().last().filter(|_| model.sizes().n_u > 1) {
        let of_motor = inverse.with_joints(velocities(&model, |name| name == motor));
        let both = [Asked::new(&model, of_motor, states)?, whole()?];
        pairs.push(Pair { part: 1, words: motor.clone(), shared: "", both });
    }

    let still = |state: &State| State {
        yd: vec![0.0; state.yd.len()],
        ydd: vec![0.0; state.ydd.len()],
        ..state.clone()
    };
    let still: Vec<State> = states.iter().map(still).collect();
    let at_rest = Question::Gravity.query();
    let both = [Asked::new(&model, at_rest, states)?, Asked::new(&model, inverse, &still)?];
    pairs.push(Pair { part: 2, words: "the robot at rest".to_owned(), shared: "", both });

    let Some((_, joints, end)) = limb else { return Ok(pairs) };
    let prefix = joints.trim_end_matches('*');
    let of_limb = inverse.with_joints(velocities(&model, |name| name.starts_with(prefix)));
    let both = [Asked::new(&model, of_limb, states)?, whole()?];
    pairs.push(Pair { part: 3, words: (*joints).to_owned(), shared: prefix, both });
    let lock = Options {
        lock: vec![Lock { joint: (*joints).to_owned(), position: None }],
        ..Options::default()
    };
    pairs.push(reduced(4, name, &model, &lock, format!("--lock {joints}"))?);
    let scene = Options { only: vec![(*end).to_owned()], ..Options::default() };
    // the joints that carried other branches lack their mass
    let scene = reduced(5, name, &model, &scene, format!("--only {end}"))?;
    pairs.push(Pair { shared: prefix, ..scene });
    Ok(pairs)
}

/// The link that most bodies carry, or the end of a limb, and the question for its pose.
fn farthest(model: &Model, end: Option<&str>) -> Outcome<(String, Query)> {
    let mut most: Option<(usize, String, Query)> = None;
    let is_one = |link: &String| end.is_none_or(|end| end == link);
    for (k, link) in model.link_names().iter().enumerate().filter(|(_, link)| is_one(link)) {
        let want = FieldSet::of(&[Field::FramePose]);
        let query = Query::new(Request::Kinematics, FieldSet::of(&[Field::Y]), want);
        let query = query.with_frames(&[u16::try_from(k)?]);
        let bodies = Plan::new(model, &query)?.outline(model).bodies;
        if most.as_ref().is_none_or(|(of, ..)| bodies >= *of) {
            most = Some((bodies, link.clone(), query));
        }
    }
    let (_, link, query) = most.ok_or("a robot without links")?;
    Ok((link, query))
}

/// The tree velocities of the motors that this holds for.
fn velocities(model: &Model, of: impl Fn(&str) -> bool) -> Vec<u16> {
    let info = model.info();
    let is_one = |name: &String| of(name) && info.active.contains(name);
    (0..).zip(&info.tree).filter(|(_, name)| is_one(name)).map(|(v, _)| v).collect()
}

/// Inverse dynamics of a reduced robot beside those of the whole one at the same states: zeros for
/// all coordinates that the reduced one has not.
fn reduced(
    part: usize,
    name: &'static str,
    whole: &Arc<Model>,
    options: &Options,
    words: String,
) -> Outcome<Pair> {
    let rest = load(&Source::Bundled(name.to_owned()), options)?;
    let subject = Subject::Own(sarrus_report::robots::Own::new(rest.description));
    let robot = Robot::load_some(subject, STATES, |_| true)?;
    let rest = Arc::new(robot.variants.first().ok_or("no variant")?.compiled.model.clone());
    let names = [whole.info(), rest.info()];
    let embedded = |all: &[String], some: &[String], numbers: &[f64]| -> Vec<f64> {
        let place = |name| some.iter().position(|other| other == name);
        all.iter().map(|name| place(name).map_or(0.0, |place| numbers[place])).collect()
    };
    let state = |state: &State| {
        let of_velocity =
            |numbers: &[f64]| embedded(&names[0].independent, &names[1].independent, numbers);
        State {
            y: embedded(&names[0].independent_q, &names[1].independent_q, &state.y),
            yd: of_velocity(&state.yd),
            ydd: of_velocity(&state.ydd),
            tau_u: Vec::new(),
            guesses: Vec::new(),
        }
    };
    let states: Vec<State> = robot.states.iter().map(state).collect();
    let query = Question::InverseDynamics.query();
    let both = [Asked::new(&rest, query, &robot.states)?, Asked::new(whole, query, &states)?];
    Ok(Pair { part, words, shared: "", both })
}

impl Asked {
    fn new(model: &Arc<Model>, query: Query, states: &[State]) -> Outcome<Asked> {
        let plan = Plan::new(model, &query)?;
        let info = model.info();
        let picked = |name: &&String| {
            let is_in = |v: usize, run: &[u16; 2]| (run[0] as usize..run[1] as usize).contains(&v);
            let place = info.tree.iter().position(|other| other == *name);
            let runs = query.joint_runs();
            runs.is_empty() || place.is_some_and(|v| runs.iter().any(|run| is_in(v, run)))
        };
        let motors = info.active.iter().filter(picked).cloned().collect();
        Ok(Asked {
            workspace: Workspace::for_plans(model, [&plan]),
            inputs: states.iter().map(|state| packed(&plan, state, 0)).collect(),
            output: vec![0.0; plan.want().len()],
            model: Arc::clone(model),
            plan,
            motors,
        })
    }

    /// A batch of the same inputs.
    fn batch(&self) -> Many {
        Many::of(&self.model, self.plan.clone(), self.inputs.iter().cycle().take(ROWS))
    }

    /// The mean over some states.
    fn operations(&self) -> f64 {
        let some = self.inputs.iter().take(COUNTED);
        let sum: u64 = some.map(|input| operations(&self.plan, &self.model, input)).sum();
        sum as f64 / COUNTED.min(self.inputs.len()) as f64
    }

    /// Bodies and closed loops, of those of the whole robot.
    fn work(&self, whole: &Model) -> [String; 2] {
        let outline = self.plan.outline(&self.model);
        let all = Plan::new(whole, &Question::InverseDynamics.query()).map(|of| of.outline(whole));
        let [bodies, loops] = all.map_or([0; 2], |all| [all.bodies_of_robot, all.closed_of_robot]);
        [format!("{} of {bodies}", outline.bodies), format!("{} of {loops}", outline.closed)]
    }

    /// The numbers of the last answer that a part and the whole may share, with their names.
    fn shared(&self) -> Vec<(&str, f64)> {
        let of = |field| {
            let slot = self.plan.want().slot(field);
            slot.map_or(&[][..], |slot| &self.output[slot.range()])
        };
        let pose = ["x", "y", "z", "qx", "qy", "qz", "qw"];
        let poses = pose.into_iter().zip(of(Field::FramePose).iter().copied());
        let motors = self.motors.iter().map(String::as_str);
        poses.chain(motors.zip(of(Field::TauU).iter().copied())).collect()
    }
}

impl Timed for Asked {
    fn name(&self) -> String {
        format!("{}: {}", self.model.name(), self.plan.query().want)
    }

    fn states(&self) -> usize {
        self.inputs.len()
    }

    #[inline]
    fn call(&mut self, state: usize) -> Status {
        let input = black_box(&self.inputs[state]);
        let answer = self.plan.run(&self.model, &mut self.workspace, input, &mut self.output);
        black_box(&self.output);
        answer.status
    }
}

impl Pair {
    /// The largest difference of numbers that both answers hold, by the size of the whole answer.
    fn difference(&mut self) -> Outcome<f64> {
        let [part, whole] = &mut self.both;
        let mut worst = 0.0_f64;
        for state in 0..part.states() {
            for asked in [&mut *part, &mut *whole] {
                let status = asked.call(state);
                if status != Status::Ok {
                    return Err(format!("{}, {}: {status}", asked.name(), self.words).into());
                }
            }
            let all = whole.shared();
            let size = all.iter().fold(1.0, |size, (_, x)| f64::max(size, x.abs()));
            let mut shared = 0;
            let is_shared = |(name, _): &(&str, f64)| name.starts_with(self.shared);
            for (name, x) in part.shared().into_iter().filter(is_shared) {
                if let Some((_, other)) = all.iter().find(|(other, _)| *other == name) {
                    worst = worst.max((x - other).abs() / size);
                    shared += 1;
                }
            }
            if shared == 0 {
                return Err(format!("{}: no number to compare", self.words).into());
            }
        }
        Ok(worst)
    }
}

impl Found {
    /// Predicted, measured, measured for a row of a batch.
    fn fractions(&self) -> [f64; 3] {
        [self.operations, self.ns, self.ns_of_row].map(|[part, whole]| part / whole)
    }

    fn value(&self) -> Value {
        let [predicted, measured, in_batch] = self.fractions();
        json!({
            "robot": self.robot,
            "part": PARTS[self.part],
            "of": self.words,
            "operations": self.operations,
            "ns": self.ns,
            "ns_of_a_row": self.ns_of_row,
            "predicted": predicted,
            "measured": measured,
            "measured_in_batch": in_batch,
            "difference": self.difference,
        })
    }
}

/// A line for each robot.
fn fractions(found: &[Found]) -> Table {
    let mut rows = Vec::new();
    for robot in found.chunk_by(|a, b| a.robot == b.robot) {
        let mut row = vec![robot[0].robot.to_owned()];
        row.extend((0..PARTS.len()).map(|part| {
            let of = robot.iter().find(|of| of.part == part);
            let words = |of: &Found| of.fractions().map(|x| format!("{x:.2}")).join(" / ");
            of.map_or("-".to_owned(), words)
        }));
        rows.push(row);
    }
    let all = || found.iter().map(Found::fractions);
    let apart = |k: usize| {
        let mut apart: Vec<f64> = all().map(|of| (of[k] - of[0]).abs()).collect();
        apart.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| apart.get((share * apart.len() as f64) as usize);
        let [half, most] = [at(0.5), apart.last()].map(|x| x.copied().unwrap_or(f64::NAN));
        format!("{half:.2} (median), {most:.2} (largest)")
    };
    let worst = found.iter().fold(0.0, |worst, of| f64::max(worst, of.difference));
    Table {
        title: "Parts as fractions of the whole: operations predicted / time / time of a row of \
            a batch"
            .to_owned(),
        columns: [&["robot"][..], &PARTS].concat(),
        n_text: 1,
        rows,
        notes: vec![
            "pose: of a hand, a foot or the link that most bodies carry, of q, u and this pose; \
             the others are parts of inverse dynamics from y, ẏ, ÿ:"
                .to_owned(),
            "motor: the force of the last motor; gravity: the robot at rest, from y; limb: all \
             motors of one arm or leg;"
                .to_owned(),
            "locked: with the joints of this limb locked; scene: without all branches but this \
             limb"
                .to_owned(),
            format!("predicted and time differ by {}, in a batch by {}", apart(1), apart(2)),
            format!("numbers that part and whole share differ by at most {}", error(worst)),
        ],
    }
}

fn in_full(found: &[Found]) -> Table {
    let row = |of: &Found| {
        let [bodies, loops] = of.work.clone();
        let mut row = vec![of.robot.to_owned(), PARTS[of.part].to_owned(), of.words.clone()];
        row.extend([bodies, loops]);
        row.extend([of.operations, of.ns, of.ns_of_row].iter().flatten().map(|x| ns(*x)));
        row.push(error(of.difference));
        row
    };
    Table {
        title: "In full".to_owned(),
        columns: vec![
            "robot",
            "part",
            "of",
            "bodies",
            "loops",
            "operations",
            "of the whole",
            "ns",
            "ns of the whole",
            "ns a row",
            "ns a row of the whole",
            "difference",
        ],
        n_text: 3,
        rows: found.iter().map(row).collect(),
        notes: vec![
            format!("median ns from y without a guess, alone and as a row of a batch of {ROWS};"),
            format!("operations: mean of {COUNTED} states, a fused multiply-add is one"),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::pairs;

    #[test]
    fn a_part_has_the_numbers_of_the_whole_by_fewer_operations() {
        for (robot, count) in [("rh5v2_upper_body", 6), ("wheel_leg", 6), ("stewart", 3)] {
            let mut pairs = pairs(robot).unwrap();
            assert_eq!(pairs.len(), count, "{robot}");
            for pair in &mut pairs {
                let apart = pair.difference().unwrap();
                assert!(apart < 1e-14, "{robot}, {}: {apart:e}", pair.words);
                let [part, whole] = &pair.both;
                // the motors of a platform are one block
                let is_whole = robot == "stewart" && pair.part == 1;
                assert_eq!(part.operations() < whole.operations(), !is_whole, "{}", pair.words);
            }
        }
    }
}
