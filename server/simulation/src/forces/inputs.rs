//! Joint forces over time: constant forces, a table, or gains towards a target.
//!
//! Every input acts on joints of the tree, the independents or the actuators, as declared at the
//! start: it stays unchanged when the simulator switches to other independents.

use sarrus_dynamics::Model;
use sarrus_dynamics::scalar::Real;

use crate::coordinates::Coordinates;
use crate::error::{Outcome, SimulationError};

sarrus_dynamics::named_enum! {
    /// The joints that an input acts on.
    pub enum Space {
        /// The declared independents, in the order of ẏ.
        Independent = "y",
        /// The actuators, in the order of u̇.
        Actuator = "u",
    }
}

/// Where an input's numbers come from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A constant force `[N, N m]`.
    Constant(Vec<f64>),
    /// Forces at times, straight lines between them, the first and last beyond.
    Table {
        /// Times, increasing.
        times: Vec<f64>,
        /// A row of forces for each time.
        forces: Vec<Vec<f64>>,
    },
    /// τ = kp (target − x) − kd ẋ, x the joint's coordinate.
    Gains {
        /// kp `[N/m, N m/rad]`.
        stiffness: Vec<f64>,
        /// kd `[N s/m, N m s/rad]`.
        damping: Vec<f64>,
        /// Where to.
        target: Vec<f64>,
    },
}

/// One input.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// Whose joints.
    pub space: Space,
    /// How much.
    pub source: Source,
}

/// An input on tree joints.
#[derive(Clone, Debug)]
pub(crate) struct OnTree {
    /// Velocity of each joint, and its coordinate if it has one freedom.
    joints: Vec<(usize, Option<usize>)>,
    source: Source,
    /// Its joints are actuators.
    pub(crate) is_of_motors: bool,
}

impl OnTree {
    /// Checks the numbers of an input against the model.
    pub(crate) fn new(input: &Input, model: &Model<f64>, tree: &Coordinates) -> Outcome<OnTree> {
        let names = match input.space {
            Space::Independent => model.independent_names(),
            Space::Actuator => model.active_names(),
        };
        let place = |name: &String| model.tree_names().iter().position(|of| of == name);
        let joints: Vec<_> =
            names.iter().filter_map(place).map(|v| (v, tree.coordinate(v))).collect();
        let sized = |what: &str, numbers: &[f64]| {
            let what = format!("{what} in {}", input.space.name());
            SimulationError::check_numbers(&what, numbers, names)
        };
        match &input.source {
            Source::Constant(forces) => sized("the forces", forces)?,
            Source::Table { times, forces } => {
                if times.is_empty() || times.len() != forces.len() {
                    return Err(SimulationError::Table {
                        row: forces.len().min(times.len()),
                        found: "a table without a force for each time",
                    });
                }
                forces.iter().try_for_each(|row| sized("the forces of the table", row))?;
                if let Some(row) = times.iter().position(|time| !time.is_finite()) {
                    return Err(SimulationError::Table { row, found: "a time that is no number" });
                }
                if let Some(row) = times.windows(2).position(|pair| pair[1] <= pair[0]) {
                    return Err(SimulationError::Table {
                        row: row + 1,
                        found: "a time that is not after the one before",
                    });
                }
            }
            Source::Gains { stiffness, damping, target } => {
                for (what, numbers) in [("kp", stiffness), ("kd", damping), ("the target", target)]
                {
                    sized(what, numbers)?;
                }
                let free = |k: &usize| joints[*k].1.is_none() && stiffness[*k] != 0.0;
                if let Some(k) = (0..joints.len()).find(free) {
                    return Err(SimulationError::GainOnFreeJoint(names[k].clone()));
                }
            }
        }
        let is_of_motors = input.space == Space::Actuator;
        Ok(OnTree { joints, source: input.source.clone(), is_of_motors })
    }

    /// True where the force depends on where the robot is.
    pub(crate) fn is_feedback(&self) -> bool {
        matches!(self.source, Source::Gains { .. })
    }

    /// Adds the forces at a time to τ_q; q and q̇ are looked at for gains only.
    pub(crate) fn add<T: Real>(&self, time: f64, q: &[T], qd: &[T], tau_q: &mut [T]) {
        match &self.source {
            Source::Constant(forces) => self
                .joints
                .iter()
                .zip(forces)
                .for_each(|((v, _), force)| tau_q[*v] += T::from_f64(*force)),
            Source::Table { times, forces } => {
                let (row, next, part) = place(times, time);
                for (k, (v, _)) in self.joints.iter().enumerate() {
                    tau_q[*v] +=
                        T::from_f64(forces[row][k] + part * (forces[next][k] - forces[row][k]));
                }
            }
            Source::Gains { stiffness, damping, target } => {
                for (k, (v, at)) in self.joints.iter().enumerate() {
                    if let Some(at) = at {
                        tau_q[*v] += T::from_f64(stiffness[k]) * (T::from_f64(target[k]) - q[*at]);
                    }
                    tau_q[*v] += -(T::from_f64(damping[k]) * qd[*v]);
                }
            }
        }
    }

    /// The times within a span at which the force has a kink, which no step may contain.
    pub(crate) fn kinks(&self) -> &[f64] {
        match &self.source {
            Source::Table { times, .. } => times,
            _ => &[],
        }
    }
}

/// The rows of increasing times around a time and the part of the way from the first to the second.
fn place(times: &[f64], time: f64) -> (usize, usize, f64) {
    let after = times.partition_point(|of| *of <= time);
    match after {
        0 => (0, 0, 0.0),
        n if n == times.len() => (n - 1, n - 1, 0.0),
        n => (n - 1, n, (time - times[n - 1]) / (times[n] - times[n - 1])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_straight_between_its_rows_and_constant_beyond() {
        let times = [0.0, 1.0, 3.0];
        for (time, expected) in [
            (-1.0, (0, 0, 0.0)),
            (0.0, (0, 1, 0.0)),
            (0.25, (0, 1, 0.25)),
            (1.0, (1, 2, 0.0)),
            (2.0, (1, 2, 0.5)),
            (3.0, (2, 2, 0.0)),
            (9.0, (2, 2, 0.0)),
        ] {
            assert_eq!(place(&times, time), expected, "at {time}");
        }
        assert_eq!(place(&[2.0], 5.0), (0, 0, 0.0));
    }
}
