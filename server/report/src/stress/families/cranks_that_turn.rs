//! Poses that a path reaches: cranks after many turns, trains of regular stages, poses near zero of
//! legs with rods near their dead points.

use std::f64::consts::TAU;

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, Request, Status};

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::families::change_points::Bars;
use crate::stress::harness::{
    At, Cases, Question, Reference, Slide, State, Turn, cut, finish, joint, mechanism,
};
use crate::stress::mechanisms::BASE;
use crate::stress::mechanisms::approach::followed;
use crate::stress::mechanisms::trains::{Draw, leg, train};

use Field::*;

/// 2π less its nearest double.
const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;

/// A crank-rocker at 60 and 1000 rad and at another angle.
pub(crate) fn crank(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(5 << 32 | seed);
    let of = crank_rocker(&mut random)?;
    let name = format!("crank-rocker, seed {seed}");
    let at = At { value: 0.0, method: "numerical" };
    let Some(robot) = cases.load(&name, at, of) else { return Ok(()) };
    for y in [60.0, 1000.0, random.scale(3.0, 3000.0), -random.scale(3.0, 3000.0)] {
        let turns = (y / TAU).round();
        let turned = Dd::from(turns) * (Dd::from(TAU) + Dd::from(TAU_LOW));
        let reduced = (Dd::from(y) - turned).hi();
        let want = [Qd, Qdd];
        let ask = |y: f64| {
            let given = vec![(Y, vec![y]), (Yd, vec![0.7]), (Ydd, vec![-0.4])];
            Question::new(Request::Kinematics, given, &want)
        };
        let near = ask(reduced);
        // if double-double has no answer either, its path has one
        let exact = match followed(&robot.compiled.exact, &[reduced])? {
            Some(guess) => {
                let mut exact = near;
                exact.given.push((QGuess, guess.iter().map(|q: &Dd| q.hi()).collect()));
                exact
            }
            None => near,
        };
        let at = At { value: y.abs(), method: "numerical" };
        cases.ask(&robot, at, "kinematics", &ask(y), &Reference::Of(&exact))?;
    }
    Ok(())
}

/// Grashof bars with the crank as the shortest.
fn crank_rocker(random: &mut Random) -> Outcome<Description> {
    let crank = random.between(0.15, 0.35);
    let [coupler, rocker] = [(); 2].map(|()| random.between(0.75, 1.05));
    let zero = random.between(0.0, TAU);
    let pin = [0.0; 2];
    let mut bars = Bars { name: "crank-rocker", crank, coupler, rocker, ground: 1.0, zero, pin };
    let [left, right] = bars.pins(0.0).ok_or("bars that do not meet")?;
    bars.pin = if random.coin() { left } else { right };
    bars.robot(random, Kind::Numerical)
}

/// A train or a leg at a pose that small steps from zero reach.
pub(crate) fn reached(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(6 << 32 | seed);
    let (name, of, size) = if random.coin() {
        let angle = random.scale(0.03, 0.1);
        let stages = 2 + random.below(2);
        let draw = Draw { stages, angle: [angle, angle], ..Draw::default() };
        let train = train(&mut random, draw)?;
        let far = random.one_of(&[1.0, 5.0, 30.0]);
        ("train of regular four-bars", train.description, far * train.sines * angle)
    } else {
        ("leg of three closed chains", leg(&mut random)?, random.scale(0.01, 0.15))
    };
    arrive(cases, &format!("{name}, seed {seed}"), of, size, &mut random)
}

/// A loop in space that is closed in two directions: its levers are out of sight in part.
pub(crate) fn in_two_directions(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(7 << 32 | seed);
    let mut of = mechanism(Kind::Numerical);
    let ends = 1 + random.below(2);
    let mut links = [BASE; 2];
    let mut first = BASE;
    for k in 0..3 {
        let [x, y] = [(); 2].map(|()| [(); 3].map(|()| random.between(-0.7, 0.7)));
        let end = &mut links[usize::from(k >= ends)];
        *end = joint(&mut of, *end, Turn, x, y);
        first = if k == 0 { *end } else { first };
    }
    let at = [(); 3].map(|()| random.between(-0.7, 0.7));
    cut(&mut of, links[0], links[1], at, "xy");
    // a zero pose where the rows do not determine the joints is no mechanism
    let Ok(of) = finish(of, &[first], &[first]) else { return Ok(()) };
    let size = random.scale(0.05, 0.7);
    arrive(cases, &format!("two rows in space, seed {seed}"), of, size, &mut random)
}

/// A slide drives two slides and a turn in space: poses where two assemblies come near are close to
/// the way from zero.
pub(crate) fn slides_in_space(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(8 << 32 | seed);
    let mut of = mechanism(Kind::Numerical);
    let mut axis = || [(); 3].map(|()| random.between(-1.0, 1.0));
    let lone = joint(&mut of, BASE, Slide, [0.0; 3], axis());
    let arm = joint(&mut of, BASE, Turn, [0.0; 3], axis());
    let carried = joint(&mut of, arm, Slide, axis(), axis());
    let driver = joint(&mut of, carried, Slide, [0.0; 3], axis());
    cut(&mut of, lone, driver, axis(), "xyz");
    let Ok(of) = finish(of, &[driver], &[driver]) else { return Ok(()) };
    let size = random.scale(0.05, 0.7);
    arrive(cases, &format!("slides in space, seed {seed}"), of, size, &mut random)
}

/// Poses that small steps from zero reach are reached in one.
fn arrive(
    cases: &mut Cases,
    name: &str,
    of: Description,
    size: f64,
    random: &mut Random,
) -> Outcome {
    let at = At { value: size, method: "numerical" };
    let Some(robot) = cases.load(name, at, of) else { return Ok(()) };
    for _ in 0..4 {
        let n = robot.compiled.model.sizes().n_qy;
        let y: Vec<f64> = (0..n).map(|_| size * random.next()).collect();
        // a pose that no path reaches is skipped
        let Some(guess) = followed(&robot.compiled.model, &y)? else { continue };
        let state = State { y, ..State::default() };
        let exact = Question::pose(&State { guess: Some(guess), ..state.clone() });
        let case =
            cases.ask(&robot, at, "pose", &Question::pose(&state), &Reference::Of(&exact))?;
        if case.status != Status::Ok.name() {
            case.reported = format!("small steps arrive; {}", case.reported);
        }
    }
    Ok(())
}
