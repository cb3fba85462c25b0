//! Small mechanisms that several families share; straight approaches to singular poses; states off
//! their loops.

pub(super) mod approach;
pub(super) mod open_loops;
pub(super) mod poses;
pub(super) mod trains;
pub(super) mod weights;

use sarrus_dynamics::LinkId;
use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind as Kind};

use crate::Outcome;
use crate::stress::harness::robot::{Slide, Turn, X, Y, Z, cut, finish, joint, mechanism};

pub(crate) const BASE: LinkId = LinkId::BASE;

/// Crank, coupler and rocker of four different lengths: A, B, C, D in the plane x y.
pub(crate) const LOOSE: [[f64; 2]; 4] = [[0.0, 0.0], [0.2, 0.9], [1.4, 1.0], [2.1, -0.1]];
/// A rhombus, which folds flat.
pub(crate) const RHOMBUS: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];
/// A crank that turns all round.
pub(crate) const GRASHOF: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 0.3], [0.9, 0.6], [1.0, 0.0]];

/// A four-bar cut at C with the rows named; with six rows it is a chain of four joints, welded to
/// the base.
pub(crate) fn four_bar(
    [a, b, c, d]: [[f64; 2]; 4],
    kind: Kind,
    which: &str,
) -> Outcome<Description> {
    let at = |p: [f64; 2]| [p[0], p[1], 0.0];
    let mut of = mechanism(kind);
    let crank = joint(&mut of, BASE, Turn, at(a), Z);
    let coupler = joint(&mut of, crank, Turn, at(b), Z);
    if which.len() < 6 {
        let rocker = joint(&mut of, BASE, Turn, at(d), Z);
        cut(&mut of, coupler, rocker, at(c), which);
    } else {
        let rocker = joint(&mut of, coupler, Turn, at(c), Z);
        let last = joint(&mut of, rocker, Turn, at(d), Z);
        cut(&mut of, BASE, last, [0.3, 0.1, 0.7], which);
    }
    finish(of, &[crank], &[crank])
}

/// The crank's angle at which coupler and rocker of [`LOOSE`] lie in one line, from its lengths.
pub(crate) fn toggle() -> f64 {
    let far = |a: [f64; 2], b: [f64; 2]| f64::hypot(b[0] - a[0], b[1] - a[1]);
    let [a, b, c, d] = LOOSE;
    let crank = far(a, b);
    let reach = far(b, c) + far(c, d);
    let ground = far(d, a);
    let angle =
        f64::acos((crank * crank + ground * ground - reach * reach) / (2.0 * crank * ground));
    f64::atan2(d[1], d[0]) + angle - f64::atan2(b[1], b[0])
}

/// A rocker of 0.9 at the origin, a stator at (1, 0) whose slider passes 0.3 beside its pivot.
pub(crate) fn lambda(kind: Kind) -> Outcome<Description> {
    let arm = 0.9;
    let aside = 0.3;
    let heading = f64::atan2(arm, -1.0) - f64::asin(aside / f64::hypot(1.0, arm));
    let mut of = mechanism(kind);
    let rocker = joint(&mut of, BASE, Turn, [0.0; 3], Z);
    let stator = joint(&mut of, BASE, Turn, [1.0, 0.0, 0.0], Z);
    let slider =
        joint(&mut of, stator, Slide, [0.8, 0.1, 0.0], [heading.cos(), heading.sin(), 0.0]);
    cut(&mut of, rocker, slider, [0.0, arm, 0.0], "xy");
    finish(of, &[rocker], &[slider])
}

/// The rocker's angle at which the pin of [`lambda`] is as near to the stator's pivot as the
/// slider's line may pass it.
pub(crate) fn reach_of_lambda() -> f64 {
    f64::acos((0.81 + 1.0 - 0.09) / 1.8) - std::f64::consts::FRAC_PI_2
}

/// Bricard's linkage of a cube, cut by a weld or, `open`, at its last revolute; singular at −π/6.
pub(crate) fn bricard(open: bool) -> Outcome<Description> {
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, -1.0, 1.0],
        [0.0, -1.0, 1.0],
        [0.0, 0.0, 1.0],
    ];
    let mut of = mechanism(Kind::Numerical);
    let mut links = vec![BASE];
    for (at, axis) in points.into_iter().zip([Y, Z, X, Y, Z, X]).take(if open { 5 } else { 6 }) {
        links.push(joint(&mut of, links[links.len() - 1], Turn, at, axis));
    }
    let first = links[1];
    let last = links[links.len() - 1];
    cut(&mut of, BASE, last, points[5], if open { "xyzbc" } else { "xyzabc" });
    finish(of, &[first], &[first])
}

/// A door on a hinge, pushed by a rod between two ball joints; `spin`: the rod may turn about
/// itself, which moves nothing else.
pub(crate) fn door(spin: bool) -> Outcome<Description> {
    let foot = [-0.6, 0.3, 0.2];
    let head = [1.1, 1.0, 0.5];
    let along: [f64; 3] = std::array::from_fn(|k| head[k] - foot[k]);
    let mut of = mechanism(Kind::Numerical);
    let door = joint(&mut of, BASE, Turn, [1.0, 0.0, 0.0], Z);
    let mut rod = joint(&mut of, BASE, Turn, foot, Z);
    rod = joint(&mut of, rod, Turn, foot, Y);
    if spin {
        rod = joint(&mut of, rod, Turn, foot, along);
    }
    rod = joint(&mut of, rod, Slide, foot, along);
    cut(&mut of, door, rod, head, "xyz");
    finish(of, &[door], &[rod])
}

/// Rods in a row on parallel axes, 1 m and 1 kg each, the first on the base.
pub(crate) fn rods(n: usize) -> Outcome<Description> {
    let mut of = mechanism(Kind::Serial);
    let inertia = [0.001, 0.0, 0.0, 1.0 / 12.0, 0.0, 1.0 / 12.0];
    of.default_inertial(Inertial::new(1.0, [0.5, 0.0, 0.0], inertia));
    (0..n).fold(BASE, |on, k| joint(&mut of, on, Turn, [k as f64, 0.0, 0.0], Z));
    Ok(of.build()?)
}
