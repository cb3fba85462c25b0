//! A robot of one's own without files: a parallelogram that its crank drives.

use sarrus_client::description::{Inertial, SubmechanismKind};
use sarrus_client::{CutJoint, DescriptionBuilder, LinkId, Robot};

/// Every joint turns about y.
const Y: [f64; 3] = [0.0, 1.0, 0.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // crank and rocker stand on the base, 0.5 m apart, 0.3 m long; the coupler lies on them
    let mut robot = DescriptionBuilder::new("parallelogram");
    robot.default_inertial(Inertial::sphere(0.4, [0.0, 0.0, 0.15], 0.05));
    robot.submechanism("bars", SubmechanismKind::FourBar);
    let crank = robot.revolute("crank", LinkId::BASE, Y).link();
    let coupler = robot.revolute("coupler", crank, Y).at([0.0, 0.0, 0.3]).link();
    let rocker = robot.revolute("rocker", LinkId::BASE, Y).at([0.5, 0.0, 0.0]).link();
    // the loop is cut where the coupler's end meets the rocker's
    robot
        .cut("pin", coupler, rocker)
        .at([0.5, 0.0, 0.3])
        .joint(CutJoint::PlanarRevolute { axis: Y });
    robot.independent([crank]);

    let mut robot = Robot::from_model(robot.compile()?);
    for closure in &robot.model().closures {
        println!("{}: {}, {:?}", closure.name, closure.type_name, closure.kind);
    }

    // all three angles from the crank's: a parallelogram's coupler does not turn
    let mut q = [0.0; 3];
    let mut qd = [0.0; 3];
    let mut qdd = [0.0; 3];
    robot.state(&[0.3], &[1.0], &[0.0], &mut q, &mut qd, &mut qdd)?;
    println!("q: {q:?}");
    let mut tau_u = [0.0];
    robot.inverse_dynamics(&[0.3], &[1.0], &[0.0], &mut tau_u)?;
    println!("tau_u: {tau_u:?}");
    Ok(())
}
