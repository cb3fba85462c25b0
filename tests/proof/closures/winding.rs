//! Closed forms along the whole motion: whole turns of dependent joints, and the end of the reach.

use std::f64::consts::{PI, TAU};

use sarrus_dynamics::description::{Inertial, JointKind, SubmechanismKind as Kind};
use sarrus_dynamics::{DescriptionBuilder, FieldSet, LinkId, Query, QueryOptions, Request, Status};
use sarrus_tests::draft::Draft;
use sarrus_tests::run::{Fields, Robot};

use super::drawn::{four_bar, lambda, slider_crank};
use super::{Field, Z, compile, numerical};
use Field::*;

/// Largest turn of a joint in one step.
const STEP: f64 = 0.01;
/// Largest distance from the trapezoidal rule, in radians or lengths of the drawing.
const APART: f64 = 0.1;

/// Follows the answers from y alone to one side, up to where the loop cannot follow or for three
/// turns; returns by how much they leave the integral of G dy from answer to answer, and how far a
/// joint has turned.
fn follow(draft: &Draft, sign: f64) -> (f64, f64) {
    let mut robot = Robot::new(compile(&draft.description()).model);
    let mut at = |y: f64| {
        let x = robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q, G]);
        (x.answer.status == Status::Ok).then(|| (x.get(Q).to_vec(), x.get(G).to_vec()))
    };
    let (mut q, mut before) = at(0.0).expect("a closed zero pose");
    let mut y = 0.0;
    let [mut worst, mut turned] = [0.0_f64; 2];
    while y < 3.0 * TAU {
        let step = STEP / before.iter().fold(1.0, |most: f64, g| most.max(g.abs()));
        y += step;
        let Some((next, rates)) = at(sign * y) else { break };
        // beside a singular pose the rule is too rough
        if rates.iter().any(|g| g.abs() * step > 3.0 * STEP) {
            break;
        }
        for i in 0..q.len() {
            let rule = q[i] + sign * 0.5 * step * (before[i] + rates[i]);
            worst = worst.max((next[i] - rule).abs());
            turned = turned.max(next[i].abs());
        }
        (q, before) = (next, rates);
    }
    (worst, turned)
}

#[test]
fn dependents_turn_on_with_their_independent() {
    let mut beyond = 0;
    let long = |seed, straight| lambda(seed, straight, 3.0);
    let short = |seed, straight| lambda(seed, straight, 1.0);
    let kinds: [&dyn Fn(u64, bool) -> Draft; 4] = [&four_bar, &slider_crank, &short, &long];
    for (kind, draft) in kinds.into_iter().enumerate() {
        for draft in (0..60).map(|seed| draft(seed, seed % 4 == 0)).filter(|x| x.scale <= 1.0) {
            for sign in [1.0, -1.0] {
                let (apart, turned) = follow(&draft, sign);
                assert!(apart < APART, "kind {kind}, {}: off by {apart}", draft.description().name);
                beyond += usize::from(turned > PI);
            }
        }
    }
    println!("{beyond} of the ways leave (−π, π]");
    assert!(beyond > 30, "{beyond}");
}

#[test]
fn a_given_pose_keeps_the_turns_of_its_dependents() {
    for draft in (0..20).flat_map(|seed| [four_bar(seed, false), lambda(seed, false, 3.0)]) {
        let mut robot = Robot::new(compile(&draft.description()).model);
        let independent = robot.model.independent_names()[0].clone();
        let names = robot.model.tree_names().to_vec();
        let closed = robot.ask(Request::Kinematics, &[(Y, &[0.1 * draft.reach[0]])], &[Q]).ok();
        let turned = |(i, name): (usize, &String)| {
            let joint: usize = name.trim_start_matches("joint").parse().unwrap();
            let turns = draft.kinds[joint] == JointKind::Revolute && *name != independent;
            closed.get(Q)[i] + if turns { TAU * (2.0 * i as f64 - 3.0) } else { 0.0 }
        };
        let turned: Vec<f64> = names.iter().enumerate().map(turned).collect();
        let y = [0.11 * draft.reach[0]];
        for (given, apart) in [
            (robot.ask(Request::Kinematics, &[(Q, &turned)], &[Q]).ok(), 1e-13),
            (robot.ask(Request::Kinematics, &[(Y, &y), (QGuess, &turned)], &[Q]).ok(), 0.5),
        ] {
            for (found, turned) in given.get(Q).iter().zip(&turned) {
                let size = draft.scale.max(1.0).max(turned.abs());
                assert!((found - turned).abs() < apart * size, "{found} instead of {turned}");
            }
        }
    }
}

