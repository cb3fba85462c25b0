//! A robot in code and two questions to it, in this process: a pendulum of 1.5 kg on 0.4 m.
//!
//! ```sh
//! cargo run --release -p sarrus-dynamics --example pendulum
//! ```

use std::error::Error;

use sarrus_dynamics::description::Inertial;
use sarrus_dynamics::{
    DescriptionBuilder, Field, FieldSet, LinkId, Plan, Query, Request, Status, Workspace,
};

const MASS: f64 = 1.5;
const LENGTH: f64 = 0.4;

/// The moment that gives ÿ, and the acceleration that this moment gives back.
fn answers(y: f64, yd: f64, ydd: f64) -> Result<(f64, f64), Box<dyn Error>> {
    // the robot: hanging at zero, turning about the y axis
    let mut robot = DescriptionBuilder::new("pendulum");
    let bob = Inertial::point(MASS, [0.0, 0.0, -LENGTH]);
    robot.revolute("pivot", LinkId::BASE, [0.0, 1.0, 0.0]).inertial(bob);
    let model = robot.compile()?.model;

    // given and wanted fields, decided once
    use Field::{TauU, Y, Yd, Ydd};
    let query = |request, given: &[Field], want| {
        Query::new(request, FieldSet::of(given), FieldSet::of(&[want]))
    };
    let inverse = Plan::new(&model, &query(Request::InverseDynamics, &[Y, Yd, Ydd], TauU))?;
    let forward = Plan::new(&model, &query(Request::ForwardDynamics, &[Y, Yd, TauU], Ydd))?;
    let mut workspace = Workspace::for_plans(&model, [&inverse, &forward]);

    // from here on nothing allocates: the loop of a controller would begin
    let mut tau = [0.0];
    let mut back = [0.0];
    let answer = inverse.run(&model, &mut workspace, &[y, yd, ydd], &mut tau);
    if answer.status != Status::Ok {
        return Err(format!("inverse dynamics: {:?}", answer.status).into());
    }
    let answer = forward.run(&model, &mut workspace, &[y, yd, tau[0]], &mut back);
    if answer.status != Status::Ok {
        return Err(format!("forward dynamics: {:?}", answer.status).into());
    }
    Ok((tau[0], back[0]))
}

fn main() -> Result<(), Box<dyn Error>> {
    let (tau, ydd) = answers(0.7, 0.3, 2.0)?;
    println!("inverse dynamics: {tau:.6} N m for 2 rad/s²");
    println!("forward dynamics: {ydd:.6} rad/s² for that moment");
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_answers_are_those_of_the_pendulums_equation() {
        // m l² ÿ + m g l sin y = τ
        for (y, yd, ydd) in [(0.0, 0.0, 0.0), (0.7, 0.3, 2.0), (-2.5, 4.0, -1.0)] {
            let (tau, back) = answers(y, yd, ydd).unwrap();
            let expected = MASS * LENGTH * (LENGTH * ydd + 9.81 * f64::sin(y));
            assert!((tau - expected).abs() < 1e-13, "{tau} {expected}");
            assert!((back - ydd).abs() < 1e-13, "{back} {ydd}");
        }
    }
}
