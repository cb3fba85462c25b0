//! Other engines on the same robots and states: programs of `benches/peers/`, which read the robot
//! as text and time themselves.
//!
//! A missing peer is not an error: the page shows the command that builds it.

pub mod compare;
pub mod exported;
mod text;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::Outcome;
use crate::page::{PEERS, PROGRAMS, Point, Series};
use crate::reference::worse;
use crate::robots::{Question, Robot};

/// The folder of the programs below the build folder.
const FOLDER: &str = "peers";
/// The command that builds them.
const BUILD: &str = "benches/peers/build.sh";

/// A method of a peer with one setting.
#[derive(Clone, Debug)]
pub struct Run {
    /// The fields of its answers, from y, ẏ on; for states q alone.
    pub question: Question,
    /// Its name for a legend, the engine's first.
    pub name: String,
    /// Such as its tolerance.
    pub setting: String,
    /// Median of a call.
    pub ns: f64,
    /// One answer for each state.
    pub answers: Vec<Vec<f64>>,
}

impl Run {
    /// The largest error of its answers; `error` is that of an answer to the state of this number.
    /// NaN if a number is missing.
    pub(crate) fn worst(
        &self,
        mut error: impl FnMut(usize, &[f64]) -> Outcome<f64>,
    ) -> Outcome<f64> {
        let mut worst = 0.0;
        for (state, answer) in self.answers.iter().enumerate() {
            worst = worse(worst, error(state, answer)?);
        }
        Ok(worst)
    }
}

/// A peer's answers about a robot.
#[derive(Clone, Debug)]
pub enum Peer {
    /// It was not measured, for this reason.
    Missing(String),
    /// It was measured.
    Measured {
        /// Its name with its version and its compiler's.
        engine: String,
        /// Every method with every setting.
        runs: Vec<Run>,
    },
}

/// The runs of all peers on a robot, and the reasons of the missing ones: each method is timed for
/// about this long; guesses and closed poses are those of the variant at `place`.
///
/// # Errors
///
/// A program that cannot be run, or whose output is malformed.
pub fn peers(robot: &Robot, place: usize, seconds: f64) -> Outcome<(Vec<Run>, Vec<String>)> {
    let mut runs = Vec::new();
    let mut missing = Vec::new();
    for name in engines() {
        match peer(name, robot, place, seconds)? {
            Peer::Measured { runs: of_peer, .. } => runs.extend(of_peer),
            Peer::Missing(why) => missing.push(why),
        }
    }
    Ok((runs, missing))
}

/// The names that [`peer`] takes, those of the programs.
pub fn engines() -> impl Iterator<Item = &'static str> {
    PROGRAMS.into_iter()
}

/// One peer's answers, as [`peers`].
///
/// # Errors
///
/// As [`peers`].
pub fn peer(engine: &str, robot: &Robot, place: usize, seconds: f64) -> Outcome<Peer> {
    let known = PEERS.into_iter().zip(PROGRAMS).find(|(_, program)| *program == engine);
    let (engine, word) = known.ok_or_else(|| format!("{engine} is no known engine"))?;
    let missing = |why: String| Ok(Peer::Missing(format!("{engine}: not run{why}")));
    let name = &robot.description.name;
    let Some(program) = program(word) else {
        return missing(format!(", its program is not built; {BUILD} {word} builds it."));
    };
    let text = match text::input(robot, place, seconds) {
        Ok(text) => text,
        Err(reason) => return missing(format!(" on {name}, {reason}.")),
    };
    let answered = answers(&mut Command::new(&program), engine, &text, robot.states.len())?;
    answered.map_or_else(|why| missing(format!(" on {name}, {why}")), Ok)
}

/// Inverse kinematics by the peers that have it, as `benches/peers/ik.py` reads and writes it; the
/// answer to a target is its error.
pub(crate) fn searches(input: &str, n_targets: usize) -> Outcome<Peer> {
    let missing = |why: String| Peer::Missing(format!("pink, mink, placo: not run{why}"));
    let Some(program) = program("ik") else {
        return Ok(missing(format!(", not installed; {BUILD} ik installs them.")));
    };
    let answered = answers(Command::new(program).arg("--rows"), "", input, n_targets)?;
    Ok(answered.unwrap_or_else(|why| missing(format!(", {why}"))))
}

