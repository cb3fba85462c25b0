//! Mechanisms of light and heavy links, drawn at random.

use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind as Kind};
use sarrus_dynamics::{CutJoint, LinkId};

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::harness::{Turn, Z, finish, joint};
use crate::stress::mechanisms::BASE;
use crate::stress::mechanisms::trains::{begun, rotation};

/// A link of this mass, between a hand and a thigh in size.
fn weighing(random: &mut Random, mass: f64) -> Inertial {
    let size = random.scale(0.01, 0.1);
    let centre = [(); 3].map(|()| size * random.next());
    let moments = [(); 3].map(|()| mass * size * size * random.between(0.8, 1.2));
    Inertial::new(mass, centre, [moments[0], 0.0, 0.0, moments[1], 0.0, moments[2]])
}

/// A platform in the plane on two to four legs of three or four hinges, each but the first closed
/// by a weld of six rows; masses over some decades.
pub(crate) fn planar_platform(random: &mut Random, masses: [f64; 2]) -> Outcome<Description> {
    let mut of = begun(random, Kind::Numerical);
    let n_legs = 2 + random.below(3);
    let mut independent: Vec<LinkId> = Vec::new();
    let mut all: Vec<LinkId> = Vec::new();
    let mut platform = BASE;
    for leg in 0..n_legs {
        let heading = std::f64::consts::TAU * leg as f64 / n_legs as f64;
        let at = |radius: f64, turn: f64| {
            [radius * (heading + turn).cos(), radius * (heading + turn).sin(), 0.0]
        };
        let n = 3 + random.below(2);
        let mut on = BASE;
        for k in 0..n {
            let mass = if random.coin() {
                random.scale(masses[0], masses[1])
            } else if k + 1 == n || random.below(3) == 0 {
                masses[1]
            } else {
                masses[0]
            };
            of.default_inertial(weighing(random, mass));
            let radius = 1.2 - 0.9 * k as f64 / (n - 1) as f64;
            // a leg is bent to either side
            let bend = random.between(0.15, 0.35) * if k % 2 == 0 { 1.0 } else { -1.0 };
            on = joint(&mut of, on, Turn, at(radius, bend), Z);
            all.push(on);
            if leg == 0 || (n == 4 && k == 0) {
                independent.push(on);
            }
        }
        if leg == 0 {
            platform = on;
        } else {
            of.cut(format!("weld{leg}"), platform, on).at([0.0; 3]).joint(CutJoint::Weld);
        }
    }
    // other valid ones, with probability ½
    let n = independent.len();
    for _ in 0..if random.coin() { 20 } else { 0 } {
        let mut other = all.clone();
        while other.len() > n {
            other.remove(random.below(other.len()));
        }
        let mut tried = of.clone();
        tried.independent(other.iter().copied()).active(other);
        if tried.compile().is_ok() {
            return Ok(tried.build()?);
        }
    }
    finish(of, &independent, &independent)
}

/// Chains of four or five hinges in the plane, each from an existing link to another one, to which
/// its end is welded by six rows; light and some heavy links, and any of the hinges independent.
pub(crate) fn planar_loops(random: &mut Random, masses: [f64; 2]) -> Outcome<Description> {
    let mut of = begun(random, Kind::Numerical);
    let mut links: Vec<(LinkId, [f64; 3])> = vec![(BASE, [0.0; 3]), (BASE, [1.0, 0.2, 0.0])];
    let mut independent = Vec::new();
    for chain in 0..2 + random.below(2) {
        let (from, start) = links[random.below(links.len())];
        let others: Vec<_> = links.iter().filter(|of| of.1 != start).copied().collect();
        let (to, end) = others[random.below(others.len())];
        let n = 4 + random.below(2);
        let mut on = from;
        let mut hinges = Vec::new();
        let across = [start[1] - end[1], end[0] - start[0], 0.0];
        let side = if random.coin() { 1.0 } else { -1.0 };
        for k in 0..n {
            let mass = if k + 1 == n || random.below(3) == 0 {
                masses[1]
            } else {
                random.scale(masses[0], 10.0 * masses[0])
            };
            of.default_inertial(weighing(random, mass));
            let part = k as f64 / (n - 1) as f64;
            let arc = side * (0.4 * std::f64::consts::PI * part).sin() * random.between(0.4, 1.0);
            let point =
                std::array::from_fn(|i| start[i] + part * (end[i] - start[i]) + arc * across[i]);
            on = joint(&mut of, on, Turn, point, Z);
            hinges.push(on);
            links.push((on, point));
        }
        of.cut(format!("weld{chain}"), to, on).at(end).joint(CutJoint::Weld);
        for _ in 0..n - 3 {
            independent.push(hinges.remove(random.below(hinges.len())));
        }
    }
    finish(of, &independent, &independent)
}

/// Links in a row: heavy and light ones alternating, in two halves, or at random.
pub(crate) fn row(random: &mut Random, n: usize, heavy: f64, light: f64) -> Outcome<Description> {
    let mut of = begun(random, Kind::Serial);
    let by_turns = random.below(3);
    let spatial = random.coin();
    let mut on = BASE;
    for k in 0..n {
        let is_light = match by_turns {
            0 => k % 2 == 1,
            1 => 2 * k >= n,
            _ => random.coin(),
        };
        let mass = if is_light { light } else { heavy };
        of.default_inertial(weighing(random, mass));
        let axis = if spatial { rotation(random)[0] } else { Z };
        on = joint(&mut of, on, Turn, [0.3 * k as f64, 0.0, 0.0], axis);
    }
    Ok(of.build()?)
}

/// A tree of hinges on any axes whose links become lighter from the base outwards; some float.
pub(crate) fn tree(random: &mut Random, n: usize, decades: f64) -> Outcome<Description> {
    let mut of = begun(random, Kind::Serial);
    let mut root = BASE;
    if random.coin() {
        of.default_inertial(weighing(random, 10.0));
        root = of.floating("trunk", BASE).link();
    }
    let mut links: Vec<(LinkId, i32, [f64; 3])> = vec![(root, 0, [0.0; 3])];
    let deepest = random.one_of(&[8, 12, 16]);
    for _ in 0..n {
        // on one of the last links, so that arms become long
        let (on, depth, at) = links[links.len() - 1 - random.below(links.len().min(4))];
        let (on, depth, at) = if depth < deepest { (on, depth, at) } else { links[0] };
        // some joints coincide with the next, and their links are massless
        let together = random.below(3) == 0;
        let part = if together { 1.0 } else { f64::from(depth) / f64::from(deepest) };
        of.default_inertial(weighing(random, 10.0 * 10f64.powf(-decades * part)));
        let point = if together { at } else { at.map(|x| x + random.between(-0.3, 0.3)) };
        let link = joint(&mut of, on, Turn, point, rotation(random)[0]);
        links.push((link, depth + 1, point));
    }
    Ok(of.build()?)
}
