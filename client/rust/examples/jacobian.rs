//! The Jacobian of a link over the independent velocities, beside the link's twist: v = J ẏ.

use sarrus_client::{Field, Options, Request, Robot, Source};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut robot = Robot::load(&Source::Bundled("r3_lambda_r".into()), &Options::default())?;
    let link = robot.model().links.last().ok_or("a robot without links")?.clone();
    let n_y = robot.model().independent.len();

    // inputs and outputs, fixed once
    let plan = robot
        .query(Request::Kinematics)
        .given(["y", "yd"])
        .want(["frame_twist", "jacobian_independent"])
        .frames([&link])
        .prepare()?;
    let layout = robot.plan(plan).ok_or("a plan that is not there")?.want();
    let slot = |field| layout.slot(field).map(|slot| slot.range()).ok_or("a field that is missing");
    let twist = slot(Field::FrameTwist)?;
    let jacobian = slot(Field::JacobianIndependent)?;
    let mut output = vec![0.0; layout.len()];

    let y = vec![0.2; n_y];
    let yd = vec![0.5; n_y];
    robot.ask(plan, &[y, yd.clone()].concat(), &mut output)?.ok()?;

    // six rows of n_y numbers: three of the angular velocity, three of the velocity
    let mut largest: f64 = 0.0;
    for (row, twist) in output[jacobian].chunks(n_y).zip(&output[twist]) {
        let product: f64 = row.iter().zip(&yd).map(|(entry, rate)| entry * rate).sum();
        largest = largest.max((product - twist).abs());
        println!("{row:7.3?}  {twist:7.3}");
    }
    println!("{link}: largest difference {largest:e}");
    Ok(())
}
