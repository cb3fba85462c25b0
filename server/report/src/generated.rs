//! Section `generated`: compares straight-line code of each robot with the kernels that it was
//! traced from, with itself without checks, and with a peer at equal error.

mod case;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use sarrus_dynamics::{Model, Plan};
use sarrus_generate::{Cancel, Compiler, Kernel, NativeKernel, Source};

use self::case::Case;
use crate::Outcome;
use crate::measure::progress::Progress;
use crate::measure::timing::interleaved;
use crate::measure::{Amount, Effort, Folder};
use crate::page::{Section, Table, columns, exponent};
use crate::peer::{Run, peers, series};
use crate::reference::{References, layout, worse};
use crate::robots::catalogue::bundled_names;
use crate::robots::{Question, Robot, Start, Subject};

/// Robots of a quick report.
const QUICK: [&str; 2] = ["lambda", "rh5v2_upper_body"];
/// A peer's error that counts as equal to ours.
const EQUAL: f64 = 1e-12;
/// Number of alternating timings by the programs of generated code.
const TURNS: usize = 5;

const FEW: Amount = Amount { states: 16, rounds: Duration::from_millis(250), of_peer: 0.02 };
const FULL: Amount = Amount { states: 64, rounds: Duration::from_secs(3), of_peer: 0.1 };

/// Fills the section.
pub(crate) fn run(effort: &Effort, own: Option<Subject>, progress: &Progress) -> Outcome<Section> {
    let mut section = Section::new("generated", "Straight-line code");
    let Some(compiler) = Compiler::found() else {
        section.summary.push("Straight-line code: not measured, there is no C compiler.".into());
        return Ok(section);
    };
    let (names, amount) =
        if effort.quick { (QUICK.to_vec(), FEW) } else { (bundled_names(), FULL) };
    let bundled = || names.into_iter().map(Subject::Bundled).collect();
    let robots: Vec<Subject> = own.map_or_else(bundled, |own| vec![own]);
    let mut rows = Vec::new();
    let mut refused = Vec::new();
    for (k, &subject) in robots.iter().enumerate() {
        progress.show(subject.name(), k as f64 / robots.len() as f64);
        let robot = Robot::load(subject, amount.states)?;
        of_robot(&robot, &amount, &compiler, &mut rows, &mut refused)?;
    }
    section.summary.push(summary(&rows));
    section.tables.push(Table {
        id: "generated-times".into(),
        title: "Plan, its straight-line code, and a peer".into(),
        caption: format!(
            "Nanoseconds of a call from y without a guess, medians of batches that take turns. \
            With code: an answer by the code of `sarrus generate`, or by the plan where that \
            leaves a state to it; in rows: a state of {} asked at once. Code and bare: the least \
            of {TURNS} runs of the function's test program, and of it without checks and pairs; \
            of robots with Newton's method without its closures, which stay the plan's. Peer: \
            its fastest method with an error of at most {EQUAL:.0e} or ours (of a state q alone, \
            from a guess), and its time over ours with code, or by the plan where there is none. \
            The code has the plan's bits on 4096 states. Compiler: {}.",
            amount.states,
            compiler.name()
        ),
        columns: columns(
            "robot | asked | operations | plan | with code | in rows | code | bare | \
            code / bare | largest error | peer | peer / ours",
        ),
        rows: rows.iter().map(Row::cells).collect(),
    });
    if !refused.is_empty() {
        section.tables.push(Table {
            id: "generated-refused".into(),
            title: "Left to the plan".into(),
            caption: "What has no straight-line code, and why.".into(),
            columns: columns("robot | asked | reason"),
            rows: refused,
        });
    }
    Ok(section)
}

/// A question to a robot.
struct Row {
    robot: &'static str,
    question: Question,
    /// Nanoseconds of the plan.
    plan: f64,
    /// Largest error of the plan by size; its code has the same.
    error: f64,
    code: Option<Code>,
    /// Nanoseconds of the peer.
    peer: Option<f64>,
}

