//! Lengths, masses, velocities, forces and gravity over many orders of magnitude.

use sarrus_dynamics::{Field, Method};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::robot::{Robot, bundled, numerical, scaled};
use crate::stress::mechanisms::bricard;
use crate::stress::sweep;

/// Robots that are made larger and heavier.
const ROBOTS: [&str; 6] =
    ["lambda", "wrist", "stewart", "four_bars_2", "torso", "rh5v2_upper_body"];

fn some(effort: &Effort) -> &'static [&'static str] {
    if effort.quick { &ROBOTS[..4] } else { &ROBOTS }
}

/// All lengths, then all masses, from a millionth to a million times.
pub(crate) fn sizes(cases: &mut Cases, effort: &Effort) -> Outcome {
    for (family, lengths) in [("length scale", true), ("mass scale", false)] {
        cases
            .family(family, if lengths { "factor of all lengths" } else { "factor of all masses" });
        for name in some(effort) {
            let plain = bundled(name)?;
            for value in sweep(effort, -6, 6, 4) {
                let of = if lengths {
                    scaled(plain.clone(), value, 1.0)
                } else {
                    scaled(plain.clone(), 1.0, value)
                };
                if let Some(robot) =
                    cases.load(name, At { value, method: "-" }, Robot::new(name, of))
                {
                    cases.questions(
                        &robot,
                        value,
                        &State::of(&robot, 0.2)?,
                        true,
                        &[robot.compiled.model.forward_method()],
                    )?;
                }
            }
        }
    }
    Ok(())
}

/// Velocities from creeping to absurd; beyond what squares in a double there is no answer.
pub(crate) fn velocities(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("velocity", "ẏ, rad/s");
    let mut values = sweep(effort, -6, 4, 5);
    values.extend([1e-160, 1e8, 1e100, 1e160, 1e300]);
    for name in ["lambda", "wrist", "stewart", "bricard", "rh5v2_upper_body"] {
        let robot = if name == "bricard" {
            Robot::new(name, bricard(false))?
        } else {
            Robot::new(name, bundled(name)?)?
        };
        for &value in &values {
            let mut state = State::of(&robot, 0.2)?;
            state.yd.iter_mut().for_each(|x| *x *= value);
            state.forces(&robot)?;
            cases.questions(
                &robot,
                value,
                &state,
                true,
                &[robot.compiled.model.forward_method()],
            )?;
        }
    }
    Ok(())
}

/// A wrench on the last link, from a breath to the weight of a mountain.
pub(crate) fn wrenches(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("wrench", "N and N m on the last link");
    let mut values = sweep(effort, -6, 12, 6);
    values.extend([1e30, 1e200, 1e308]);
    for name in ["lambda", "stewart", "rh5v2_upper_body"] {
        let robot = Robot::new(name, bundled(name)?)?;
        let link = robot.description.links.len() as u16 - 1;
        for &value in &values {
            let state = State::of(&robot, 0.2)?;
            let wrench = [0.3, -0.5, 0.7, 0.9, 0.4, -0.8].map(|x| x * value).to_vec();
            let at = At { value, method: robot.closures() };
            let want = [Field::TauY, Field::TauU, Field::Lambda];
            cases.ask(
                &robot,
                at,
                "ID",
                &Question::inverse(&state, &want).pushed(&[link], wrench.clone()),
                &Reference::Same,
            )?;
            for method in [Method::Recursion, Method::Projection] {
                let at = At { value, method: method.name() };
                cases.ask(
                    &robot,
                    at,
                    "FD",
                    &Question::forward(&state, Some(method)).pushed(&[link], wrench.clone()),
                    &Reference::Same,
                )?;
            }
        }
    }
    Ok(())
}

/// Gravity from none to that of a neutron star; at rest without it no force at all is needed.
pub(crate) fn gravity(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("gravity", "m/s²");
    let mut values = vec![0.0];
    values.extend(sweep(effort, -9, 12, 7));
    for name in ["lambda", "wrist", "rh5v2_upper_body"] {
        for (kind, make) in [("", (|of| of) as fn(_) -> _), (" numerical", numerical as fn(_) -> _)]
        {
            let mut plain = make(bundled(name)?);
            if name == "wrist" && !kind.is_empty() {
                continue;
            }
            for &value in &values {
                plain.gravity = [0.0, 0.0, -value];
                let robot = Robot::new(&format!("{name}{kind}"), plain.clone())?;
                let mut state = State::of(&robot, 0.2)?;
                cases.questions(
                    &robot,
                    value,
                    &state,
                    false,
                    &[robot.compiled.model.forward_method()],
                )?;
                // at rest
                state.yd.fill(0.0);
                state.ydd.fill(0.0);
                let at = At { value, method: robot.closures() };
                cases.ask(
                    &robot,
                    at,
                    "ID at rest",
                    &Question::inverse(&state, &[Field::TauY, Field::TauQ]),
                    &Reference::Same,
                )?;
            }
        }
    }
    Ok(())
}