/// Asks for the nearest y where y has no answer, and there.
fn nearest(robot: &mut Robot<f64>, y: &[f64], name: &str) -> Option<Vec<f64>> {
    let query = |want| {
        let query = Query::new(Request::Kinematics, FieldSet::EMPTY, FieldSet::of(want));
        query.with_options(QueryOptions::SEARCH)
    };
    let failed: Fields<f64> = robot.ask_for(query(&[NearestY]), &[(Y, y)]);
    if failed.answer.status == Status::Ok {
        return None;
    }
    let nearest = failed.get(NearestY).to_vec();
    let rates = vec![1.0; robot.model.sizes().n_vy];
    let there = robot.ask_for(query(&[Q, GBias]), &[(Y, &nearest), (Yd, &rates)]);
    let status = there.answer.status;
    assert_eq!(status, Status::Ok, "{name}: {nearest:?}, the nearest to {y:?}");
    Some(nearest)
}

#[test]
fn the_nearest_y_to_one_beyond_the_reach_is_answered() {
    let mut asked = 0;
    let short = |seed, straight| lambda(seed, straight, 1.0);
    let kinds: [&dyn Fn(u64, bool) -> Draft; 3] = [&four_bar, &slider_crank, &short];
    for draft in (0..24).flat_map(|seed| kinds.map(|draft| draft(seed, seed % 4 == 0))) {
        let description = draft.description();
        for compiled in [compile(&description), numerical(&description)] {
            let mut robot = Robot::new(compiled.model);
            let mut closes = |y: f64| {
                robot.ask(Request::Kinematics, &[(Y, &[y])], &[Q]).answer.status == Status::Ok
            };
            let step = 0.2 * draft.reach[0];
            let Some(end) = (1..160).find(|k| !closes(f64::from(*k) * step)) else { continue };
            let [mut inside, mut beyond] = [f64::from(end - 1) * step, f64::from(end) * step];
            for _ in 0..60 {
                let middle = 0.5 * (inside + beyond);
                *(if closes(middle) { &mut inside } else { &mut beyond }) = middle;
            }
            for off in [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3] {
                let y = beyond + off * step;
                let Some(nearest) = nearest(&mut robot, &[y], &description.name) else { continue };
                let apart = (nearest[0] - beyond).abs() / step;
                assert!(apart < 1e-5, "{}: {apart:.1e} from the end", description.name);
                asked += 1;
            }
        }
    }
    println!("{asked} targets");
    assert!(asked > 100, "{asked}");
}

#[test]
fn the_nearest_y_of_several_loops_out_of_reach_is_answered() {
    let mut robot = DescriptionBuilder::new("two four-bars");
    let bob = || Inertial::sphere(1.0, [0.0; 3], 0.1);
    for (name, kind) in [("a", Kind::FourBar), ("b", Kind::Numerical), ("c", Kind::FourBar)] {
        robot.submechanism(name, kind);
        let mut turn = |joint: &str, on, at| {
            let turn = robot.revolute(format!("{joint} {name}"), on, Z).origin(at).inertial(bob());
            turn.link()
        };
        let crank = turn("crank", LinkId::BASE, [0.0; 3]);
        let coupler = turn("coupler", crank, [0.2, 0.9, 0.0]);
        let rocker = turn("rocker", LinkId::BASE, [2.1, -0.1, 0.0]);
        let pin = robot.cut(format!("pin {name}"), coupler, rocker).at([1.4, 1.0, 0.0]);
        pin.row("x", [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]).row("y", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        robot.independent([crank]);
    }
    let mut robot = Robot::new(robot.compile().unwrap().model);
    let nearest = nearest(&mut robot, &[2.5, 2.5, 0.1], "all").expect("out of reach");
    assert!((nearest[0] - nearest[1]).abs() < 1e-6, "{nearest:?}");
    assert!(nearest[0] < 2.5 && nearest[2] == 0.1, "{nearest:?}");
}