/// Times of the straight-line code of a plan.
struct Code {
    operations: usize,
    /// Nanoseconds in process, with the plan for states that the code leaves to it.
    in_process: f64,
    /// Nanoseconds of one state among many in a batch.
    in_rows: f64,
    /// Nanoseconds of the function in its test program, and without its checks.
    alone: f64,
    bare: f64,
}

impl Row {
    /// Nanoseconds of an answer under `--kernel auto`.
    fn ours(&self) -> f64 {
        self.code.as_ref().map_or(self.plan, |code| code.in_process)
    }

    fn gain(&self) -> Option<f64> {
        Some(self.peer? / self.ours())
    }

    fn cells(&self) -> Vec<String> {
        let or_none = |cell: Option<String>| cell.unwrap_or_else(|| "-".to_owned());
        let of_code = |cell: fn(&Code) -> String| or_none(self.code.as_ref().map(cell));
        vec![
            self.robot.to_owned(),
            self.question.name().to_owned(),
            of_code(|code| code.operations.to_string()),
            format!("{:.0}", self.plan),
            of_code(|code| format!("{:.0}", code.in_process)),
            of_code(|code| format!("{:.0}", code.in_rows)),
            of_code(|code| format!("{:.0}", code.alone)),
            of_code(|code| format!("{:.0}", code.bare)),
            of_code(|code| format!("{:.2}", code.alone / code.bare)),
            exponent(self.error),
            or_none(self.peer.map(|ns| format!("{ns:.0}"))),
            or_none(self.gain().map(|gain| format!("{gain:.1}"))),
        ]
    }
}

/// The ranges of the ratios.
fn summary(rows: &[Row]) -> String {
    let range = |ratios: &mut dyn Iterator<Item = f64>| {
        let mut least = f64::INFINITY;
        let mut most = 0.0_f64;
        ratios.for_each(|ratio| (least, most) = (least.min(ratio), most.max(ratio)));
        (least <= most).then(|| format!("{least:.2} to {most:.2}"))
    };
    let gains = |question: Question| {
        let gains = &mut rows.iter().filter(|row| row.question == question).filter_map(Row::gain);
        let name = question.name();
        range(gains).map(|gains| format!("; {name} of Pinocchio takes {gains} times ours"))
    };
    let coded = &mut rows.iter().filter_map(|row| Some(row.plan / row.code.as_ref()?.in_process));
    let mut text = match range(coded) {
        None => "Straight-line code: none".to_owned(),
        Some(ratios) => format!("Straight-line code: {ratios} times as fast as the plan"),
    };
    let shares = rows.iter().filter_map(|row| row.code.as_ref());
    let shares = range(&mut shares.map(|code| code.in_rows / code.in_process));
    shares.into_iter().for_each(|shares| text += &format!(", in rows {shares} of its time"));
    Question::CHOSEN.into_iter().filter_map(gains).for_each(|gain| text += &gain);
    text
}

