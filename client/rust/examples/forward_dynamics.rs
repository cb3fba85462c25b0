//! Motion under actuator forces: a robot that its actuators hold against gravity, and the same
//! robot let go.

use sarrus_client::{Options, Robot, Source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut robot = Robot::load(&Source::Bundled("torso".into()), &Options::default())?;
    let n_y = robot.model().independent.len();
    let n_u = robot.model().active.len();
    let y = vec![0.1; n_y];
    let still = vec![0.0; n_y];

    // the forces that hold it
    let mut tau_u = vec![0.0; n_u];
    robot.inverse_dynamics(&y, &still, &still, &mut tau_u)?;
    println!("forces: {tau_u:?}");

    let mut ydd = vec![0.0; n_y];
    robot.forward_dynamics(&y, &still, &tau_u, &mut ydd)?;
    println!("held: {ydd:?}");
    robot.forward_dynamics(&y, &still, &vec![0.0; n_u], &mut ydd)?;
    println!("let go: {ydd:?}");
    Ok(())
}
