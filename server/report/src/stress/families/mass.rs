//! Mass ratios, and links without mass.

use sarrus_dynamics::Method;
use sarrus_dynamics::description::{Description, Inertial, SubmechanismKind as Kind, Terms};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::State;
use crate::stress::harness::case::{At, Cases};
use crate::stress::harness::robot::{Robot, bundled, heavier};
use crate::stress::mechanisms::{GRASHOF, four_bar, rods};
use crate::stress::sweep;

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
pub(crate) fn ratios(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("mass ratio", "heavy mass over light mass");
    let values = sweep(effort, 0, 9, 3);
    for (name, from, ends) in HEAVY {
        let plain = bundled(from)?;
        for &value in &values {
            let robot = Robot::new(
                name,
                heavier(plain.clone(), |link| ends.iter().any(|end| link.ends_with(end)), value),
            );
            answers(cases, name, value, robot)?;
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
            answers(cases, name, value, Robot::new(name, heavier(rods(8), heavy, value)))?;
        }
        let name = "four-bar, heavy coupler";
        let bars = four_bar(GRASHOF, Kind::FourBar, "xy");
        answers(
            cases,
            name,
            value,
            Robot::new(name, heavier(bars, |link| link == "link2", value)),
        )?;
    }
    Ok(())
}

fn answers(cases: &mut Cases, name: &str, value: f64, robot: Outcome<Robot>) -> Outcome {
    if let Some(robot) = cases.load(name, At { value, method: "-" }, robot) {
        cases.questions(&robot, value, &State::of(&robot, 0.25)?, false, &Method::ALL)?;
    }
    Ok(())
}

/// Links of less and less mass, down to none. A mass matrix that is not positive is refused at
/// load; one that is stays exact.
pub(crate) fn massless(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("massless links", "share of the mass that is left");
    let mut values: Vec<f64> = (0..if effort.quick { 5 } else { 16 })
        .map(|k| 10f64.powi(-(if effort.quick { 5 } else { 1 }) * k))
        .collect();
    values.extend([1e-60, 1e-150, 1e-300, 0.0]);
    let robots: [(&str, fn(f64) -> Outcome<Description>); 6] = [
        ("lambda, light stator", |factor| {
            Ok(heavier(bundled("lambda")?, |link| link == "ElbowB11_Link", factor))
        }),
        ("lambda, light all but the slider", |factor| {
            Ok(heavier(bundled("lambda")?, |link| link != "ElbowAct_Link", factor))
        }),
        ("Stewart, light legs", |factor| {
            Ok(heavier(bundled("stewart")?, |link| link.contains("HipL"), factor))
        }),
        ("3 rods, light middle", |factor| Ok(heavier(rods(3), |link| link == "link2", factor))),
        ("3 rods, light end", |factor| Ok(heavier(rods(3), |link| link == "link3", factor))),
        ("3 rods, light end with a rotor", |factor| {
            let mut of = heavier(rods(3), |link| link == "link3", factor);
            of.joints[2].terms =
                Terms { rotor_inertia: 1e-4, gear_ratio: 50.0, ..Terms::default() };
            Ok(of)
        }),
    ];
    for (name, make) in robots {
        for &value in &values {
            answers(cases, name, value, make(value).and_then(|of| Robot::new(name, of)))?;
        }
    }
    point_masses(cases, &values)
}

/// Rods whose inertia about their centres fades: point masses, which a chain of rods can be.
fn point_masses(cases: &mut Cases, values: &[f64]) -> Outcome {
    let name = "3 rods, inertia fading";
    for &value in values {
        let mut of = rods(3);
        let fade = |inertial: &mut Inertial| inertial.inertia = inertial.inertia.map(|x| x * value);
        of.links.iter_mut().filter_map(|link| link.inertial.as_mut()).for_each(fade);
        answers(cases, name, value, Robot::new(name, of))?;
    }
    Ok(())
}
