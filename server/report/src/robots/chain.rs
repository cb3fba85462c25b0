//! A robot of any length: lambdas in a row.

use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind};
use sarrus_dynamics::{CompileError, DescriptionBuilder, LinkId};

/// Each plane is turned against the one before.
const TWIST: f64 = 0.2;

/// Lambdas in a row, each on the rocker of the one before.
pub(crate) fn chain_of_lambdas(n: usize) -> Result<Description, CompileError> {
    let inertial = |y: f64, mass: f64| {
        Inertial::new(mass, [0.0, y, 0.01], [0.004, 0.0, 0.0, 0.002, 0.0, 0.005])
    };
    let x = [1.0, 0.0, 0.0];
    let y = [0.0, 1.0, 0.0];
    let mut robot = DescriptionBuilder::new(format!("{n} lambdas"));
    let mut on = LinkId::BASE;
    for k in 0..n {
        let start = if k == 0 { [0.0; 3] } else { [0.0, 0.2, 0.05] };
        let pivot = [start[0] - 0.114 * TWIST.sin(), start[1] + 0.114 * TWIST.cos(), start[2]];
        robot.submechanism(format!("lambda{k}"), SubmechanismKind::Rrpr);
        let named = |what: &str| (format!("{what}{k}"), format!("{what}{k}"));
        let (name, link) = named("rocker");
        let rocker = robot.revolute(name, on, x).origin(start).rpy([0.8, 0.0, TWIST]);
        let rocker = rocker.inertial(inertial(0.1, 1.2)).link_name(link).link();
        let (name, link) = named("stator");
        let stator = robot.revolute(name, on, x).origin(pivot).rpy([1.08, 0.0, TWIST]);
        let stator = stator.inertial(inertial(0.1, 0.5)).link_name(link).link();
        let (name, link) = named("slider");
        let slider = robot.prismatic(name, stator, y).origin([0.0, 0.3, 0.0]);
        let slider = slider.inertial(inertial(-0.1, 0.4)).link_name(link).link();
        let pin = robot.cut(format!("pin{k}"), rocker, slider).at_frame_of(slider);
        pin.row("y", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]).row("z", [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        robot.independent([rocker]).active([slider]);
        on = rocker;
    }
    robot.build()
}
