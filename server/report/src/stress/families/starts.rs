//! What comes in is not what it should be: guesses off their loops, quaternions not of unit length,
//! numbers that are none.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Request, Status};
use sarrus_models::{Options, Source, bundled_text, load};

use crate::Outcome;
use crate::measure::Effort;
use crate::page::Assessment;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::case::{At, Case, Cases, Reference};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::mechanisms::{LOOSE, bricard, four_bar};
use crate::stress::sweep;

use Field::*;

/// Guesses off their loops: the answer is that of the guess on its loops.
pub(crate) fn inconsistent(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("inconsistent start", "q_guess off its loops, rad or tenths of the length");
    let robots = [
        Robot::new("wrist", bundled("wrist")?)?,
        Robot::new("lambda", numerical(bundled("lambda")?))?,
        Robot::new("delta", bundled("delta")?)?,
        Robot::new("Bricard", bricard(false))?,
        Robot::new("welded four-bar", four_bar(LOOSE, Kind::Numerical, "xyzabc"))?,
        Robot::new("upper body", bundled("rh5v2_upper_body")?)?,
    ];
    for robot in &robots {
        for value in sweep(effort, -15, -1, 4) {
            let mut state = State::of(robot, 0.2)?;
            let near = State { y: state.y.iter().map(|y| 0.95 * y).collect(), ..State::default() };
            let pose = Question::pose(&near).run(&robot.compiled.model)?.get(Q).to_vec();
            let units = robot.units(Q).unwrap_or_default();
            let off = |k: usize| {
                value * ((k as f64 * 2.4).sin()) / units[k]
                    * if units[k] == 1.0 { 1.0 } else { 0.1 }
            };
            let bad: Vec<f64> = pose.iter().enumerate().map(|(k, q)| q + off(k)).collect();
            let exact = Question::kinematics(&State { guess: Some(pose), ..state.clone() });
            state.guess = Some(bad.clone());
            let at = At { value, method: robot.closures() };
            cases.ask(
                robot,
                at,
                "kinematics",
                &Question::kinematics(&state),
                &Reference::Of(&exact),
            )?;
            // q itself off its loops: its independents are y, the rest the guess
            let names = robot.compiled.model.tree_q_names();
            let y = robot
                .compiled
                .model
                .independent_q_names()
                .iter()
                .filter_map(|name| names.iter().position(|x| x == name));
            let on =
                Question::pose(&State { y: y.map(|at| bad[at]).collect(), ..State::default() });
            cases.ask(
                robot,
                at,
                "q to q",
                &Question::new(Request::Kinematics, vec![(Field::Q, bad)], &[Q]),
                &Reference::Of(&on),
            )?;
        }
    }
    Ok(())
}

/// Quaternions slightly, and then badly, off unit length.
pub(crate) fn quaternions(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("quaternion off unit length", "|length − 1|");
    let robot = Robot::new("floating Stewart", bundled("stewart_floating")?)?;
    let at = robot
        .compiled
        .model
        .independent_q_names()
        .iter()
        .position(|name| name.ends_with("/qx"))
        .ok_or("no quaternion")?;
    for value in sweep(effort, -16, 2, 9) {
        for (method, sign) in [("longer", 1.0), ("shorter", -1.0)] {
            let mut state = State::of(&robot, 0.1)?;
            let exact = state.clone();
            let length: f64 = 1.0 + sign * value;
            state.y[at..at + 4].iter_mut().for_each(|x| *x *= length);
            // beyond the tolerance there is no answer; within it the answer is that of the unit
            // quaternion
            let place = At { value, method };
            let reference = Question::inverse(&exact, &[TauY, TauU]);
            let reference = if value > 1e-6 { Reference::None } else { Reference::Of(&reference) };
            cases.ask(
                &robot,
                place,
                "ID",
                &Question::inverse(&state, &[TauY, TauU]),
                &reference,
            )?;
        }
    }
    Ok(())
}

