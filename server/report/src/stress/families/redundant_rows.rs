//! Redundant rows of constraints, and overconstrained loops.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::{Cut, Description, SubmechanismKind as Kind};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::Robot;
use crate::stress::harness::sweep;
use crate::stress::mechanisms::{LOOSE, RHOMBUS, bricard, four_bar};

use Field::{Lambda, TauU, TauY};

/// Redundant rows, moved apart as a rounded file does: reported at load where it matters, refused
/// where the gap exceeds rounding.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("redundant rows", "m by which redundant rows contradict each other");
    let mut values = vec![0.0];
    values.extend(sweep(effort, -16, -1, 5));
    let robots: [(&str, Description); 5] = [
        ("four-bar of three rows", four_bar(LOOSE, Kind::Numerical, "xyz")?),
        ("four-bar of six rows", four_bar(LOOSE, Kind::Numerical, "xyzabc")?),
        ("parallelogram of six rows", four_bar(RHOMBUS, Kind::Numerical, "xyzabc")?),
        ("Bricard of six rows", bricard(false)?),
        ("Bricard of five rows", bricard(true)?),
    ];
    for (name, plain) in robots {
        for &value in &values {
            let mut of = plain.clone();
            if let Cut::Placed { successor, .. } = &mut of.submechanisms[0].loops[0].cut {
                successor.xyz[2] += value;
            }
            let Some(robot) =
                cases.load(name, At { value, method: "numerical" }, Robot::new(name, of))
            else {
                continue;
            };
            let mut state = State::of(&robot, 0.2)?;
            state.forces(&robot)?;
            let at = At { value, method: robot.closures() };
            cases.questions(&robot, value, &state, true, &sarrus_dynamics::Method::ALL)?;
            let warned =
                robot.compiled.warnings.first().map(ToString::to_string).unwrap_or_default();
            let case = cases.ask(
                &robot,
                at,
                "ID, λ",
                &Question::inverse(&state, &[TauY, TauU, Lambda]),
                &Reference::Same,
            )?;
            case.reported = [std::mem::take(&mut case.reported), warned].concat();
        }
    }
    Ok(())
}
