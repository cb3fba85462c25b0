//! Stiff springs, dampers and rotors in joints: one answer of inverse and forward dynamics.

use sarrus_dynamics::Method;
use sarrus_dynamics::description::Terms;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::question::State;
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::harness::sweep;

pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    let kinds: [(&str, &str, fn(f64) -> Terms); 3] = [
        ("spring stiffness", "N m/rad or N/m", |x| Terms {
            stiffness: x,
            rest: 0.01,
            ..Terms::default()
        }),
        ("joint damping", "N m s/rad or N s/m", |x| Terms { damping: x, ..Terms::default() }),
        ("reflected rotor", "kg m² about the joint", |x| Terms {
            rotor_inertia: x,
            ..Terms::default()
        }),
    ];
    for (family, unit, terms) in kinds {
        cases.family(family, unit);
        for name in ["lambda", "four_bars_2", "rh5v2_upper_body"] {
            for value in sweep(effort, 0, 9, 3) {
                let mut of = bundled(name)?;
                // on actuators alone, so that rotors stand beside joints that have none
                for joint in
                    of.submechanisms.iter().flat_map(|part| part.active.clone()).collect::<Vec<_>>()
                {
                    of.joints[joint].terms = terms(value);
                }
                if let Some(robot) =
                    cases.load(name, At { value, method: "-" }, Robot::new(name, of))
                {
                    cases.questions(
                        &robot,
                        value,
                        &State::of(&robot, 0.2)?,
                        false,
                        &Method::ALL,
                    )?;
                }
            }
        }
    }
    Ok(())
}
