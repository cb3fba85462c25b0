//! Nearer and nearer to singular poses, and beyond the reach.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use sarrus_dynamics::description::{Description, SubmechanismKind as Kind};
use sarrus_dynamics::scalar::{Dd, Scalar};
use sarrus_dynamics::{Field, Model, Request, Status};

use crate::Outcome;
use crate::measure::Effort;
use crate::stress::harness::ask::{Question, State};
use crate::stress::harness::case::{At, Cases, Reference};
use crate::stress::harness::robot::{Robot, bundled, numerical};
use crate::stress::mechanisms::{
    LOOSE, RHOMBUS, bricard, four_bar, lambda, reach_of_lambda, toggle,
};
use crate::stress::sweep;

/// A robot, and the way to a singular pose: y = from + (1 − d) × to.
struct Approach {
    robot: Robot,
    from: Vec<f64>,
    to: Vec<f64>,
    /// It is too far from zero to be asked without a guess.
    guessed: bool,
}

impl Approach {
    /// The y at a distance from the singular pose, along the way.
    fn at(&self, distance: f64) -> Vec<f64> {
        let size = self.to.iter().map(|x| x * x).sum::<f64>().sqrt();
        // PRECISION: the singular end itself first, then what is taken off
        self.from
            .iter()
            .zip(&self.to)
            .map(|(from, to)| (from + to) - distance * (to / size))
            .collect()
    }
}

/// Mechanisms of one freedom whose singular pose is known from their lengths.
fn known() -> Outcome<Vec<Approach>> {
    let (out, meet) = (toggle(), reach_of_lambda());
    let list: [(&str, Description, f64); 9] = [
        ("lambda at its reach", lambda(Kind::Rrpr), meet),
        ("lambda at its reach", lambda(Kind::Numerical), meet),
        ("four-bar at its dead centre", four_bar(LOOSE, Kind::FourBar, "xy"), out),
        ("four-bar at its dead centre", four_bar(LOOSE, Kind::Numerical, "xy"), out),
        ("welded four-bar at its dead centre", four_bar(LOOSE, Kind::Numerical, "xyzabc"), out),
        ("parallelogram going flat", four_bar(RHOMBUS, Kind::ParallelogramChain, "xy"), FRAC_PI_2),
        ("parallelogram going flat", four_bar(RHOMBUS, Kind::Numerical, "xy"), FRAC_PI_2),
        ("Bricard", bricard(false), -FRAC_PI_6),
        ("Bricard cut at a revolute", bricard(true), -FRAC_PI_6),
    ];
    list.into_iter()
        .map(|(name, of, reach)| {
            Ok(Approach {
                robot: Robot::new(name, of)?,
                from: vec![0.0],
                to: vec![reach],
                guessed: false,
            })
        })
        .collect()
}

/// Bundled robots along a straight way to where it ends in double-double, each pose from the one
/// before; the end is bisected.
fn searched() -> Outcome<Vec<Approach>> {
    const STEP: f64 = 0.04;
    let mut approaches = Vec::new();
    for (name, direction) in [
        ("wrist", &[1.0, 0.4][..]),
        ("five_bar", &[1.0, 0.2]),
        ("delta", &[1.0, 0.6, 0.2]),
        ("active_ankle", &[1.0, 0.5, -0.3]),
    ] {
        let robot = Robot::new(name, numerical(bundled(name)?))?;
        let (mut low, mut step) = (0.0, STEP);
        let mut guess = None;
        while low + step > low && low < 3.1 {
            let y = direction.iter().map(|x| (low + step) * x).collect();
            let answer = Question::pose(&State { y, guess: guess.clone(), ..State::default() })
                .run(&robot.compiled.exact)?;
            if answer.status() == Status::Ok {
                low += step;
                guess = Some(answer.get(Field::Q).iter().map(|q| q.hi()).collect());
            } else {
                step *= 0.5;
            }
        }
        if low < 3.1 {
            approaches.push(Approach {
                robot,
                from: vec![0.0; direction.len()],
                to: direction.iter().map(|x| low * x).collect(),
                guessed: true,
            });
        }
    }
    Ok(approaches)
}

/// The Stewart platform where some twist moves no leg.
const TYPE_II: &str = "Stewart at type II";

/// The Stewart platform where its legs cannot hold a twist: det G_u = 0 along a turn.
fn platform() -> Outcome<Approach> {
    let robot = Robot::new(TYPE_II, bundled("stewart")?)?;
    let (start, axis) = ([0.01, -0.02, 0.0, 0.0, 0.0, 0.0], 5);
    let sign = |turn: f64| -> Outcome<bool> {
        let mut y = start.to_vec();
        y[axis] = turn;
        let answer = Question::new(Request::Kinematics, vec![(Field::Y, y)], &[Field::GU])
            .run(&robot.compiled.exact)?;
        Ok(determinant(answer.get(Field::GU).to_vec(), 6) > 0.0)
    };
    let first = sign(0.0)?;
    let mut step = 0;
    while step < 100 && sign(0.03 * f64::from(step + 1))? == first {
        step += 1;
    }
    let (mut low, mut high) = (0.03 * f64::from(step), 0.03 * f64::from(step + 1));
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if sign(middle)? == first { low = middle } else { high = middle }
    }
    let mut to = vec![0.0; 6];
    to[axis] = low;
    Ok(Approach { robot, from: start.to_vec(), to, guessed: false })
}

