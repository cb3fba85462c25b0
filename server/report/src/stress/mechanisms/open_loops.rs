//! States off their loops.

use sarrus_dynamics::Field;

use crate::Outcome;
use crate::stress::harness::{Question, Robot, State};

/// By how much to move each tree coordinate so that loops open: up to `size` radians, or tenths of
/// the robot's length. `first` numbers the first coordinate.
pub(crate) fn offsets(robot: &Robot, size: f64, first: usize) -> Vec<f64> {
    let units = robot.units(Field::Q);
    let off = |(k, unit): (usize, &f64)| {
        let share = if *unit == 1.0 { 1.0 } else { 0.1 };
        size * (2.4 * (k + first) as f64).sin() / unit * share
    };
    units.iter().enumerate().map(off).collect()
}

/// A closed state in all tree coordinates, the pose then moved off the loops by this much.
pub(crate) fn off_loops(robot: &Robot, value: f64) -> Outcome<(Vec<f64>, Vec<f64>)> {
    let closed = Question::kinematics(&State::of(robot, 0.1)?).run(&robot.compiled.model)?;
    let pairs = closed.get(Field::Q).iter().zip(offsets(robot, value, 1));
    Ok((pairs.map(|(q, off)| q + off).collect(), closed.get(Field::Qd).to_vec()))
}
