//! Small mechanisms that the stress cases and the tests share, with their singular poses.
//!
//! At zero every frame is parallel to the root's, so a joint is a point, a kind and an axis.

use sarrus_dynamics::description::{Description, Inertial, JointKind, SubmechanismKind as Kind};
use sarrus_dynamics::{DescriptionBuilder, LinkId};

use crate::Outcome;

/// Unit vector along x.
pub const X: [f64; 3] = [1.0, 0.0, 0.0];
/// Unit vector along y.
pub const Y: [f64; 3] = [0.0, 1.0, 0.0];
/// Unit vector along z.
pub const Z: [f64; 3] = [0.0, 0.0, 1.0];
pub use JointKind::{Prismatic as Slide, Revolute as Turn};

/// A mechanism without joints, whose links will weigh 1 kg each.
pub fn mechanism(kind: Kind) -> DescriptionBuilder {
    let mut of = DescriptionBuilder::new("mechanism");
    let inertia = [0.2, 0.01, 0.02, 0.3, 0.0, 0.25];
    of.gravity([0.3, -9.7, 1.1]).default_inertial(Inertial::new(1.0, [0.1, 0.2, -0.1], inertia));
    of.submechanism("loop", kind);
    of
}

/// Adds joint k at a point and along an axis of the root; returns its link, k + 1.
pub fn joint(
    of: &mut DescriptionBuilder,
    parent: LinkId,
    kind: JointKind,
    at: [f64; 3],
    axis: [f64; 3],
) -> LinkId {
    let k = of.n_joints();
    let joint = of.joint(format!("j{k}"), kind, parent).link_name(format!("link{}", k + 1));
    joint.at(at).axis(axis).link()
}

/// Cuts at a point of the root; the rows are letters, `xyz` along and `abc` about the root's axes.
pub fn cut(
    of: &mut DescriptionBuilder,
    predecessor: LinkId,
    successor: LinkId,
    at: [f64; 3],
    which: &str,
) {
    let row = |c: char| std::array::from_fn(|k| f64::from("abcxyz".find(c) == Some(k)));
    let cut = of.cut("cut0", predecessor, successor).at(at);
    which.chars().fold(cut, |cut, c| cut.row(c, row(c)));
}

/// Sets the independent and active joints, and builds the description.
///
/// # Errors
/// A faulty mechanism.
pub fn finish(
    mut of: DescriptionBuilder,
    independent: &[LinkId],
    active: &[LinkId],
) -> Outcome<Description> {
    of.independent(independent.iter().copied()).active(active.iter().copied());
    Ok(of.build()?)
}

/// Points A, B, C, D of a four-bar in the plane x y with four different lengths.
pub const LOOSE: [[f64; 2]; 4] = [[0.0, 0.0], [0.2, 0.9], [1.4, 1.0], [2.1, -0.1]];
/// Points of a rhombus, which folds flat.
pub const RHOMBUS: [[f64; 2]; 4] = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]];

/// A four-bar cut at C with the rows of `which`; with six rows a chain of four joints that is
/// welded to the base.
///
/// # Errors
/// Rows that the kind does not allow.
pub fn four_bar([a, b, c, d]: [[f64; 2]; 4], kind: Kind, which: &str) -> Outcome<Description> {
    let at = |p: [f64; 2]| [p[0], p[1], 0.0];
    let mut of = mechanism(kind);
    let crank = joint(&mut of, LinkId::BASE, Turn, at(a), Z);
    let coupler = joint(&mut of, crank, Turn, at(b), Z);
    if which.len() < 6 {
        let rocker = joint(&mut of, LinkId::BASE, Turn, at(d), Z);
        cut(&mut of, coupler, rocker, at(c), which);
    } else {
        let rocker = joint(&mut of, coupler, Turn, at(c), Z);
        let last = joint(&mut of, rocker, Turn, at(d), Z);
        cut(&mut of, LinkId::BASE, last, [0.3, 0.1, 0.7], which);
    }
    finish(of, &[crank], &[crank])
}

/// Angle of the crank at which coupler and rocker of [`LOOSE`] are aligned, from its lengths.
pub fn toggle() -> f64 {
    angle_of_crank(|crank, coupler, rocker| [crank, coupler + rocker])
}