/// The answers of a program, or how it ended without.
fn answers(
    command: &mut Command,
    engine: &str,
    text: &str,
    n_states: usize,
) -> Outcome<Result<Peer, String>> {
    let program = command.get_program().display().to_string();
    let fault = |error: std::io::Error| format!("{program}: {error}");
    let (written, output) = spoken(command, text).map_err(fault)?;
    if !output.status.success() {
        let why = String::from_utf8_lossy(&output.stderr);
        return Ok(Err(format!("it ends with {}: {}", output.status, why.trim())));
    }
    written.map_err(fault)?;
    let answers = read(engine, &String::from_utf8_lossy(&output.stdout), n_states);
    Ok(Ok(answers.map_err(|reason| format!("{program}: {reason}"))?))
}

/// The output of a program with this input, and whether it took it. The program reads everything
/// before it writes; one that stops early closes its end and prints the reason.
fn spoken(command: &mut Command, text: &str) -> std::io::Result<(std::io::Result<()>, Output)> {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn()?;
    let input = child.stdin.take();
    let written = input.map_or(Ok(()), |mut input| input.write_all(text.as_bytes()));
    Ok((written, child.wait_with_output()?))
}

/// Series for a figure of error over time: one for each method of the question, a point for each
/// setting. `error` is that of an answer to the state of this number; a method without numbers on
/// some state has no error.
pub fn series(
    runs: &[Run],
    question: Question,
    error: &mut dyn FnMut(usize, &[f64]) -> Outcome<f64>,
) -> Outcome<Vec<Series>> {
    let mut all: Vec<Series> = Vec::new();
    for run in runs.iter().filter(|run| run.question == question) {
        let worst = run.worst(&mut *error)?;
        let point = Point { x: run.ns, y: worst, label: run.setting.clone() };
        Series::add(&mut all, run.name.clone(), point).competes = true;
    }
    Ok(all)
}

/// The program in this program's build folder, or in the default one.
fn program(name: &str) -> Option<PathBuf> {
    let place = Path::new(FOLDER).join(name);
    let here = std::env::current_exe().ok();
    // target/PROFILE/sarrus
    let built = here
        .iter()
        .flat_map(|path| path.ancestors().skip(1).take(3))
        .map(|folder| folder.join(&place));
    built.chain([Path::new("target").join(&place)]).find(|path| path.is_file())
}

/// Reads the program's output.
fn read(name: &str, text: &str, n_states: usize) -> Result<Peer, String> {
    let mut lines = text.lines();
    let engine = lines
        .next()
        .and_then(|line| line.strip_prefix("engine "))
        .ok_or("no name of the engine")?
        .to_owned();
    let mut runs = Vec::new();
    while let Some(line) = lines.next() {
        let head = || {
            let (question, rest) = line.strip_prefix("run ")?.split_once(' ')?;
            let [method, setting, ns] = rest.split("; ").collect::<Vec<_>>().try_into().ok()?;
            let all = Question::CHOSEN.into_iter().chain(Question::DERIVATIVES);
            let mut all = all.chain([Question::InverseKinematics]);
            let question = all.find(|of| of.name().to_uppercase() == question)?;
            let name = format!("{name} {method}").trim_start().to_owned();
            Some(Run {
                question,
                name,
                setting: setting.to_owned(),
                ns: ns.parse().ok()?,
                answers: Vec::new(),
            })
        };
        let mut run = head().ok_or_else(|| format!("a line that is none of a run: {line}"))?;
        for _ in 0..n_states {
            let numbers = lines.next().map(|line| {
                line.split_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>()
            });
            run.answers.push(
                numbers
                    .and_then(Result::ok)
                    .ok_or_else(|| format!("{}: a state without numbers", run.name))?,
            );
        }
        runs.push(run);
    }
    Ok(Peer::Measured { engine, runs })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic, reason = "a test that fails panics")]
