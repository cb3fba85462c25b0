//! Trains of four-bars near their dead points, drawn at random: each stage's rocker carries the
//! next one's crank pin, so that their ratios multiply.

use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind as Kind};
use sarrus_dynamics::{CutJoint, DescriptionBuilder, LinkId};

use crate::Outcome;
use crate::robots::random::Random;
use crate::stress::harness::{Slide, Turn, finish, joint};
use crate::stress::mechanisms::plane::{Point, about, along, cross, distance, intersections};
use crate::stress::mechanisms::{ARM_OF_LAMBDA, BASE, reach_of_lambda, way_of_lambda};

/// One stage: crank pin, pin between coupler and rocker, rocker's pivot, and where the rocker's
/// arm ends, which is the next stage's crank pin.
#[derive(Clone, Copy, Debug)]
struct Stage {
    crank: Point,
    pin: Point,
    pivot: Point,
    /// The rocker's direction of motion where it slides, else zero.
    line: Point,
}

/// Parameters of a train.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Draw {
    /// Its stages.
    pub(crate) stages: usize,
    /// The angle between each coupler and its rocker is drawn between these.
    pub(crate) angle: [f64; 2],
    /// Bars are drawn between 1/2 and 3/2, else they are 1.
    pub(crate) lengths: bool,
    /// Some rockers slide.
    pub(crate) sliders: bool,
    /// The zero pose is another one, and turning the crank leads near the dead points.
    pub(crate) turned: bool,
    /// The plane is random too.
    pub(crate) tilted: bool,
}

/// A train, the independents' values near the dead points, and the product of the sines there.
#[derive(Clone, Debug)]
pub(crate) struct Train {
    pub(crate) description: Description,
    pub(crate) y: Vec<f64>,
    pub(crate) sines: f64,
    /// The least of the angles.
    pub(crate) least: f64,
}