/// Angle of the crank of [`LOOSE`] at which the two sides that its lengths give close a triangle on
/// the ground: from the crank's pivot, and from the rocker's.
pub(crate) fn angle_of_crank(sides: impl Fn(f64, f64, f64) -> [f64; 2]) -> f64 {
    let far = |a: [f64; 2], b: [f64; 2]| f64::hypot(b[0] - a[0], b[1] - a[1]);
    let [a, b, c, d] = LOOSE;
    let [near, across] = sides(far(a, b), far(b, c), far(c, d));
    let ground = far(d, a);
    let cosine = (near * near + ground * ground - across * across) / (2.0 * near * ground);
    f64::atan2(d[1], d[0]) + cosine.acos() - f64::atan2(b[1], b[0])
}

/// Length of the rocker of [`lambda`].
pub(crate) const ARM_OF_LAMBDA: f64 = 0.9;

/// Direction in which the slider of [`lambda`] moves at zero.
pub(crate) fn way_of_lambda() -> [f64; 3] {
    let aside = 0.3;
    let heading =
        f64::atan2(ARM_OF_LAMBDA, -1.0) - f64::asin(aside / f64::hypot(1.0, ARM_OF_LAMBDA));
    [heading.cos(), heading.sin(), 0.0]
}

/// A rocker of 0.9 at the origin, and a stator at (1, 0) whose slider passes its pivot at 0.3.
///
/// # Errors
/// A kind that is no lambda's.
pub fn lambda(kind: Kind) -> Outcome<Description> {
    let mut of = mechanism(kind);
    let rocker = joint(&mut of, LinkId::BASE, Turn, [0.0; 3], Z);
    let stator = joint(&mut of, LinkId::BASE, Turn, [1.0, 0.0, 0.0], Z);
    let slider = joint(&mut of, stator, Slide, [0.8, 0.1, 0.0], way_of_lambda());
    cut(&mut of, rocker, slider, [0.0, ARM_OF_LAMBDA, 0.0], "xy");
    finish(of, &[rocker], &[slider])
}

/// Angle of the rocker at the end of [`lambda`]'s reach, where the pin is 0.3 from the stator's
/// pivot.
pub fn reach_of_lambda() -> f64 {
    f64::acos((0.81 + 1.0 - 0.09) / 1.8) - std::f64::consts::FRAC_PI_2
}

/// Bricard's linkage of a cube, cut by a weld or, if `open`, at its last revolute joint; singular
/// at −π/6.
pub fn bricard(open: bool) -> Outcome<Description> {
    let points =
        [[1.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, -1.0, 1.0], [0.0, -1.0, 1.0], [0.0, 0.0, 1.0]];
    let mut of = mechanism(Kind::Numerical);
    let first = joint(&mut of, LinkId::BASE, Turn, [0.0; 3], Y);
    let mut last = first;
    for (at, axis) in points.into_iter().zip([Z, X, Y, Z, X]).take(if open { 4 } else { 5 }) {
        last = joint(&mut of, last, Turn, at, axis);
    }
    cut(&mut of, LinkId::BASE, last, points[4], if open { "xyzbc" } else { "xyzabc" });
    finish(of, &[first], &[first])
}

/// A door on a hinge, pushed by a rod between two ball joints; with `spin` the rod turns freely
/// about its own axis.
pub fn door(spin: bool) -> Outcome<Description> {
    let foot = [-0.6, 0.3, 0.2];
    let head = [1.1, 1.0, 0.5];
    let along: [f64; 3] = std::array::from_fn(|k| head[k] - foot[k]);
    let mut of = mechanism(Kind::Numerical);
    let door = joint(&mut of, LinkId::BASE, Turn, [1.0, 0.0, 0.0], Z);
    let mut rod = joint(&mut of, LinkId::BASE, Turn, foot, Z);
    rod = joint(&mut of, rod, Turn, foot, Y);
    if spin {
        rod = joint(&mut of, rod, Turn, foot, along);
    }
    rod = joint(&mut of, rod, Slide, foot, along);
    cut(&mut of, door, rod, head, "xyz");
    finish(of, &[door], &[rod])
}
