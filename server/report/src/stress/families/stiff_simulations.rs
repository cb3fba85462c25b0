//! Springs, dampers and gains that get stiffer.

use sarrus_dynamics::LinkId;
use sarrus_dynamics::description::{SubmechanismKind as Kind, Terms};
use sarrus_simulation::{Input, Run, Source, Space};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::Cases;
use crate::stress::harness::robot::{Robot, X, bundled, mechanism};
use crate::stress::harness::runs::{Comparison, setup};
use crate::stress::harness::simulations::{against_reference, every_method, from};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::rods;

/// A mass of 1 kg on a slider, with a spring and a damper.
fn oscillator(stiffness: f64, damping: f64) -> Outcome<Robot> {
    let mut of = mechanism(Kind::Serial);
    of.gravity([0.0; 3])
        .prismatic("slider", LinkId::BASE, X)
        .spring(stiffness, 0.0)
        .damping(damping);
    Robot::new("mass on a spring", of.build()?)
}

/// Where it is after t when it starts at 1 from rest.
fn swung(stiffness: f64, damping: f64, t: f64) -> f64 {
    let decay = 0.5 * damping;
    let square = 0.25 * damping * damping - stiffness;
    if square < 0.0 {
        let (sine, cosine) = ((-square).sqrt() * t).sin_cos();
        return (-decay * t).exp() * (cosine + decay / (-square).sqrt() * sine);
    }
    // the slow root from the product of both, which are k
    let fast = -decay - square.sqrt();
    let slow = stiffness / fast;
    (fast * (slow * t).exp() - slow * (fast * t).exp()) / (fast - slow)
}

/// Springs, dampers and gains that get stiffer: explicit methods have to report their failure, the
/// implicit one holds.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let kinds: [(&str, &str, fn(f64) -> (f64, f64)); 2] = [
        ("simulated spring", "stiffness, N/m", |k| (k, k.sqrt())),
        ("simulated damper", "damping, N s/m", |c| (1.0, c)),
    ];
    for (family, parameter, constants) in kinds {
        cases.family(family, parameter);
        for value in sweep(effort, 0, 9, 3) {
            let (stiffness, damping) = constants(value);
            let robot = oscillator(stiffness, damping)?;
            let error = |run: &Run| {
                Ok(run.samples.iter().fold(0.0, |e: f64, at| {
                    e.max((at.y[0] - swung(stiffness, damping, at.time)).abs())
                }))
            };
            let comparison = Comparison { error: &error, reference: "closed form" };
            every_method(
                cases,
                "mass on a spring",
                value,
                &setup(&robot),
                &from(&[1.0], &[0.0]),
                &comparison,
            )?;
        }
    }
    cases.family("simulated stiff joint", "stiffness, N m/rad");
    for value in sweep(effort, 0, 9, 3) {
        let mut of = rods(2)?;
        of.joints[1].terms = Terms { stiffness: value, damping: value.sqrt(), ..Terms::default() };
        against_reference(cases, "2 rods", value, of, &[])?;
    }
    cases.family("simulated gains", "kp of all actuators, kd its root");
    for name in ["lambda", "torso"] {
        for value in sweep(effort, 0, 9, 3) {
            let of = bundled(name)?;
            let n_u = Robot::new(name, of.clone())?.compiled.model.sizes().n_u;
            let source = Source::Gains {
                stiffness: vec![value; n_u],
                damping: vec![value.sqrt(); n_u],
                target: vec![0.01; n_u],
            };
            against_reference(cases, name, value, of, &[Input { space: Space::Actuator, source }])?;
        }
    }
    Ok(())
}
