//! Links without mass, and point masses.

use sarrus_dynamics::description::{Description, Inertial, Terms};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::case::Cases;
use crate::stress::harness::robot::{Robot, bundled, heavier};
use crate::stress::mechanisms::rods;

/// Links of less and less mass, down to none. A mass matrix that is not positive is refused at
/// load; one that is stays exact.
pub(crate) fn run(cases: &mut Cases, effort: &Effort) -> Outcome {
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
        ("3 rods, light middle", |factor| Ok(heavier(rods(3)?, |link| link == "link2", factor))),
        ("3 rods, light end", |factor| Ok(heavier(rods(3)?, |link| link == "link3", factor))),
        ("3 rods, light end with a rotor", |factor| {
            let mut of = heavier(rods(3)?, |link| link == "link3", factor);
            of.joints[2].terms =
                Terms { rotor_inertia: 1e-4, gear_ratio: 50.0, ..Terms::default() };
            Ok(of)
        }),
    ];
    for (name, make) in robots {
        for &value in &values {
            cases.dynamics(name, value, make(value).and_then(|of| Robot::new(name, of)))?;
        }
    }
    point_masses(cases, &values)
}

/// Rods whose inertia about their centres fades: point masses, which a chain of rods can be.
fn point_masses(cases: &mut Cases, values: &[f64]) -> Outcome {
    let name = "3 rods, inertia fading";
    for &value in values {
        let mut of = rods(3)?;
        let fade = |inertial: &mut Inertial| inertial.inertia = inertial.inertia.map(|x| x * value);
        of.links.iter_mut().filter_map(|link| link.inertial.as_mut()).for_each(fade);
        cases.dynamics(name, value, Robot::new(name, of))?;
    }
    Ok(())
}
