//! Actuator forces for a motion: `inverse_dynamics [--connect NAME]`, of a bundled robot in this
//! process or of the one that a server holds. Both print the same bits.

use sarrus_client::{Options, Robot, Source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let mut robot = match &arguments[..] {
        [] => Robot::load(&Source::Bundled("lambda".into()), &Options::default())?,
        [flag, name] if flag == "--connect" => Robot::connect(name)?,
        _ => return Err("usage: inverse_dynamics [--connect NAME]".into()),
    };
    let n_y = robot.model().independent.len();
    let n_u = robot.model().active.len();

    // positions, velocities and accelerations of the independent coordinates [rad, s]
    let y = vec![0.2; n_y];
    let yd = vec![1.0; n_y];
    let ydd = vec![0.0; n_y];
    let mut tau_u = vec![0.0; n_u];
    robot.inverse_dynamics(&y, &yd, &ydd, &mut tau_u)?;

    for (name, force) in robot.model().active.iter().zip(&tau_u) {
        println!("{name}: {force:?}");
    }
    Ok(())
}