/// A train of one crank.
pub(crate) fn train(random: &mut Random, draw: Draw) -> Outcome<Train> {
    let length = |random: &mut Random| if draw.lengths { random.between(0.5, 1.5) } else { 1.0 };
    let mut stages = Vec::new();
    let mut tip = [0.0, length(random)];
    let mut sines = 1.0;
    let mut least = f64::INFINITY;
    for _ in 0..draw.stages {
        let delta = random.scale(draw.angle[0], draw.angle[1]);
        let coupler = length(random);
        let rocker = length(random);
        let arm = length(random);
        let heading = if draw.lengths { random.between(-0.5, 0.5) } else { 0.0 };
        let pin = along(tip, heading, coupler);
        let pivot = along(pin, heading - delta, rocker);
        let slides = draw.sliders && random.below(3) == 0;
        // a slider moves across its rocker
        let across = heading - delta + std::f64::consts::FRAC_PI_2;
        let line = if slides { [across.cos(), across.sin()] } else { [0.0; 2] };
        stages.push(Stage { crank: tip, pin, pivot, line });
        (sines, least) = (sines * delta.sin(), least.min(delta));
        let lean = if draw.lengths { random.between(-0.6, 0.6) } else { 0.0 };
        tip = along(pivot, std::f64::consts::FRAC_PI_2 + lean, arm);
    }
    let mut y = 0.0;
    if draw.turned {
        (stages, y) = away(random, stages, [0.05, 0.4], 40);
    }
    let axes = if draw.tilted { rotation(random) } else { [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    Ok(Train { description: built(random, &stages, axes)?, y: vec![y], sines, least })
}

/// The points after a turn of the first crank that is drawn between these, and the crank's way
/// back; the way there has to be open at this many steps.
fn away(
    random: &mut Random,
    stages: Vec<Stage>,
    [least, most]: [f64; 2],
    steps: u32,
) -> (Vec<Stage>, f64) {
    let mut turn = random.between(least, most) * if random.coin() { 1.0 } else { -1.0 };
    for _ in 0..8 {
        let way = (1..=steps).map(|k| turned(&stages, turn * f64::from(k) / f64::from(steps)));
        if let Some(away) = way.collect::<Option<Vec<_>>>().and_then(|mut all| all.pop()) {
            return (away, -turn);
        }
        turn *= -0.7;
    }
    (stages, 0.0)
}

/// The points of all stages after the first crank has turned about the origin; none if a stage does
/// not reach.
fn turned(stages: &[Stage], mut turn: f64) -> Option<Vec<Stage>> {
    let mut crank_pivot = Some([0.0; 2]);
    let mut shift = [0.0; 2];
    let mut away = Vec::new();
    for stage in stages {
        let crank = match crank_pivot {
            Some(pivot) => about(pivot, stage.crank, turn),
            None => [stage.crank[0] + shift[0], stage.crank[1] + shift[1]],
        };
        let coupler = distance(stage.crank, stage.pin);
        let side = cross(stage.crank, stage.pin, stage.pivot);
        let (pin, pivot);
        if stage.line == [0.0; 2] {
            let rocker = distance(stage.pin, stage.pivot);
            let pins = intersections((crank, coupler), (stage.pivot, rocker), 0.0)?;
            pin = pins.into_iter().find(|pin| cross(crank, *pin, stage.pivot) * side > 0.0)?;
            let heading = |p: Point| f64::atan2(p[1] - stage.pivot[1], p[0] - stage.pivot[0]);
            turn = heading(pin) - heading(stage.pin);
            (pivot, crank_pivot) = (stage.pivot, Some(stage.pivot));
        } else {
            // the pin moves along its line to where the coupler reaches it
            let [dx, dy] = stage.line;
            let ax = crank[0] - stage.pin[0];
            let ay = crank[1] - stage.pin[1];
            let middle = ax * dx + ay * dy;
            let off = ax * dy - ay * dx;
            let square = coupler * coupler - off * off;
            if square <= 0.0 {
                return None;
            }
            let before =
                (stage.pin[0] - stage.crank[0]) * dx + (stage.pin[1] - stage.crank[1]) * dy;
            let s = middle + square.sqrt() * before.signum();
            shift = [s * dx, s * dy];
            pin = [stage.pin[0] + shift[0], stage.pin[1] + shift[1]];
            pivot = [stage.pivot[0] + shift[0], stage.pivot[1] + shift[1]];
            crank_pivot = None;
        }
        away.push(Stage { crank, pin, pivot, line: stage.line });
    }
    Some(away)
}

/// The robot of these points, in the plane of two axes of the root.
fn built(random: &mut Random, stages: &[Stage], axes: [[f64; 3]; 2]) -> Outcome<Description> {
    let [x, y] = axes;
    let place = |p: Point| std::array::from_fn(|k| p[0] * x[k] + p[1] * y[k]);
    let z = cross_product(x, y);
    let mut of = begun(random, Kind::Numerical);
    let crank = joint(&mut of, BASE, Turn, [0.0; 3], z);
    let mut on = crank;
    let mut joints = vec![crank];
    for stage in stages {
        of.default_inertial(inertial(random));
        let coupler = joint(&mut of, on, Turn, place(stage.crank), z);
        of.default_inertial(inertial(random));
        let rocker = if stage.line == [0.0; 2] {
            joint(&mut of, BASE, Turn, place(stage.pivot), z)
        } else {
            joint(&mut of, BASE, Slide, place(stage.pivot), place(stage.line))
        };
        let cut = match random.below(6) {
            0 => CutJoint::Revolute { axis: z },
            1 => CutJoint::Spherical,
            2 => CutJoint::Cylindrical { axis: z },
            _ => CutJoint::PlanarRevolute { axis: z },
        };
        let name = format!("cut{}", joints.len());
        of.cut(name, coupler, rocker).at(place(stage.pin)).joint(cut);
        joints.extend([coupler, rocker]);
        on = rocker;
    }
    let active = if random.coin() { crank } else { on };
    finish(of, &[crank], &[active])
}

/// Four-bars and lambdas, each closed by itself, most by their closed forms and on the rocker of
/// the one before; all reach their dead points by turning their cranks.
pub(crate) fn closed_forms(random: &mut Random, stages: usize) -> Outcome<Train> {
    let mut of = begun(random, Kind::Serial);
    let mut on = BASE;
    let mut at = [0.0; 2];
    let mut y = Vec::new();
    let mut sines = 1.0;
    let mut least = f64::INFINITY;
    let z = [0.0, 0.0, 1.0];
    for k in 0..stages {
        let delta = random.scale(0.005, 0.1);
        (sines, least) = (sines * delta, f64::min(least, delta));
        let place = |p: Point| [p[0] + at[0], p[1] + at[1], 0.0];
        if random.below(3) == 0 {
            of.submechanism(format!("lambda{k}"), Kind::Rrpr);
            let rocker = joint(&mut of, on, Turn, place([0.0; 2]), z);
            let stator = joint(&mut of, on, Turn, place([1.0, 0.0]), z);
            let slider = joint(&mut of, stator, Slide, place([0.8, 0.1]), way_of_lambda());
            let pin = CutJoint::PlanarRevolute { axis: z };
            of.cut(format!("pin{k}"), rocker, slider).at(place([0.0, ARM_OF_LAMBDA])).joint(pin);
            of.independent([rocker]).active([slider]);
            // the square of the vanishing length goes with the remaining way
            y.push(reach_of_lambda() + delta * delta);
            (on, at) = (rocker, [at[0], at[1] + ARM_OF_LAMBDA]);
            continue;
        }
        let pin = along([0.0, 1.0], random.between(-0.5, 0.5), random.between(0.5, 1.5));
        let heading = f64::atan2(pin[1] - 1.0, pin[0]);
        let pivot = along(pin, heading - delta, random.between(0.5, 1.5));
        let stage = Stage { crank: [0.0, 1.0], pin, pivot, line: [0.0; 2] };
        let (stages, back) = away(random, vec![stage], [0.2, 0.6], 1);
        let stage = stages[0];
        y.push(back);
        let kind = random.one_of(&[Kind::FourBar, Kind::FourBar, Kind::Numerical]);
        of.submechanism(format!("bars{k}"), kind);
        let crank = joint(&mut of, on, Turn, place([0.0; 2]), z);
        let coupler = joint(&mut of, crank, Turn, place(stage.crank), z);
        let rocker = joint(&mut of, on, Turn, place(stage.pivot), z);
        let cut = CutJoint::PlanarRevolute { axis: z };
        of.cut(format!("pin{k}"), coupler, rocker).at(place(stage.pin)).joint(cut);
        of.independent([crank]).active([if random.coin() { crank } else { rocker }]);
        (on, at) = (rocker, [at[0] + stage.pivot[0], at[1] + stage.pivot[1]]);
    }
    Ok(Train { description: of.build()?, y, sines, least })
}

/// A train in space: each rod has two turns at its foot and a ball at its head, where it stands
/// near the plane in which it moves nothing.
pub(crate) fn spatial(random: &mut Random, stages: usize) -> Outcome<Train> {
    let mut of = begun(random, Kind::Numerical);
    let first = joint(&mut of, BASE, Turn, [0.0; 3], rotation(random)[0]);
    let mut on = first;
    let mut tip = rotation(random)[0];
    let mut sines = 1.0;
    let mut least = f64::INFINITY;
    for k in 0..stages {
        let delta = random.scale(0.005, 0.1);
        (sines, least) = (sines * delta.sin(), least.min(delta));
        (on, tip) = rod(random, &mut of, k, (on, BASE), tip, &RodAt::of(delta));
    }
    of.independent([first]).active([if random.coin() { first } else { on }]);
    Ok(Train { description: of.build()?, y: vec![0.0], sines, least })
}

/// A rod δ from its dead point, its universal joint across it unless stated otherwise.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RodAt {
    pub(crate) delta: f64,
    /// Angle between the rod and the first axis.
    pub(crate) gimbal: Option<f64>,
    /// Distance between the axes.
    pub(crate) gap: f64,
}

impl RodAt {
    fn of(delta: f64) -> RodAt {
        RodAt { delta, ..RodAt::default() }
    }
}

/// A crank and a lever with such a rod between.
pub(crate) fn one_rod(random: &mut Random, at: &RodAt) -> Outcome<Description> {
    let mut of = begun(random, Kind::Numerical);
    let [axis, tip] = rotation(random);
    let crank = joint(&mut of, BASE, Turn, [0.0; 3], axis);
    rod(random, &mut of, 0, (crank, BASE), tip, at);
    finish(of, &[crank], &[crank])
}

/// A rod from a point of a link to a lever on another link; returns the lever and a point of it.
fn rod(
    random: &mut Random,
    of: &mut DescriptionBuilder,
    k: usize,
    (from, to): (LinkId, LinkId),
    foot: [f64; 3],
    at: &RodAt,
) -> (LinkId, [f64; 3]) {
    let [axis, lever] = rotation(random);
    let across = cross_product(axis, lever);
    let (s, c) = at.delta.sin_cos();
    let (sb, cb) = random.between(-0.8, 0.8).sin_cos();
    let [length, arm, next] = [(); 3].map(|()| random.between(0.5, 1.5));
    let along: [f64; 3] =
        std::array::from_fn(|i| c * (cb * lever[i] + sb * axis[i]) + s * across[i]);
    let head: [f64; 3] = std::array::from_fn(|i| foot[i] + length * along[i]);
    let pivot: [f64; 3] = std::array::from_fn(|i| head[i] - arm * lever[i]);
    // two axes across the rod, or the first one near it
    let mut level = cross_product(along, axis);
    let upright = cross_product(along, level);
    if let Some(angle) = at.gimbal {
        let size = level.iter().map(|x| x * x).sum::<f64>().sqrt();
        level = std::array::from_fn(|i| angle.cos() * along[i] + angle.sin() * level[i] / size);
    }
    let common = cross_product(level, upright);
    let beside: [f64; 3] = std::array::from_fn(|i| foot[i] + at.gap * common[i]);
    of.default_inertial(inertial(random));
    let turn = joint(of, from, Turn, foot, level);
    let shaft = joint(of, turn, Turn, beside, upright);
    of.default_inertial(inertial(random));
    let rocker = joint(of, to, Turn, pivot, axis);
    of.cut(format!("ball{k}"), shaft, rocker).at(head).joint(CutJoint::Spherical);
    let (s, c) = random.between(-1.0, 1.0).sin_cos();
    (rocker, std::array::from_fn(|i| pivot[i] + next * (c * across[i] + s * axis[i])))
}

/// A leg of three closed chains in one mechanism: a hip, cranks on the shank, and rods that stand
/// near their dead points.
pub(crate) fn leg(random: &mut Random) -> Outcome<Description> {
    let mut of = begun(random, Kind::Numerical);
    let mut on = BASE;
    let mut independent = Vec::new();
    for k in 0..3 {
        on = joint(&mut of, on, Turn, [0.0, 0.0, -0.1 * f64::from(k)], rotation(random)[0]);
        independent.push(on);
    }
    for k in 0..3 {
        let crank = joint(&mut of, on, Turn, [0.1, 0.2 * k as f64, -0.5], rotation(random)[0]);
        independent.push(crank);
        let delta = random.scale(0.02, 0.2);
        let foot = [(); 3].map(|()| random.between(-0.6, 0.6));
        let (lever, tip) = rod(random, &mut of, k, (crank, on), foot, &RodAt::of(delta));
        // one rod moves the next
        let delta = random.scale(0.05, 0.5);
        let (last, _) = rod(random, &mut of, k + 3, (lever, on), tip, &RodAt::of(delta));
        if k == 2 {
            on = last;
        }
    }
    finish(of, &independent, &independent)
}

fn cross_product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A moving mechanism with random inertia and, in some cases, gravity.
pub(crate) fn begun(random: &mut Random, kind: Kind) -> DescriptionBuilder {
    let mut of = DescriptionBuilder::new("mechanism");
    if random.coin() {
        of.gravity([0.0, -9.81, 0.0]);
    }
    of.default_inertial(inertial(random));
    of.submechanism("loop", kind);
    of
}

/// 1 kg, its centre within 0.1 of the frame, about 0.01 kg m².
pub(crate) fn inertial(random: &mut Random) -> Inertial {
    let centre = [(); 3].map(|()| random.between(-0.1, 0.1));
    let [a, b, c] = [(); 3].map(|()| random.between(0.008, 0.012));
    Inertial::new(1.0, centre, [a, 1e-3 * random.next(), 0.0, b, 1e-3 * random.next(), c])
}

/// The first two axes of a frame that is turned at random.
pub(crate) fn rotation(random: &mut Random) -> [[f64; 3]; 2] {
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| x / length)
    };
    let x = unit([(); 3].map(|()| random.next()));
    let other = [(); 3].map(|()| random.next());
    let dot: f64 = x.iter().zip(other).map(|(a, b)| a * b).sum();
    [x, unit(std::array::from_fn(|k| other[k] - dot * x[k]))]
}
