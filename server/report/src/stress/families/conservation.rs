//! Energy and angular momentum that stay.

use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Field, Request};
use sarrus_simulation::{Method, Run, Settings};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::Robot;
use crate::stress::harness::runs::{Comparison, setup};
use crate::stress::harness::simulations::{from, settings};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::rods;

/// Without gravity and damping the energy stays, and the angular momentum about the first axis:
/// (M_y ẏ) of the first joint.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("conservation", "s simulated without gravity, damping and forces");
    let mut of = rods(3)?;
    of.gravity = [0.0; 3];
    let robot = Robot::new("3 rods", of)?;
    let state = State::of(&robot, 0.5)?;
    let momentum = |y: &[f64], yd: &[f64]| -> Outcome<f64> {
        let given = vec![(Field::Y, y.to_vec())];
        let mass = Question::new(Request::InverseDynamics, given, &[Field::MY])
            .run(&robot.compiled.exact)?;
        Ok(mass.get(Field::MY).iter().zip(yd).map(|(m, v)| m.to_f64() * v).sum())
    };
    let error = |run: &Run| -> Outcome<f64> {
        let first = momentum(&run.samples[0].y, &run.samples[0].yd)?;
        let mut worst = run.drift();
        for sample in &run.samples {
            worst = worst.max(((momentum(&sample.y, &sample.yd)? - first) / first).abs());
        }
        Ok(worst)
    };
    let comparison = Comparison { error: &error, reference: "energy and momentum" };
    for value in sweep(effort, -1, if effort.quick { 1 } else { 2 }, 2) {
        for method in Method::ALL {
            let settings = Settings {
                step: method.is_fixed().then_some(1e-3),
                most_steps: 400_000,
                ..settings(method, value)
            };
            cases.simulation(
                "3 rods",
                At { value, method: method.name() },
                &setup(&robot),
                &from(&state.y, &state.yd),
                &settings,
                &comparison,
            )?;
        }
    }
    Ok(())
}