/// NaN, infinities and numbers beyond all squares in every field of every request.
pub(crate) fn hostile(cases: &mut Cases, _: &Effort) -> Outcome {
    cases.family("not a number", "what stands in the field: 1 NaN, 2 +∞, 3 −∞, 4 1e305");
    for name in ["lambda", "stewart_floating", "rh5v2_full"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let sizes = robot.compiled.model.sizes();
        let state = State::of(&robot, 0.1)?;
        let pose = Question::kinematics(&state).run(&robot.compiled.model)?;
        let field = |field: Field| (field, pose.get(field).to_vec());
        let link = robot.description.links.len() as u16 - 1;
        let given = |of: &[(Field, &[f64])]| {
            of.iter().map(|(field, x)| (*field, x.to_vec())).collect::<Vec<_>>()
        };
        let (n_u, n_v) = (vec![1.0; sizes.n_u], vec![1.0; sizes.n_v]);
        let motion = given(&[(Y, &state.y), (Yd, &state.yd), (Ydd, &state.ydd)]);
        let asks = [
            Question::new(
                Request::Kinematics,
                [motion.clone(), vec![(QGuess, field(Q).1)]].concat(),
                &[Q, Qdd, U],
            ),
            Question::new(
                Request::Kinematics,
                vec![field(Q), field(Qd), field(Qdd)],
                &[Q, Yd, Ydd],
            ),
            Question::new(
                Request::Kinematics,
                vec![field(U), field(Ud), field(Udd), (QGuess, pose.get(Q).to_vec())],
                &[Q, Yd, Ydd],
            ),
            Question::new(Request::InverseDynamics, motion, &[TauY, TauU])
                .pushed(&[link], vec![1.0; 6]),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauY, &state.tau_y)]),
                &[Ydd, Qdd],
            ),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauU, &n_u)]),
                &[Ydd, Qdd],
            ),
            Question::new(
                Request::ForwardDynamics,
                given(&[(Y, &state.y), (Yd, &state.yd), (TauQ, &n_v)]),
                &[Ydd, Qdd],
            ),
        ];
        for ask in &asks {
            for (k, (field, numbers)) in ask.given.iter().enumerate() {
                for (method, bad, value) in [
                    ("NaN", f64::NAN, 1.0),
                    ("+∞", f64::INFINITY, 2.0),
                    ("−∞", f64::NEG_INFINITY, 3.0),
                    ("1e305", 1e305, 4.0),
                ] {
                    let mut broken = ask.clone();
                    broken.given[k].1[numbers.len() / 2] = bad;
                    let at = At { value, method };
                    let asked = format!("{}, {}", ask.name(), field.name());
                    // a huge number may be answered where the answer is right
                    let reference = if bad.is_finite() { Reference::Same } else { Reference::None };
                    cases.ask(&robot, at, &asked, &broken, &reference)?;
                }
            }
        }
    }
    Ok(())
}

/// The same in the numbers of a file, with what is no joint or link at all: refused, with the
/// place.
pub(crate) fn files(cases: &mut Cases, _: &Effort) -> Outcome {
    cases.family("faulty file", "fault, by its number");
    let (urdf, yaml) = bundled_text("lambda").ok_or("no lambda")?;
    let faults: [(&str, &str, &str); 16] = [
        ("mass NaN", "<mass value=\"1.2\"/>", "<mass value=\"NaN\"/>"),
        ("mass infinite", "<mass value=\"1.2\"/>", "<mass value=\"inf\"/>"),
        ("mass negative", "<mass value=\"1.2\"/>", "<mass value=\"-1.2\"/>"),
        ("mass beyond double", "<mass value=\"1.2\"/>", "<mass value=\"1e999\"/>"),
        ("inertia NaN", "ixx=\"0.014\"", "ixx=\"nan\""),
        ("inertia negative", "ixx=\"0.014\"", "ixx=\"-0.014\""),
        ("inertia of no body", "ixx=\"0.014\"", "ixx=\"14\""),
        ("inertia without mass", "<mass value=\"1.2\"/>", "<mass value=\"0\"/>"),
        ("origin NaN", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 nan 0.0\""),
        ("origin infinite", "xyz=\"0.0 0.11402 0.0\"", "xyz=\"0.0 1e400 0.0\""),
        ("axis zero", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 0 0\"/>"),
        ("axis NaN", "<axis xyz=\"0.0 1.0 0.0\"/>", "<axis xyz=\"0 nan 0\"/>"),
        ("axis of a loop zero", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, 0, 0]"),
        ("axis of a loop NaN", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 0, .nan, 0]"),
        ("axis of a loop along no freedom", "axis: [0, 0, 0, 0, 1, 0]", "axis: [0, 0, 0, 1, 0, 0]"),
        ("every link without mass", "", ""),
    ];
    for (k, (name, from, to)) in faults.into_iter().enumerate() {
        let replaced = |text: &str| {
            if from.is_empty() { without_mass(text) } else { text.replacen(from, to, 1) }
        };
        let source = Source::Text {
            urdf: replaced(urdf).into(),
            submechanisms: Some(replaced(yaml).into()),
        };
        let blank = cases.blank("lambda", At { value: k as f64, method: "file" }, name);
        let case = match load(&source, &Options::default()) {
            Err(error) => {
                let reported = error.to_string().lines().next().unwrap_or_default().to_owned();
                Case {
                    status: "refused at load".into(),
                    reported,
                    assessment: Assessment::Failed,
                    reference: "-",
                    ..blank
                }
            }
            Ok(loaded) => Case {
                status: Status::Ok.name().into(),
                reported: format!("{} warnings", loaded.report.warnings.len()),
                ..blank
            },
        };
        cases.all.push(case);
    }
    Ok(())
}

/// A URDF with every mass and inertia zero.
fn without_mass(urdf: &str) -> String {
    urdf.split("<inertial>")
        .enumerate()
        .map(
            |(k, part)| {
                if k == 0 { part } else { part.split_once("</inertial>").map_or(part, |x| x.1) }
            },
        )
        .collect()
}
