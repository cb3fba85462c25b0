//! Poses and velocities that do not fit their loops: an answer that replaces the input carries a
//! warning.

use sarrus_dynamics::description::SubmechanismKind as Kind;
use sarrus_dynamics::{Field, Request, Status};

use crate::Outcome;
use crate::measure::Effort;
use crate::page::Assessment;
use crate::robots::random::Random;
use crate::stress::harness::{At, Case, Cases, Question, Robot, State, seeds, warned};
use crate::stress::mechanisms::{GRASHOF, LOOSE, bricard, door};
use crate::stress::sweep::{Design, Subject};

use Design::{Bundled, FourBar, Made, Numerical};
use Field::*;

/// Deviation, in radians, radians per second or parts of the length, above which a replaced input
/// must be reported.
const NAMED: f64 = 1e-6;
/// Within this factor of the threshold both outcomes are right: lengths are typical ones.
const NEAR: f64 = 4.0;

pub(crate) const ROBOTS: [Subject; 14] = [
    Subject::plain("lambda", Bundled("lambda")),
    Subject::plain("wrist", Bundled("wrist")),
    Subject::plain("torso", Bundled("torso")),
    Subject::plain("five_bar", Bundled("five_bar")),
    Subject::plain("delta", Bundled("delta")),
    Subject::plain("stewart", Bundled("stewart")),
    Subject::plain("rh5v2_upper_body", Bundled("rh5v2_upper_body")),
    Subject::plain("lambda", Numerical("lambda")),
    Subject::plain("torso", Numerical("torso")),
    Subject::plain("four-bar", FourBar(LOOSE, Kind::FourBar, "xy")),
    Subject::plain("four-bar", FourBar(GRASHOF, Kind::Numerical, "xy")),
    Subject::plain("four-bar of five rows", FourBar(LOOSE, Kind::Numerical, "xyzab")),
    Subject::plain("Bricard", Made(|| bricard(false))),
    Subject::plain("door", Made(|| door(false))),
];

/// Closed states of robots, moved off their loops in one joint or in all.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    for (k, subject) in ROBOTS.iter().enumerate() {
        let robot = subject.robot()?;
        for seed in seeds(effort, [12, 200], &[]) {
            one(cases, &robot, (k as u64) << 16 | seed)?;
        }
    }
    Ok(())
}

/// A closed state, moved off its loops, given whole.
pub(crate) fn one(cases: &mut Cases, robot: &Robot, seed: u64) -> Outcome {
    let mut random = Random(3 << 32 | seed);
    let model = &robot.compiled.model;
    let mut state = State::of(robot, 0.1)?;
    state.yd.iter_mut().for_each(|x| *x *= random.next());
    let closed = Question::kinematics(&state).run(model)?;
    let mut q = closed.get(Q).to_vec();
    let mut qd = closed.get(Qd).to_vec();
    let size = random.scale(1e-12, 0.3);
    let velocity = random.coin();
    let units = robot.units(if velocity { Qd } else { Q });
    let one = random.coin().then(|| random.below(units.len()));
    let off = if velocity { &mut qd } else { &mut q };
    for (k, x) in off.iter_mut().enumerate() {
        if one.is_none_or(|one| one == k) {
            *x += size * random.next() / units[k];
        }
    }
    // a state with invalid quaternions is refused for that reason
    let of_quaternions = !velocity && model.tree_q_names().iter().any(|name| name.contains('/'));
    if of_quaternions {
        return Ok(());
    }
    let (request, mut want) = match random.below(3) {
        0 => (Request::Kinematics, vec![Q, Qd]),
        1 => (Request::InverseDynamics, vec![Q, Qd, TauY]),
        _ => (Request::ForwardDynamics, vec![Q, Qd, Ydd]),
    };
    let mut given = vec![(Q, q.clone()), (Qd, qd.clone())];
    if request == Request::ForwardDynamics {
        given.push((TauY, state.tau_y.clone()));
    }
    let projection = Field::from_name("projection");
    want.extend(projection);
    let ask = Question::new(request, given, &want);
    let answer = ask.run(model)?;
    let ok = answer.status() == Status::Ok;
    let moved =
        |field, given: &[f64], units: &[f64]| {
            let pairs = answer.get(field).iter().zip(given).zip(units);
            pairs.fold(0.0, |moved: f64, ((a, b), unit)| {
                if a.is_nan() { f64::INFINITY } else { moved.max(unit * (a - b).abs()) }
            })
        };
    let of_q = moved(Q, &q, &robot.units(Q));
    let of_qd = moved(Qd, &qd, &robot.units(Qd));
    let moved = of_q.max(of_qd);
    if ok && moved > NAMED / NEAR && moved < NAMED * NEAR {
        return Ok(());
    }
    let named = warned(answer.warnings(), "input_projected");
    let assessment = match (ok, named) {
        (false, _) if answer.is_empty() => Assessment::Failed,
        (true, false) if moved <= NAMED => Assessment::Held,
        (true, true) if moved > NAMED => Assessment::Degraded,
        _ => Assessment::FailedSilently,
    };
    let figure = projection.and_then(|field| answer.get(field).first().copied());
    let figure = figure.map_or(String::new(), |x| format!(", projection {x:.1e}"));
    let error = (ok && assessment != Assessment::Held).then_some(moved);
    let at = At::of(robot, size);
    cases.all.push(Case {
        reference: "what was given",
        reported: format!("q moved by {of_q:.1e}, qd by {of_qd:.1e}{figure}, seed {seed}"),
        assessment,
        ..cases.answered(robot, at, ask.name(), &answer, error)
    });
    Ok(())
}
