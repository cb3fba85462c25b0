//! A robot of any length: lambdas in a row.

use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind};
use sarrus_dynamics::{CompileError, DescriptionBuilder, LinkId};

use crate::robots::small::{X, Y};

/// Each plane is turned against the one before.
const TWIST: f64 = 0.2;

/// Lambdas in a row, each on the rocker of the one before.
pub(crate) fn chain_of_lambdas(n: usize) -> Result<Description, CompileError> {
    lambdas_in_a_row(n, false).0.build()
}

/// Lambdas in a row under construction, and their sliders: each lambda is on the rocker of the one
/// before or, if `on_sliders`, every second one on the slider.
pub fn lambdas_in_a_row(n: usize, on_sliders: bool) -> (DescriptionBuilder, Vec<LinkId>) {
    let inertial = |y: f64, mass: f64| {
        Inertial::new(mass, [0.0, y, 0.01], [0.004, 0.0, 0.0, 0.002, 0.0, 0.005])
    };
    let mut robot = DescriptionBuilder::new(format!("{n} lambdas"));
    let mut on = LinkId::BASE;
    let mut sliders = Vec::new();
    for k in 0..n {
        let start = if k == 0 { [0.0; 3] } else { [0.0, 0.2, 0.05] };
        let pivot = [start[0] - 0.114 * TWIST.sin(), start[1] + 0.114 * TWIST.cos(), start[2]];
        robot.submechanism(format!("lambda{k}"), SubmechanismKind::Rrpr);
        let name = |part: &str| format!("{part}{k}");
        let rocker = robot.revolute(name("rocker"), on, X).origin(start).rpy([0.8, 0.0, TWIST]);
        let rocker = rocker.inertial(inertial(0.1, 1.2)).link_name(name("rocker")).link();
        let stator = robot.revolute(name("stator"), on, X).origin(pivot).rpy([1.08, 0.0, TWIST]);
        let stator = stator.inertial(inertial(0.1, 0.5)).link_name(name("stator")).link();
        let slider = robot.prismatic(name("slider"), stator, Y).origin([0.0, 0.3, 0.0]);
        let slider = slider.inertial(inertial(-0.1, 0.4)).link_name(name("slider")).link();
        let pin = robot.cut(format!("pin{k}"), rocker, slider).at_frame_of(slider);
        pin.row("y", [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]).row("z", [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        robot.independent([rocker]).active([slider]);
        sliders.push(slider);
        on = if on_sliders && k % 2 == 1 { slider } else { rocker };
    }
    (robot, sliders)
}