/// Determinant by elimination with pivots.
fn determinant(mut a: Vec<Dd>, n: usize) -> f64 {
    let mut det = 1.0;
    for k in 0..n {
        let Some(pivot) = (k..n)
            .max_by(|i, j| f64::total_cmp(&a[i * n + k].hi().abs(), &a[j * n + k].hi().abs()))
        else {
            return 0.0;
        };
        if pivot != k {
            (0..n).for_each(|j| a.swap(k * n + j, pivot * n + j));
            det = -det;
        }
        det *= a[k * n + k].hi();
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            for j in k..n {
                a[i * n + j] = a[i * n + j] - factor * a[k * n + j];
            }
        }
    }
    det
}

/// Every robot at distances from 1 to 1e-15.
pub(crate) fn distances(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("distance to a singularity", "rad from the singular pose");
    let values: Vec<f64> =
        (0..=15).filter(|k| !effort.quick || k % 3 == 0).map(|k| 10f64.powi(-k)).collect();
    let mut approaches = known()?;
    approaches.extend(searched()?);
    approaches.push(platform()?);
    for approach in &approaches {
        for &value in &values {
            let mut state = State::of(&approach.robot, 0.1)?;
            state.y = approach.at(value);
            if approach.guessed {
                state.guess = followed(&approach.robot.compiled.model, &approach.at(value + 0.02))?;
            }
            state.forces(&approach.robot)?;
            cases.questions(
                &approach.robot,
                value,
                &state,
                true,
                &[approach.robot.compiled.model.forward_method()],
            )?;
            if approach.robot.name == TYPE_II {
                back_from_actuators(cases, approach, value, &state)?;
            }
        }
    }
    Ok(())
}

/// The pose from what the actuators tell, rounded to a double as an encoder's is, and a guess near
/// by.
fn back_from_actuators(
    cases: &mut Cases,
    approach: &Approach,
    value: f64,
    state: &State,
) -> Outcome {
    let model = &approach.robot.compiled.model;
    let near = Question::pose(&State { y: approach.at(value + 1e-3), ..State::default() })
        .run(model)?
        .get(Field::Q)
        .to_vec();
    let u = Question::kinematics(state)
        .run(&approach.robot.compiled.exact)?
        .get(Field::U)
        .iter()
        .map(|u| u.hi())
        .collect();
    let ask =
        Question::new(Request::Kinematics, vec![(Field::U, u), (Field::QGuess, near)], &[Field::Q]);
    cases.ask(
        &approach.robot,
        At { value, method: approach.robot.closures() },
        "u to q",
        &ask,
        &Reference::Of(&Question::pose(state)),
    )?;
    Ok(())
}

/// Targets beyond the reach: there is no answer, and none may be given.
pub(crate) fn beyond(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("unreachable y", "rad beyond the reach");
    for approach in known()?.iter().take(5) {
        // nearer than the rounding of lengths and y there is no beyond; the lambda can be put
        // together again more than 0.59 beyond
        for value in sweep(effort, -13, 0, 5).into_iter().map(|value| 0.5 * value) {
            let mut state = State::of(&approach.robot, 0.1)?;
            state.y = approach.at(-value);
            let at = At { value, method: approach.robot.closures() };
            cases.ask(
                &approach.robot,
                at,
                "kinematics",
                &Question::kinematics(&state),
                &Reference::None,
            )?;
            cases.ask(
                &approach.robot,
                at,
                "FD",
                &Question::forward(&state, None),
                &Reference::None,
            )?;
        }
    }
    Ok(())
}

/// Far targets in one jump from zero; the reference is the pose at the end of the same way in small
/// steps.
pub(crate) fn jumps(cases: &mut Cases, effort: &Effort) -> Outcome {
    cases.family("big jump", "rad from the guess to the target");
    let values = if effort.quick {
        vec![0.1, 0.5, 1.0, 2.0, 3.0]
    } else {
        vec![0.01, 0.03, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.4, 2.7, 3.0]
    };
    let robots = [
        Robot::new("wrist", bundled("wrist")?)?,
        Robot::new("delta", bundled("delta")?)?,
        Robot::new("squeezer", bundled("squeezer")?)?,
        Robot::new(
            "four-bar of a full turn",
            four_bar(crate::stress::mechanisms::GRASHOF, Kind::Numerical, "xy"),
        )?,
        Robot::new("lambda numerical", numerical(bundled("lambda")?))?,
        Robot::new("Stewart numerical", numerical(bundled("stewart")?))?,
        Robot::new("Bricard", bricard(false))?,
    ];
    for robot in &robots {
        let direction = State::of(robot, 1.0)?.y;
        let size = direction.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        for &value in &values {
            let y: Vec<f64> = direction.iter().map(|x| value * x / size).collect();
            let state = State { y: y.clone(), ..State::default() };
            let reference = match followed(&robot.compiled.exact, &y)? {
                Some(q) => Reference::Known(vec![(Field::Q, q)]),
                None => Reference::None,
            };
            cases.ask(
                robot,
                At { value, method: robot.closures() },
                "pose",
                &Question::pose(&state),
                &reference,
            )?;
        }
    }
    Ok(())
}

/// The pose at the end of the straight way from zero in small steps, each from the one before; none
/// where the way ends.
fn followed<T: Scalar>(model: &Model<T>, y: &[f64]) -> Outcome<Option<Vec<T>>> {
    const STEPS: u32 = 200;
    let mut guess: Option<Vec<f64>> = None;
    for k in 1..=STEPS {
        let share = f64::from(k) / f64::from(STEPS);
        let state = State {
            y: y.iter().map(|y| y * share).collect(),
            guess: guess.take(),
            ..State::default()
        };
        let answer = Question::pose(&state).run(model)?;
        if answer.status() != Status::Ok {
            return Ok(None);
        }
        if k == STEPS {
            return Ok(Some(answer.get(Field::Q).to_vec()));
        }
        guess = Some(answer.get(Field::Q).iter().map(|q| q.to_f64()).collect());
    }
    Ok(None)
}
