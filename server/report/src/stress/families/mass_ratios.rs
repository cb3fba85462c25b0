//! Mass ratios.

use sarrus_dynamics::description::SubmechanismKind as Kind;

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::Cases;
use crate::stress::harness::robot::{Robot, bundled, heavier};
use crate::stress::harness::sweep;
use crate::stress::mechanisms::{GRASHOF, four_bar, rods};

/// Robots, and which of their links are heavy: name, robot, ends of the links' names.
const HEAVY: [(&str, &str, &[&str]); 10] = [
    ("lambda, heavy slider", "lambda", &["ElbowAct_Link"]),
    ("lambda, heavy rocker", "lambda", &["Elbow_Link"]),
    ("lambda, light rocker", "lambda", &["ElbowB11_Link", "ElbowAct_Link"]),
    ("torso, heavy body", "torso", &["BodyRoll_Link"]),
    (
        "torso, heavy legs",
        "torso",
        &[
            "B1_Link",
            "B2_Link",
            "BL1_Link",
            "BL2_Link",
            "ActL_Link",
            "BR1_Link",
            "BR2_Link",
            "ActR_Link",
        ],
    ),
    ("Stewart, heavy platform", "stewart", &["HipRotZ_Link"]),
    ("Stewart, heavy legs", "stewart", &["B1_Link", "B2_Link", "Act_Link"]),
    ("arm with a lambda, heavy hand", "r3_lambda_r", &["ALWristRoll_Link"]),
    ("arm with a lambda, heavy shoulder", "r3_lambda_r", &["ALShoulder1_Link"]),
    ("upper body, heavy hands", "rh5v2_upper_body", &["WristRoll_Link"]),
];

/// Heavy and light links in loops and in chains.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("mass ratio", "heavy mass over light mass");
    let values = sweep(effort, 0, 9, 3);
    for (name, from, ends) in HEAVY {
        let plain = bundled(from)?;
        for &value in &values {
            let robot = Robot::new(
                name,
                heavier(plain.clone(), |link| ends.iter().any(|end| link.ends_with(end)), value),
            );
            cases.dynamics(name, value, robot)?;
        }
    }
    for &value in &values {
        for (name, heavy) in [
            ("8 rods, heavy end", "link8"),
            ("8 rods, heavy base", "link1"),
            ("8 rods, every second heavy", ""),
        ] {
            let heavy = |link: &str| {
                if heavy.is_empty() { link.ends_with(['2', '4', '6', '8']) } else { link == heavy }
            };
            cases.dynamics(name, value, Robot::new(name, heavier(rods(8)?, heavy, value)))?;
        }
        let name = "four-bar, heavy coupler";
        let bars = four_bar(GRASHOF, Kind::FourBar, "xy")?;
        cases.dynamics(
            name,
            value,
            Robot::new(name, heavier(bars, |link| link == "link2", value)),
        )?;
    }
    Ok(())
}
