//! States off their loops.

use sarrus_dynamics::Field;
use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::{Dd, Real};

use crate::Outcome;
use crate::stress::harness::question::{Question, State};
use crate::stress::harness::robot::{Robot, bundled};
use crate::stress::mechanisms::bricard;

pub(crate) fn robots() -> Outcome<Vec<Robot>> {
    let list: [(&str, Description); 5] = [
        ("lambda", bundled("lambda")?),
        ("wrist", bundled("wrist")?),
        ("torso", bundled("torso")?),
        ("Bricard", bricard(false)?),
        ("four bars", bundled("four_bars_2")?),
    ];
    list.into_iter().map(|(name, of)| Robot::new(name, of)).collect()
}

/// A closed state in all tree coordinates, the pose then moved off the loops by this much.
pub(crate) fn off_loops(robot: &Robot, value: f64) -> Outcome<(Vec<f64>, Vec<f64>)> {
    let closed = Question::kinematics(&State::of(robot, 0.1)?).run(&robot.compiled.model)?;
    let units = robot.units(Field::Q).unwrap_or_default();
    let off = |k: usize| {
        value * (2.4 * (k as f64 + 1.0)).sin() / units[k] * if units[k] == 1.0 { 1.0 } else { 0.1 }
    };
    let q = closed.get(Field::Q).iter().enumerate().map(|(k, q)| q + off(k)).collect();
    Ok((q, closed.get(Field::Qd).to_vec()))
}

pub(crate) fn apart(x: &[f64], reference: &[Dd], units: &[f64]) -> f64 {
    let mut worst: f64 = 0.0;
    let mut size: f64 = f64::MIN_POSITIVE;
    for ((x, reference), unit) in x.iter().zip(reference).zip(units) {
        let off = unit * (Dd::from(*x) - *reference).abs().hi();
        worst = if off.is_nan() { f64::INFINITY } else { worst.max(off) };
        size = size.max(unit * reference.abs().hi());
    }
    worst / size
}
