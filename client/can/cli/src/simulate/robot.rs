//! The robot that the motors move.
//!
//! One step of the implicit Euler method in the independent coordinates, with the laws of the
//! motors inside, so that no gain is too stiff:
//!
//! ```text
//! (M_y + Gᵀ (R + h D + h² K) G) ẏ⁺ = M_y ẏ + Gᵀ (R u̇ + h (f − K (u − u*))) − h c
//! ```
//!
//! where u̇ = G ẏ, R are the rotors' inertias and D, K the motors' damping and stiffness as the
//! actuators feel them, and c is the bias with gravity. A motor without power is limp: its actuator
//! falls with the robot. Until it first gets power it is held as by a stand.

// the symbols of the equation
#![allow(non_snake_case)]

use sarrus_can_core::config::Configuration;
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Plant};
use sarrus_client::{Options, PlanId, Request, Robot, Status};

/// Time constant in which the stand stops a rotor `[s]`.
const STAND: f64 = 1e-7;

/// A robot under way.
pub(super) struct Moving {
    robot: Robot,
    plan: PlanId,
    y: Vec<f64>,
    yd: Vec<f64>,
    n_u: usize,
    physics: Physics,
    input: Vec<f64>,
    output: Vec<f64>,
    laws: Vec<Law>,
    /// Actuators whose motor never had power.
    on_stand: Vec<bool>,
    stuck: bool,
}

/// Force on an actuator: f − k (u − u*) − d u̇, with the inertia of the rotor.
#[derive(Clone, Copy, Debug)]
struct Law {
    force: f64,
    stiffness: f64,
    target: f64,
    damping: f64,
    inertia: f64,
}

impl Moving {
    /// The configuration's robot, at rest where all its independent coordinates are zero.
    pub(super) fn new(configuration: &Configuration, physics: Physics) -> Result<Moving, String> {
        let source = configuration
            .source
            .as_ref()
            .ok_or("--dynamics robot needs a configuration with `robot` or `urdf`")?;
        let mut robot =
            Robot::load(source, &Options::default()).map_err(|error| error.to_string())?;
        let n_y = robot.model().sizes.n_vy;
        let n_u = configuration.actuators.len();
        if robot.model().sizes.n_qy != n_y {
            return Err("--dynamics robot needs a robot whose base is fixed".to_owned());
        }
        let query = robot.query(Request::InverseDynamics).given(["y", "yd", "ydd"]);
        let plan = query.want(["u", "ud", "G_u", "M_y", "C_y"]).prepare();
        let plan = plan.map_err(|error| error.to_string())?;
        let still = Law {
            force: 0.0,
            stiffness: 0.0,
            target: 0.0,
            damping: physics.inertia / STAND,
            inertia: physics.inertia,
        };
        let output = vec![0.0; 2 * n_u + n_u * n_y + n_y * n_y + n_y];
        let mut moving = Moving {
            robot,
            plan,
            y: vec![0.0; n_y],
            yd: vec![0.0; n_y],
            n_u,
            physics,
            input: vec![0.0; 3 * n_y],
            output,
            laws: vec![still; n_u],
            on_stand: vec![true; n_u],
            stuck: false,
        };
        moving.ask()?;
        Ok(moving)
    }

    /// Position and velocity of an actuator.
    pub(super) fn actuator(&self, actuator: usize) -> (f64, f64) {
        let number = |place: usize| self.output.get(place).copied().unwrap_or(0.0);
        (number(actuator), number(self.n_u + actuator))
    }

    /// Sets the law by which a motor drives its actuator until the next step.
    pub(super) fn drive(&mut self, actuator: usize, mapping: &Mapping, plant: &Plant) {
        let Mapping { sign, gear, offset, torque_constant } = *mapping;
        let (u, _) = self.actuator(actuator);
        let square = gear * gear;
        let law = plant.law;
        let (Some(place), Some(on_stand)) =
            (self.laws.get_mut(actuator), self.on_stand.get_mut(actuator))
        else {
            return;
        };
        *on_stand &= !plant.power;
        let friction = self.physics.friction * square;
        let inertia = self.physics.inertia * square;
        // where the actuator is when the motor's coordinate is that of the set-point
        let target = sign * (law.position + plant.zero) / gear + offset;
        let held = plant.drive_torque().abs() >= plant.physics.torque_limit;
        *place = if !plant.power {
            Law {
                force: 0.0,
                stiffness: 0.0,
                target: u,
                damping: match on_stand {
                    true => self.physics.inertia.max(1e-9) * square / STAND,
                    false => friction,
                },
                inertia,
            }
        } else if held {
            Law {
                force: sign * gear * torque_constant * plant.drive_torque(),
                stiffness: 0.0,
                target: u,
                damping: friction,
                inertia,
            }
        } else {
            let force = sign * gear * torque_constant * (law.torque + law.damping * law.velocity);
            let stiffness = square * torque_constant * law.stiffness;
            let damping = square * torque_constant * law.damping + friction;
            Law { force, stiffness, target, damping, inertia }
        };
    }