mod tests {
    use sarrus_dynamics::{Plan, Status, Workspace};

    use super::*;
    use crate::robots::Robot;
    use crate::robots::{Subject, packed};

    #[test]
    fn pinocchio_agrees_where_it_is_built() {
        let mut compared = 0;
        for name in ["lambda", "torso", "wrist", "stewart", "rh5v2_upper_body", "rh5v2_full"] {
            let robot = Robot::load(Subject::Bundled(name), 4).unwrap();
            let runs = match peer("pinocchio", &robot, 0, 0.0).unwrap() {
                Peer::Missing(why) => return println!("not run: {why}"),
                Peer::Measured { runs, .. } => runs,
            };
            let model = &robot.variants[0].compiled.model;
            let mut workspace = Workspace::new(model);
            for run in &runs {
                let (question, tolerance) = match (run.question, run.setting.as_str()) {
                    (Question::InverseDynamics, "tolerance 1e-12") => {
                        (Question::InverseDynamics, 1e-9)
                    }
                    (Question::ForwardDynamics, "tolerance 1e-12" | "mu 1e-8, iterations 2")
                        if !run.name.contains("lcaba") =>
                    {
                        (Question::ForwardDynamics, 1e-9)
                    }
                    // its error has a floor
                    (Question::ForwardDynamics, "mu 1e-4, iterations 2") => {
                        (Question::ForwardDynamics, 1e-6)
                    }
                    _ => continue,
                };
                compared += 1;
                let plan = Plan::new(model, &question.query()).unwrap();
                let mut ours = vec![0.0; plan.want().len()];
                for (state, theirs) in robot.states.iter().zip(&run.answers) {
                    assert_eq!(
                        plan.run(model, &mut workspace, &packed(&plan, state, 0), &mut ours).status,
                        Status::Ok
                    );
                    let size = ours.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
                    let worst = ours
                        .iter()
                        .zip(theirs)
                        .fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
                    assert!(
                        theirs.len() == ours.len() && worst <= tolerance * size,
                        "{name}, {} {}: {worst:e}",
                        run.name,
                        run.setting
                    );
                }
            }
        }
        assert_eq!(compared, 5 * 6, "methods of six robots");
    }

    #[test]
    fn what_a_peer_writes_is_read_and_what_it_leaves_out_is_told() {
        let text =
            "engine Pinocchio 9\nrun FD lcaba; mu 1e-8, iterations 2; 123.5\n1 -nan \n2 3 \n";
        let Peer::Measured { engine, runs } = read("Pinocchio", text, 2).unwrap() else {
            panic!("measured")
        };
        assert_eq!((engine.as_str(), runs.len()), ("Pinocchio 9", 1));
        let run = &runs[0];
        assert_eq!(
            (run.question, run.name.as_str(), run.setting.as_str()),
            (Question::ForwardDynamics, "Pinocchio lcaba", "mu 1e-8, iterations 2")
        );
        assert_eq!((run.ns, run.answers[1].as_slice()), (123.5, &[2.0, 3.0][..]));
        assert!(run.answers[0][1].is_nan());
        let drawn = series(&runs, Question::ForwardDynamics, &mut |state, answer| {
            Ok(answer[0] - state as f64)
        })
        .unwrap();
        assert_eq!((drawn.len(), drawn[0].points[0].x, drawn[0].points[0].y), (1, 123.5, 1.0));
        assert!(
            series(&runs, Question::ForwardDynamics, &mut |_, answer| Ok(answer[1..].iter().sum()))
                .unwrap()
                .iter()
                .all(|series| series.points[0].y.is_nan())
        );
        let text_of_ik = "engine inverse kinematics\nrun IK pink 4; stops at 1e-03; 9\n1e-4\nnan\n";
        let Peer::Measured { runs, .. } = read("", text_of_ik, 2).unwrap() else {
            panic!("measured")
        };
        assert_eq!((runs[0].question, &*runs[0].name), (Question::InverseKinematics, "pink 4"));
        assert!(read("Pinocchio", text, 3).unwrap_err().contains("without numbers"));
        assert!(read("Pinocchio", "", 1).is_err());
    }
}
