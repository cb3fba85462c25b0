//! Small robots with closures that no bundled robot has.

use sarrus_dynamics::description::{
    Description, Inertial, Limits, Placement, SubmechanismKind as Kind,
};
use sarrus_dynamics::{CutJoint, DescriptionBuilder, LinkId};

use super::small::{X, Y, finish};
use crate::Outcome;

/// The name of each and its maker.
pub(crate) const RARE: [(&str, fn() -> Outcome<Description>); 3] =
    [("four_bar", four_bar), ("slider_crank", slider_crank), ("differential", differential)];

const BASE: LinkId = LinkId::BASE;

fn four_bar() -> Outcome<Description> {
    let mut of = begun("four_bar", Kind::FourBar);
    let crank = of.revolute("crank", BASE, X).link();
    let coupler = of.revolute("coupler", crank, X).origin([0.0, 0.0, 0.3]).link();
    let follower = of.revolute("follower", BASE, X).origin([0.0, 0.5, 0.0]).link();
    pin(&mut of, (coupler, [0.0, 0.55, 0.12]), (follower, [0.0, 0.05, 0.42]));
    limited(of, &[crank], &[crank])
}

fn slider_crank() -> Outcome<Description> {
    let mut of = begun("slider_crank", Kind::SliderCrank);
    let crank = of.revolute("crank", BASE, X).link();
    let coupler = of.revolute("coupler", crank, X).origin([0.0, 0.0, 0.3]).link();
    let slider = of.prismatic("slider", BASE, Y).origin([0.0, 0.8, 0.0]).link();
    pin(&mut of, (coupler, [0.0, 0.8, -0.3]), (slider, [0.0; 3]));
    limited(of, &[crank], &[slider])
}

fn differential() -> Outcome<Description> {
    let mut of = begun("differential", Kind::Differential);
    let pitch = of.revolute("pitch", BASE, Y).link();
    let roll = of.revolute("roll", pitch, X).link();
    let left = of.revolute("left", BASE, Y).origin([0.0, 0.1, 0.0]).link();
    let right = of.revolute("right", BASE, Y).origin([0.0, -0.1, 0.0]).link();
    of.couple(left, [(pitch, 1.0), (roll, 1.0)], 0.0);
    of.couple(right, [(pitch, 1.0), (roll, -1.0)], 0.0);
    limited(of, &[pitch, roll], &[left, right])
}

/// A mechanism without joints, whose links will all have the same inertia.
fn begun(name: &str, kind: Kind) -> DescriptionBuilder {
    let mut of = DescriptionBuilder::new(name);
    let inertia = [0.006, 0.0, 0.0, 0.005, 0.0, 0.004];
    of.default_inertial(Inertial::new(0.8, [0.01, 0.1, 0.05], inertia)).submechanism(name, kind);
    of
}

/// Cuts in the plane of the bars, at a point of each link.
fn pin(of: &mut DescriptionBuilder, a: (LinkId, [f64; 3]), b: (LinkId, [f64; 3])) {
    let at = |xyz| Placement { xyz, ..Placement::default() };
    let cut = of.cut("pin", a.0, b.0).placements(at(a.1), at(b.1));
    cut.joint(CutJoint::PlanarRevolute { axis: X });
}

/// The description, with the same limits of all joints.
fn limited(of: DescriptionBuilder, y: &[LinkId], u: &[LinkId]) -> Outcome<Description> {
    let mut robot = finish(of, y, u)?;
    let limits = Limits { lower: -3.0, upper: 3.0, velocity: 10.0, effort: 1000.0 };
    robot.joints.iter_mut().for_each(|joint| joint.limits = Some(limits));
    Ok(robot)
}
