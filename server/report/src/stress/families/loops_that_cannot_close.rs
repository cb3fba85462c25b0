//! Loops that close only at zero: hinges that are not quite parallel, or miss their common centre.

use std::f64::consts::TAU;

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::{CutJoint, Field, Request, Status};

use crate::Outcome;
use crate::page::Assessment;
use crate::robots::random::Random;
use crate::stress::harness::{At, Case, Cases, Question, Turn, Z, finish, joint, warned};
use crate::stress::mechanisms::BASE;
use crate::stress::mechanisms::poses::open_by;
use crate::stress::mechanisms::trains::{begun, rotation};

/// Radians, or part of the loop's length, up to which a loop counts as closed.
const CLOSED: f64 = 1e-6;

/// The mechanism of this seed at some poses.
pub(crate) fn one(cases: &mut Cases, seed: u64) -> Outcome {
    let mut random = Random(2 << 32 | seed);
    let misfit = random.scale(1e-9, 1e-2);
    let (name, of) = match seed % 3 {
        0 => ("tilted hinge", tilted(&mut random, misfit)?),
        1 => ("spherical four-bar", spherical(&mut random, misfit)?),
        _ => ("welded four-bar, tilted hinge", welded(&mut random, misfit)?),
    };
    let name = format!("{name}, seed {seed}");
    let at = At { value: misfit, method: "numerical" };
    let Some(robot) = cases.load(&name, at, of) else { return Ok(()) };
    let names = robot.compiled.model.tree_q_names();
    for k in 0..3 {
        let y = vec![random.between(-0.3, 0.3)];
        let given = vec![(Field::Y, y), (Field::Yd, vec![1.0])];
        let (request, want) = match k {
            0 => (Request::Kinematics, vec![Field::Q]),
            1 => (Request::Kinematics, vec![Field::Q, Field::Qd]),
            _ => (Request::InverseDynamics, vec![Field::Q, Field::TauY]),
        };
        let ask = Question::new(request, given, &want);
        let answer = ask.run(&robot.compiled.model)?;
        let q: Vec<_> = names.iter().cloned().zip(answer.get(Field::Q).iter().copied()).collect();
        let ok = answer.status() == Status::Ok;
        let open = if ok { open_by(&robot.description, &q, robot.length) } else { None };
        let assessment = match open {
            None if ok || !answer.is_empty() => Assessment::FailedSilently,
            None => Assessment::Failed,
            Some(open) if open <= CLOSED => Assessment::Held,
            Some(_) if warned(answer.warnings(), "loop_open") => Assessment::Degraded,
            Some(_) => Assessment::FailedSilently,
        };
        let error = open.filter(|_| assessment != Assessment::Held);
        cases.all.push(Case {
            reference: "all rows of the cuts",
            reported: open.map_or(String::new(), |open| format!("open by {open:.1e}")),
            assessment,
            ..cases.answered(&robot, at, ask.name(), &answer, error)
        });
    }
    Ok(())
}

/// Four points of a four-bar that moves freely near by.
fn points(random: &mut Random) -> [[f64; 3]; 4] {
    let near = |random: &mut Random, x: f64, y: f64| {
        [x + random.between(-0.15, 0.15), y + random.between(-0.15, 0.15), 0.0]
    };
    [[0.0; 3], near(random, 0.3, 0.8), near(random, 1.4, 1.0), near(random, 1.2, 0.0)]
}

/// Crank, coupler and rocker, whose last hinge leans by this much.
fn tilted(random: &mut Random, misfit: f64) -> Outcome<Description> {
    let [a, b, c, d] = points(random);
    let mut of = begun(random, Kind::Numerical);
    let crank = joint(&mut of, BASE, Turn, a, Z);
    let coupler = joint(&mut of, crank, Turn, b, Z);
    let heading = random.between(0.0, TAU);
    let lean = [misfit * heading.cos(), misfit * heading.sin(), 1.0];
    let rocker = joint(&mut of, BASE, Turn, d, lean);
    of.cut("cut", coupler, rocker).at(c).joint(CutJoint::Revolute { axis: Z });
    finish(of, &[crank], &[crank])
}

/// The bars as a chain of four hinges whose end is welded to the base.
fn welded(random: &mut Random, misfit: f64) -> Outcome<Description> {
    let points = points(random);
    let mut of = begun(random, Kind::Numerical);
    let mut on = BASE;
    let mut links = Vec::new();
    let which = 1 + random.below(3);
    let heading = random.between(0.0, TAU);
    for (k, point) in points.into_iter().enumerate() {
        let lean = [misfit * heading.cos(), misfit * heading.sin(), 1.0];
        on = joint(&mut of, on, Turn, point, if k == which { lean } else { Z });
        links.push(on);
    }
    of.cut("weld", BASE, on).at([0.5, 0.2, 0.0]).joint(CutJoint::Weld);
    finish(of, &links[..1], &links[..1])
}

/// Four axes that meet in a point, one of which misses it by this much.
fn spherical(random: &mut Random, misfit: f64) -> Outcome<Description> {
    let axis = |random: &mut Random, heading: f64| {
        let lean = random.between(0.4, 0.9);
        let heading = heading + random.between(-0.2, 0.2);
        [lean.sin() * heading.cos(), lean.sin() * heading.sin(), lean.cos()]
    };
    let mut of = begun(random, Kind::Numerical);
    let axes: Vec<[f64; 3]> = (0..4).map(|k| axis(random, TAU * f64::from(k) / 4.0)).collect();
    let across = rotation(random)[0];
    let crank = joint(&mut of, BASE, Turn, axes[0], axes[0]);
    let coupler = joint(&mut of, crank, Turn, axes[1].map(|x| 0.8 * x), axes[1]);
    let foot: [f64; 3] = std::array::from_fn(|k| axes[3][k] + misfit * across[k]);
    let rocker = joint(&mut of, BASE, Turn, foot, axes[3]);
    let cut = CutJoint::Revolute { axis: axes[2] };
    of.cut("cut", coupler, rocker).at(axes[2].map(|x| 0.9 * x)).joint(cut);
    finish(of, &[crank], &[crank])
}