/// Adds the rows of one robot.
fn of_robot(
    robot: &Robot,
    amount: &Amount,
    compiler: &Compiler,
    rows: &mut Vec<Row>,
    refused: &mut Vec<Vec<String>>,
) -> Outcome {
    let variant = robot.variants.first().ok_or("no variant")?;
    let model = &variant.compiled.model;
    let shared = Arc::new(model.clone());
    let start = if variant.closures == "analytic" { Start::None } else { Start::Warm };
    let mut references = References::new(robot);
    let mut cases = Vec::new();
    let mut made = Vec::new();
    for question in Question::CHOSEN {
        let plan = Plan::new(model, &question.query())?;
        let folder = Folder::new(&format!("{}-{}", robot.name, question.name()));
        let generated = Generated::new(model, &plan, compiler, &folder);
        let (kernel, code) = match generated {
            Ok(generated) => {
                let (alone, bare) = generated.alone()?;
                let Generated { kernel, operations, .. } = generated;
                let [in_process, in_rows] = [f64::NAN; 2];
                let code = Code { operations, in_process, in_rows, alone, bare };
                (Some(Arc::new(kernel)), Some(code))
            }
            Err(reason) => {
                let name = robot.name.to_owned();
                refused.push(vec![name, question.name().to_owned(), reason.to_string()]);
                (None, None)
            }
        };
        let case = |kernel| Case::new(robot, model, plan.clone(), kernel);
        cases.extend([case(None), case(kernel.clone()), case(kernel).in_rows(&shared)]);
        made.push((question, code));
    }
    let times = interleaved(&mut cases, amount.rounds, |_| {})?;
    let (runs, _) = peers(robot, 0, amount.of_peer)?;
    for (k, (question, mut code)) in made.into_iter().enumerate() {
        if let Some(code) = &mut code {
            code.in_process = times[3 * k + 1].median();
            code.in_rows = times[3 * k + 2].median() / robot.states.len() as f64;
        }
        let mut error = 0.0_f64;
        let want = layout(robot, question);
        for state in 0..robot.states.len() {
            let case = &mut cases[3 * k];
            case.answer(state).ok()?;
            let key = (question, 0, Start::None);
            error = worse(error, references.error(key, &want, state, &case.planned.output)?);
        }
        let least = EQUAL.max(error);
        rows.push(Row {
            robot: robot.name,
            question,
            plan: times[3 * k].median(),
            error,
            code,
            peer: fastest(&mut references, (question, start), &runs, least)?,
        });
    }
    Ok(())
}

/// Nanoseconds of the fastest run of a peer whose largest error is at most `bound`.
fn fastest(
    references: &mut References<'_>,
    (question, start): (Question, Start),
    runs: &[Run],
    bound: f64,
) -> Outcome<Option<f64>> {
    let series = series(runs, question, &mut |state, answer: &[f64]| {
        references.of_peer((question, start), state, answer)
    })?;
    let points = series.iter().flat_map(|series| &series.points);
    Ok(points.filter(|of| of.y <= bound).map(|of| of.x).min_by(f64::total_cmp))
}

/// Code of one plan: the shared object, and the programs that time it.
struct Generated {
    kernel: NativeKernel,
    operations: usize,
    /// The test programs of the function with and without checks.
    programs: [sarrus_generate::Built; 2],
}

impl Generated {
    fn new(model: &Model, plan: &Plan, compiler: &Compiler, folder: &Folder) -> Outcome<Generated> {
        let traced = Kernel::trace(model, plan)?;
        let build = |kernel: &Kernel, name: &str, flags: &[&str]| {
            let source = Source::new(kernel, model, name);
            Compiler::write(&source, &folder.0)?;
            compiler.build(&source, &folder.0, flags, &Cancel::default())
        };
        let checked = build(&traced, "checked", &[])?;
        let bare = build(&traced.unchecked(), "bare", &["-DSARRUS_PORTABLE", "-DSARRUS_SINGLE"])?;
        Ok(Generated {
            kernel: NativeKernel::open(&checked.library, model, plan)?,
            operations: traced.operations(),
            programs: [checked, bare],
        })
    }

    /// Nanoseconds of a call of both, as their test programs print them.
    fn alone(&self) -> Outcome<(f64, f64)> {
        let mut least = [f64::INFINITY; 2];
        for _ in 0..TURNS {
            for (least, program) in least.iter_mut().zip(&self.programs) {
                let words = program.test(&Cancel::default())?;
                let words = words.lines().next().unwrap_or_default();
                let ns = words.rsplit("; ").next().and_then(|end| end.split(' ').next());
                let ns: Option<f64> = ns.and_then(|ns| ns.parse().ok());
                *least = least.min(ns.ok_or_else(|| format!("no time: {words}"))?);
            }
        }
        Ok((least[0], least[1]))
    }
}
