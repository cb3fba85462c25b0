//! Families that compute with states off their loops: projection and Baumgarte's stabilisation.

use sarrus_dynamics::scalar::{Dd, Real};
use sarrus_dynamics::{Field, ImplicitForm, Status};

use crate::Outcome;
use crate::stress::harness::{
    At, Case, Cases, Question, Robot, State, error, off_loops, powers, with,
};
use crate::stress::mechanisms::bricard;
use crate::stress::sweep::{Design, Subject, Sweep};

use Design::{Bundled, Made};

const ROBOTS: [Subject; 5] = [
    Subject::plain("lambda", Bundled("lambda")),
    Subject::plain("wrist", Bundled("wrist")),
    Subject::plain("torso", Bundled("torso")),
    Subject::plain("Bricard", Made(|| bricard(false))),
    Subject::plain("four bars", Bundled("four_bars_2")),
];

/// Poses off their loops are projected onto them; the reported distance is checked, and the
/// remaining gap is measured in double-double.
pub(crate) const PROJECTION: Sweep =
    Sweep { values: |effort| powers(effort, -15, 0, 5), robots: &ROBOTS, ask: project };

/// Stabilisation from none to stiff on loops that are open by a millionth.
pub(crate) const STABILISATION: Sweep = Sweep {
    values: |effort| with(&[0.0], &powers(effort, 0, 9, 3)),
    robots: &ROBOTS,
    ask: stabilise,
};

fn project(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let model = &robot.compiled.model;
    let (mut q, mut qd) = off_loops(robot, value)?;
    let given = q.clone();
    let status = ImplicitForm::new(model).project(model, &mut q, &mut qd);
    let ok = status == Status::Ok;
    let error = if ok { Some(open(robot, &q)?) } else { None };
    let empty = q.iter().chain(&qd).all(|x| x.is_nan());
    let moved = q.iter().zip(&given).fold(0.0, |moved: f64, (a, b)| moved.max((a - b).abs()));
    let at = At::of(robot, value);
    cases.all.push(Case {
        reference: "loops in double-double",
        reported: if ok { format!("moved by {moved:.1e}") } else { String::new() },
        ..cases.ended(&robot.name, at, "projection", (status, error, empty))
    });
    Ok(())
}

/// Distance of a pose from the closed one with its independents, by size.
fn open(robot: &Robot, q: &[f64]) -> Outcome<f64> {
    let y = robot.independents(q);
    let state = State { y, guess: Some(q.to_vec()), ..State::default() };
    let closed = Question::pose(&state).run(&robot.compiled.exact)?;
    if closed.status() != Status::Ok {
        return Ok(f64::INFINITY);
    }
    Ok(error(robot, Field::Q, q, closed.get(Field::Q), 0.0))
}

fn stabilise(cases: &mut Cases, robot: &Robot, value: f64) -> Outcome {
    let (q, qd) = off_loops(robot, 1e-6)?;
    let model = &robot.compiled.model;
    let exact = &robot.compiled.exact;
    let tau = vec![0.0; qd.len()];
    let mut qdd = vec![0.0; qd.len()];
    let gains = (value, value);
    let status = ImplicitForm::new(model).accelerations(model, &q, &qd, &tau, &[], gains, &mut qdd);
    let wide = |x: &[f64]| x.iter().map(|x| Dd::from(*x)).collect::<Vec<Dd>>();
    let [q, qd, tau] = [&q, &qd, &tau].map(|x| wide(x));
    let gains = (Dd::from(value), Dd::from(value));
    let mut reference = vec![Dd::ZERO; qd.len()];
    let same =
        ImplicitForm::new(exact).accelerations(exact, &q, &qd, &tau, &[], gains, &mut reference);
    let error = match (status, same) {
        (Status::Ok, Status::Ok) => Some(error(robot, Field::Qdd, &qdd, &reference, 0.0)),
        (Status::Ok, _) => Some(f64::INFINITY),
        _ => None,
    };
    let empty = qdd.iter().all(|x| x.is_nan());
    let at = At { value, method: "kkt" };
    cases.all.push(cases.ended(&robot.name, at, "q̈", (status, error, empty)));
    Ok(())
}
