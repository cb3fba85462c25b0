//! Straight approaches of robots to singular poses.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Field, Model, PlanScalar, Request, Status};

use crate::Outcome;
use crate::stress::harness::{Question, Robot, State, bundled, numerical};
use crate::stress::mechanisms::{
    LOOSE, RHOMBUS, bricard, four_bar, lambda, reach_of_lambda, toggle,
};

/// A robot, and the way to a singular pose: y = from + (1 − d) × to.
pub(crate) struct Approach {
    pub(crate) robot: Robot,
    pub(crate) from: Vec<f64>,
    pub(crate) to: Vec<f64>,
    /// It is too far from zero for a question without a guess.
    pub(crate) guessed: bool,
}

impl Approach {
    /// From zero.
    fn new(robot: Robot, to: Vec<f64>, guessed: bool) -> Approach {
        Approach { robot, from: vec![0.0; to.len()], to, guessed }
    }

    /// The y at a distance from the singular pose, along the way.
    pub(crate) fn at(&self, distance: f64) -> Vec<f64> {
        let size = self.to.iter().map(|x| x * x).sum::<f64>().sqrt();
        // PRECISION: the singular end itself first, then the difference
        self.from
            .iter()
            .zip(&self.to)
            .map(|(from, to)| (from + to) - distance * (to / size))
            .collect()
    }
}

/// Mechanisms of one freedom whose singular pose is known from their lengths.
pub(crate) fn known() -> Outcome<Vec<Approach>> {
    let out = toggle();
    let meet = reach_of_lambda();
    let list: [(&str, Description, f64); 9] = [
        ("lambda at its reach", lambda(Kind::Rrpr)?, meet),
        ("lambda at its reach", lambda(Kind::Numerical)?, meet),
        ("four-bar at its dead centre", four_bar(LOOSE, Kind::FourBar, "xy")?, out),
        ("four-bar at its dead centre", four_bar(LOOSE, Kind::Numerical, "xy")?, out),
        ("welded four-bar at its dead centre", four_bar(LOOSE, Kind::Numerical, "xyzabc")?, out),
        ("parallelogram going flat", four_bar(RHOMBUS, Kind::ParallelogramChain, "xy")?, FRAC_PI_2),
        ("parallelogram going flat", four_bar(RHOMBUS, Kind::Numerical, "xy")?, FRAC_PI_2),
        ("Bricard", bricard(false)?, -FRAC_PI_6),
        ("Bricard cut at a revolute", bricard(true)?, -FRAC_PI_6),
    ];
    list.into_iter()
        .map(|(name, of, reach)| Ok(Approach::new(Robot::new(name, of)?, vec![reach], false)))
        .collect()
}

/// Bundled robots along a straight path to its end in double-double, each pose from the one before;
/// bisection finds the end.
pub(crate) fn searched() -> Outcome<Vec<Approach>> {
    const STEP: f64 = 0.04;
    let mut approaches = Vec::new();
    for (name, direction) in [
        ("wrist", &[1.0, 0.4][..]),
        ("five_bar", &[1.0, 0.2]),
        ("delta", &[1.0, 0.6, 0.2]),
        ("active_ankle", &[1.0, 0.5, -0.3]),
    ] {
        let robot = Robot::new(name, numerical(bundled(name)?))?;
        let mut low = 0.0;
        let mut step = STEP;
        let mut guess = None;
        while low + step > low && low < 3.1 {
            let y = direction.iter().map(|x| (low + step) * x).collect();
            match posed(&robot.compiled.exact, y, guess.clone())? {
                Some(q) => {
                    low += step;
                    guess = Some(q.iter().map(|q| q.hi()).collect());
                }
                None => step *= 0.5,
            }
        }
        if low < 3.1 {
            let to = direction.iter().map(|x| low * x).collect();
            approaches.push(Approach::new(robot, to, true));
        }
    }
    Ok(approaches)
}

/// The Stewart platform at a pose where some twist moves no leg.
pub(crate) const TYPE_II: &str = "Stewart at type II";

/// The Stewart platform at a pose where its legs cannot resist a twist: det G_u = 0 along a turn.
pub(crate) fn platform() -> Outcome<Approach> {
    let robot = Robot::new(TYPE_II, bundled("stewart")?)?;
    let start = [0.01, -0.02, 0.0, 0.0, 0.0, 0.0];
    let axis = 5;
    let sign = |turn: f64| -> Outcome<bool> {
        let mut y = start.to_vec();
        y[axis] = turn;
        let answer = Question::new(Request::Kinematics, vec![(Field::Y, y)], &[Field::GU])
            .run(&robot.compiled.exact)?;
        let rows: Vec<Vec<Dd>> = answer.get(Field::GU).chunks(6).map(<[Dd]>::to_vec).collect();
        Ok(determinant(&rows).hi() > 0.0)
    };
    let first = sign(0.0)?;
    let mut step = 0;
    while step < 100 && sign(0.03 * f64::from(step + 1))? == first {
        step += 1;
    }
    let mut low = 0.03 * f64::from(step);
    let mut high = 0.03 * f64::from(step + 1);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if sign(middle)? == first { low = middle } else { high = middle }
    }
    let mut to = vec![0.0; 6];
    to[axis] = low;
    Ok(Approach { robot, from: start.to_vec(), to, guessed: false })
}

/// Determinant by expansion along the first row.
fn determinant(rows: &[Vec<Dd>]) -> Dd {
    let Some((first, rest)) = rows.split_first() else { return Dd::from(1.0) };
    let mut det = Dd::from(0.0);
    for (j, x) in first.iter().enumerate() {
        let without = |row: &Vec<Dd>| [&row[..j], &row[j + 1..]].concat();
        let minor: Vec<Vec<Dd>> = rest.iter().map(without).collect();
        let term = *x * determinant(&minor);
        det = if j % 2 == 0 { det + term } else { det - term };
    }
    det
}

/// The pose at the end of the straight way from zero in small steps, each from the one before; none
/// if the path ends.
pub(crate) fn followed<T: PlanScalar>(model: &Model<T>, y: &[f64]) -> Outcome<Option<Vec<T>>> {
    const STEPS: u32 = 200;
    let mut q: Option<Vec<T>> = None;
    for k in 1..=STEPS {
        let share = f64::from(k) / f64::from(STEPS);
        let guess = q.map(|q| q.iter().map(|q| q.to_f64()).collect());
        q = posed(model, y.iter().map(|y| y * share).collect(), guess)?;
        if q.is_none() {
            break;
        }
    }
    Ok(q)
}

/// The closed pose, near a guess; none without an answer.
pub(crate) fn posed<T: PlanScalar>(
    model: &Model<T>,
    y: Vec<f64>,
    guess: Option<Vec<f64>>,
) -> Outcome<Option<Vec<T>>> {
    let answer = Question::pose(&State { y, guess, ..State::default() }).run(model)?;
    Ok((answer.status() == Status::Ok).then(|| answer.get(Field::Q).to_vec()))
}
