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

use sarrus_can_core::cholesky::Cholesky;
use sarrus_can_core::config::Configuration;
use sarrus_can_core::mapping::Mapping;
use sarrus_can_sim::{Physics, Plant};
use sarrus_client::{Options, PlanId, Request, Robot, Status};

use super::Error;

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
#[derive(Clone, Copy, Debug, Default)]
struct Law {
    force: f64,
    stiffness: f64,
    target: f64,
    damping: f64,
    inertia: f64,
}

impl Moving {
    /// The configuration's robot, at rest where all its independent coordinates are zero.
    pub(super) fn new(configuration: &Configuration, physics: Physics) -> Result<Moving, Error> {
        let source = configuration
            .source
            .as_ref()
            .ok_or("--dynamics robot needs a configuration with `robot` or `urdf`")?;
        let mut robot = Robot::load(source, &Options::default())?;
        let n_y = robot.model().sizes.n_vy;
        let n_u = configuration.actuators.len();
        if robot.model().sizes.n_qy != n_y {
            return Err("--dynamics robot needs a robot whose base is fixed".into());
        }
        let query = robot.query(Request::InverseDynamics).given(["y", "yd", "ydd"]);
        let plan = query.want(["u", "ud", "G_u", "M_y", "C_y"]).prepare()?;
        let Physics { inertia, .. } = physics;
        let still = Law { damping: inertia / STAND, inertia, ..Law::default() };
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
        (self.output[actuator], self.output[self.n_u + actuator])
    }

    /// Sets the law by which a motor drives its actuator until the next step.
    pub(super) fn drive(&mut self, actuator: usize, mapping: &Mapping, plant: &Plant) {
        let Mapping { sign, gear, offset, torque_constant } = *mapping;
        let square = gear * gear;
        let law = plant.law;
        self.on_stand[actuator] &= !plant.power;
        let friction = self.physics.friction * square;
        let limp = Law {
            target: self.output[actuator],
            damping: friction,
            inertia: self.physics.inertia * square,
            ..Law::default()
        };
        let is_held = plant.drive_torque().abs() >= plant.physics.torque_limit;
        self.laws[actuator] = if self.on_stand[actuator] {
            Law { damping: self.physics.inertia.max(1e-9) * square / STAND, ..limp }
        } else if !plant.power {
            limp
        } else if is_held {
            Law { force: sign * gear * torque_constant * plant.drive_torque(), ..limp }
        } else {
            Law {
                force: sign * gear * torque_constant * (law.torque + law.damping * law.velocity),
                stiffness: square * torque_constant * law.stiffness,
                // where the actuator is when the motor's coordinate is that of the set-point
                target: sign * (law.position + plant.zero) / gear + offset,
                damping: square * torque_constant * law.damping + friction,
                ..limp
            }
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
        // the system of this step
        let mut system = Cholesky::new(n_y);
        system.matrix.copy_from_slice(M);
        let momentum = |i: usize| (0..n_y).map(|j| M[i * n_y + j] * self.yd[j]).sum::<f64>();
        let mut side: Vec<f64> = (0..n_y).map(|i| momentum(i) - h * c[i]).collect();
        for (k, law) in self.laws.iter().enumerate() {
            let G_k = &G[k * n_y..(k + 1) * n_y];
            let weight = law.inertia + h * law.damping + h * h * law.stiffness;
            let force = law.force - law.stiffness * (u[k] - law.target);
            let push = law.inertia * ud[k] + h * force;
            for i in 0..n_y {
                side[i] += G_k[i] * push;
                for j in 0..n_y {
                    system.matrix[i * n_y + j] += G_k[i] * weight * G_k[j];
                }
            }
        }
        // forward, unless it fails
        let before = self.y.clone();
        let moved = system.factorise();
        if moved {
            system.solve(&mut side);
            self.yd.copy_from_slice(&side);
            self.y.iter_mut().zip(&self.yd).for_each(|(y, yd)| *y += h * yd);
        }
        if !moved || self.ask().is_err() {
            if !self.stuck {
                eprintln!("the robot cannot go on from here and stands still");
            }
            self.stuck = true;
            self.y = before;
            self.yd.fill(0.0);
            // where it was it could be evaluated
            let _ = self.ask();
        } else {
            self.stuck = false;
        }
    }

    /// Evaluates the robot where it is.
    fn ask(&mut self) -> Result<(), Error> {
        let numbers = self.y.iter().chain(&self.yd).copied().chain(std::iter::repeat(0.0));
        self.input.iter_mut().zip(numbers).for_each(|(place, number)| *place = number);
        let answer = self.robot.ask(self.plan, &self.input, &mut self.output)?;
        if answer.status == Status::Ok {
            Ok(())
        } else {
            Err(format!("the robot cannot stand at zero: {}", answer.status.name()).into())
        }
    }
}
