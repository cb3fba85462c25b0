//! Far targets in one jump.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::SubmechanismKind as Kind;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::mechanisms::approach::followed;
use crate::stress::mechanisms::{bricard, four_bar};

/// Far targets in one jump from zero; the reference is the pose at the end of the same way in small
/// steps.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("big jump", "rad from the guess to the target");
    let values = if effort.quick {
        vec![0.1, 0.5, 1.0, 2.0, 3.0]
    } else {
        vec![0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.4, 2.7, 3.0]
    };
    let robots = [
        Robot::new("wrist", bundled("wrist")?)?,
        Robot::new("delta", bundled("delta")?)?,
        Robot::new("squeezer", bundled("squeezer")?)?,
        Robot::new(
            "four-bar of a full turn",
            four_bar(crate::stress::mechanisms::GRASHOF, Kind::Numerical, "xy")?,
        )?,
        Robot::new("lambda numerical", numerical(bundled("lambda")?))?,
        Robot::new("Stewart numerical", numerical(bundled("stewart")?))?,
        Robot::new("Bricard", bricard(false)?)?,
    ];
    for robot in &robots {
        let direction = State::of(robot, 1.0)?.y;
        let size = direction.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for &value in &values {
            let y: Vec<f64> = direction.iter().map(|x| value * x / size).collect();
            let state = State { y: y.clone(), ..State::default() };
            let reference = match followed(&robot.compiled.exact, &y)? {
                Some(q) => Reference::Known(vec![(Field::Q, q)]),
                None => Reference::None,
            };
            cases.ask(
                robot,
                At { value, method: robot.closures() },
                "pose",
                &Question::pose(&state),
                &reference,
            )?;
        }
    }
    Ok(())
}
