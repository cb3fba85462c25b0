//! Report on the steps of a plan, in words and numbers.

use sarrus_proto::Field::{CY, TorqueSupportNet, TorqueVerticesNet};
use sarrus_proto::Request;

use crate::closure::Level;
use crate::model::{Method, Model};
use crate::plan::Plan;

/// Steps of a plan: see [`Plan::outline`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outline {
    /// The steps in their order.
    pub steps: Vec<&'static str>,
    /// Number of bodies whose pose, motion or force is computed, and of all bodies.
    pub bodies: usize,
    /// See `bodies`.
    pub bodies_of_robot: usize,
    /// Clusters whose coordinates are read or whose loops are closed.
    pub clusters: usize,
    /// Number of clusters of the robot.
    pub clusters_of_robot: usize,
    /// Clusters whose loops are closed.
    pub closed: usize,
    /// Number of clusters with loops.
    pub closed_of_robot: usize,
    /// Bytes of the numbers that a request gives.
    pub bytes_in: usize,
    /// Bytes of the numbers that an answer holds.
    pub bytes_out: usize,
}

impl Plan {
    /// Steps and omissions of the plan on its model. Allocates.
    pub fn outline<C>(&self, model: &Model<C>) -> Outline {
        let steps = &self.steps;
        let scope = &self.needed.scope;
        let moves = steps.velocity.is_some();
        let is_dynamic =
            matches!(self.request, Request::InverseDynamics | Request::ForwardDynamics);
        let forces = is_dynamic
            && (steps.newton_euler || self.wants_any(&[CY, TorqueVerticesNet, TorqueSupportNet]));
        let rests = if steps.newton_euler { steps.rest } else { steps.bias_at_rest };
        let is_forward = self.request == Request::ForwardDynamics;
        let list = [
            (
                !scope.closed.is_empty(),
                match steps.level {
                    Level::Position => "close loops: positions",
                    Level::Jacobian | Level::Velocity => "close loops: positions, G",
                    Level::Acceleration => "close loops: positions, G, g",
                },
            ),
            (steps.poses && !scope.posed.is_empty(), "poses of bodies"),
            (forces && is_forward && moves, "bias forces by Newton-Euler"),
            (forces && is_forward && !moves, "gravity"),
            (forces && !is_forward && !rests, "forces by Newton-Euler"),
            (forces && !is_forward && rests, "gravity"),
            (!self.wrench_links.is_empty(), "wrenches"),
            (steps.mass_matrix, "mass matrix by composite bodies"),
            (is_forward && self.method == Method::Recursion, "accelerations by recursion"),
            (is_forward && self.method == Method::Projection, "accelerations by projection"),
            (is_forward && self.method == Method::Kkt, "accelerations of the whole system"),
            (
                self.request == Request::Map && !scope.independents.is_empty(),
                "forces between spaces",
            ),
            (steps.frames, "frames in the root"),
            (steps.frames && steps.frame_velocities && moves, "twists of frames"),
            (steps.links, "sums over the links"),
            (steps.derivatives, "derivatives"),
            (self.first.is_some(), "differences of derivatives in double-double"),
            (steps.regressor, "forces by parameters"),
            (steps.geometry, "derivatives by geometry"),
            (self.motors.is_some(), "limits of actuators"),
            (steps.task_space, "inertia of the frames"),
            (steps.conditions, "conditions of the loops"),
        ];
        Outline {
            steps: list.into_iter().filter(|(is_done, _)| *is_done).map(|(_, step)| step).collect(),
            bodies: if steps.poses { scope.posed.count() } else { self.bodies_of_clusters(model) },
            bodies_of_robot: model.bodies.len() - 1,
            clusters: self.needed.coordinates.len(),
            clusters_of_robot: model.clusters.len(),
            closed: scope.closed.len(),
            closed_of_robot: model.closed_clusters.len(),
            bytes_in: 8 * self.given.len(),
            bytes_out: 8 * self.want.len(),
        }
    }

    /// Bodies of the clusters that are closed or read.
    fn bodies_of_clusters<C>(&self, model: &Model<C>) -> usize {
        self.needed.coordinates.iter().map(|c| model.clusters[*c].n).sum()
    }
}