    /// Integrates `h` seconds. A robot whose step fails stands still, which is reported once.
    pub(super) fn step(&mut self, h: f64) {
        let n_y = self.y.len();
        let n_u = self.n_u;
        let (heads, rest) = self.output.split_at(2 * n_u);
        let (u, ud) = heads.split_at(n_u);
        let (G, rest) = rest.split_at(n_u * n_y);
        let (M, c) = rest.split_at(n_y * n_y);
        let at = |matrix: &[f64], row: usize, column: usize| {
            matrix.get(row * n_y + column).copied().unwrap_or(0.0)
        };

        // the system of this step
        let mut matrix = M.to_vec();
        let mut side: Vec<f64> = (0..n_y)
            .map(|i| {
                (0..n_y).map(|j| at(M, i, j) * self.yd.get(j).unwrap_or(&0.0)).sum::<f64>()
                    - h * c.get(i).unwrap_or(&0.0)
            })
            .collect();
        for (actuator, law) in self.laws.iter().enumerate() {
            let weight = law.inertia + h * law.damping + h * h * law.stiffness;
            let u = u.get(actuator).unwrap_or(&0.0);
            let ud = ud.get(actuator).unwrap_or(&0.0);
            let push = law.inertia * ud + h * (law.force - law.stiffness * (u - law.target));
            for i in 0..n_y {
                let left = at(G, actuator, i);
                if let Some(side) = side.get_mut(i) {
                    *side += left * push;
                }
                for j in 0..n_y {
                    if let Some(entry) = matrix.get_mut(i * n_y + j) {
                        *entry += left * weight * at(G, actuator, j);
                    }
                }
            }
        }

        // forward, unless it fails
        let before = (self.y.clone(), self.yd.clone());
        let moved = solve(&mut matrix, &mut side);
        if moved {
            self.yd.copy_from_slice(&side);
            self.y.iter_mut().zip(&self.yd).for_each(|(y, yd)| *y += h * yd);
        }
        if !moved || self.ask().is_err() {
            if !self.stuck {
                eprintln!("the robot cannot go on from here and stands still");
            }
            self.stuck = true;
            self.y = before.0;
            self.yd.fill(0.0);
            // where it was it could be evaluated
            let _ = self.ask();
        } else {
            self.stuck = false;
        }
    }

    /// Evaluates the robot where it is.
    fn ask(&mut self) -> Result<(), String> {
        let numbers = self.y.iter().chain(&self.yd).copied().chain(std::iter::repeat(0.0));
        self.input.iter_mut().zip(numbers).for_each(|(place, number)| *place = number);
        let answer = self
            .robot
            .ask(self.plan, &self.input, &mut self.output)
            .map_err(|error| error.to_string())?;
        if answer.status == Status::Ok {
            Ok(())
        } else {
            Err(format!("the robot cannot stand at zero: {}", answer.status.name()))
        }
    }
}

/// Solves a symmetric positive definite system in place by Cholesky's method; false where it is
/// none.
fn solve(matrix: &mut [f64], side: &mut [f64]) -> bool {
    let n = side.len();
    let at =
        |matrix: &[f64], i: usize, j: usize| matrix.get(i * n + j).copied().unwrap_or(f64::NAN);
    for j in 0..n {
        for i in j..n {
            let inner: f64 = (0..j).map(|k| at(matrix, i, k) * at(matrix, j, k)).sum();
            let rest = at(matrix, i, j) - inner;
            let entry = if i == j { rest.sqrt() } else { rest / at(matrix, j, j) };
            if !entry.is_finite() || (i == j && entry <= 0.0) {
                return false;
            }
            if let Some(place) = matrix.get_mut(i * n + j) {
                *place = entry;
            }
        }
    }
    for i in 0..n {
        let inner: f64 = (0..i).map(|k| at(matrix, i, k) * side.get(k).unwrap_or(&0.0)).sum();
        let entry = (side.get(i).unwrap_or(&0.0) - inner) / at(matrix, i, i);
        side.iter_mut().skip(i).take(1).for_each(|place| *place = entry);
    }
    for i in (0..n).rev() {
        let inner: f64 = (i + 1..n).map(|k| at(matrix, k, i) * side.get(k).unwrap_or(&0.0)).sum();
        let entry = (side.get(i).unwrap_or(&0.0) - inner) / at(matrix, i, i);
        side.iter_mut().skip(i).take(1).for_each(|place| *place = entry);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_is_solved() {
        let mut matrix = vec![4.0, 2.0, 0.4, 2.0, 3.0, 0.6, 0.4, 0.6, 2.0];
        let mut side = vec![4.0 + 4.0 + 1.2, 2.0 + 6.0 + 1.8, 0.4 + 1.2 + 6.0];
        assert!(solve(&mut matrix, &mut side));
        for (got, expected) in side.iter().zip([1.0, 2.0, 3.0]) {
            assert!((got - expected).abs() < 1e-12, "{side:?}");
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_refused() {
        assert!(!solve(&mut [1.0, 2.0, 2.0, 1.0], &mut [1.0, 1.0]));
        assert!(!solve(&mut [f64::NAN], &mut [1.0]));
    }
}
