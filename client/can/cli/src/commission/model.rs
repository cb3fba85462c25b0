//! The efforts that hold the robot, by its model.

use sarrus_can_core::config::Configuration;
use sarrus_client::{Options, PlanId, Request, Robot, Status};

/// The robot of a configuration.
pub(super) struct Model(Option<Loaded>);

struct Loaded {
    robot: Robot,
    to_pose: PlanId,
    to_efforts: PlanId,
    /// y, then zeros for ẏ and ÿ; and τ_u.
    motion: Vec<f64>,
    efforts: Vec<f64>,
}

impl Model {
    /// The robot, where each of its actuators has a motor.
    pub(super) fn new(configuration: &Configuration) -> Result<Model, super::Error> {
        let is_driven = configuration.motors.len() == configuration.actuators.len();
        let Some(source) = configuration.source.as_ref().filter(|_| is_driven) else {
            return Ok(Model(None));
        };
        let mut robot = Robot::load(source, &Options::default())?;
        let to_pose = robot.query(Request::Map).given(["u"]).want(["y"]).prepare()?;
        let to_efforts = robot
            .query(Request::InverseDynamics)
            .given(["y", "yd", "ydd"])
            .want(["tau_u"])
            .prepare()?;
        let sizes = robot.model().sizes;
        let motion = vec![0.0; sizes.n_qy + 2 * sizes.n_vy];
        let efforts = vec![0.0; sizes.n_u];
        Ok(Model(Some(Loaded { robot, to_pose, to_efforts, motion, efforts })))
    }

    /// Whether each set of actuator positions has a pose: then a wrong zero shows in the efforts
    /// alone.
    pub(super) fn closes_anywhere(&self) -> bool {
        let sizes = self.0.as_ref().map(|loaded| loaded.robot.model().sizes);
        sizes.is_some_and(|sizes| sizes.n_u <= sizes.n_vy)
    }

    /// Takes the efforts at rest at actuator positions: NaN without a robot. False where it has no
    /// such pose.
    pub(super) fn hold(&mut self, u: &[f64], efforts: &mut [f64]) -> bool {
        efforts.fill(f64::NAN);
        let Some(loaded) = &mut self.0 else { return true };
        let Loaded { robot, to_pose, to_efforts, motion, efforts: of_model } = loaded;
        let n_y = robot.model().sizes.n_qy;
        let is_ok = |answer: Result<sarrus_client::Answer, _>| {
            answer.is_ok_and(|answer: sarrus_client::Answer| answer.status == Status::Ok)
        };
        let Some(y) = motion.get_mut(..n_y) else { return false };
        if !is_ok(robot.ask(*to_pose, u, y)) || !is_ok(robot.ask(*to_efforts, motion, of_model)) {
            return false;
        }
        efforts.iter_mut().zip(of_model).for_each(|(into, effort)| *into = *effort);
        true
    }
}
