//! Motors behind springs: the rotor of such an actuator has a position θ of its own, in the
//! coordinate u of its joint.
//!
//! ```text
//!   τ_u = k (θ − u),   J θ̈ = τ_m − k (θ − u),   J = N² I of the rotor
//! ```
//! τ_m is the motor's force, which gains, limits and windings see at θ and θ̇; the joint itself has
//! no rotor then. The spring is not stretched at the start: θ = u and θ̇ = u̇.

use sarrus_dynamics::description::Description;
use sarrus_dynamics::scalar::Real;
use sarrus_dynamics::{Compiled, Model, Status};

use crate::coordinates::Coordinates;
use crate::error::{Outcome, SimulationError};

/// A rotor behind a spring; its state is θ̇ and θ.
#[derive(Clone, Debug)]
pub(crate) struct Rotor {
    /// Coordinate and velocity of its joint in the tree.
    pub(crate) q: usize,
    pub(crate) v: usize,
    stiffness: f64,
    pub(crate) inertia: f64,
}

/// The rotors behind springs, in the order of u̇, and their names. A rotor without inertia is none:
/// its spring gives the motor's force at once.
pub(crate) fn rotors<C>(model: &Model<C>, description: &Description) -> (Vec<Rotor>, Vec<String>) {
    let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
    let of = |name: &String| {
        let joint = description.joints.iter().find(|joint| joint.name == *name)?;
        let v = model.tree_names().iter().position(|of| of == name)?;
        let stiffness = joint.motor.as_ref()?.series_stiffness;
        let inertia = joint.terms.gear_ratio * joint.terms.gear_ratio * joint.terms.rotor_inertia;
        let rotor = Rotor { q: tree.coordinate(v)?, v, stiffness, inertia };
        (stiffness.is_finite() && inertia > 0.0).then(|| (rotor, name.clone()))
    };
    model.active_names().iter().filter_map(of).unzip()
}

/// The robot whose joints of these names have no rotors.
pub(crate) fn parted(
    mut description: Description,
    names: &[String],
) -> Outcome<(Description, Compiled)> {
    for joint in description.joints.iter_mut().filter(|joint| names.contains(&joint.name)) {
        joint.terms.rotor_inertia = 0.0;
    }
    let fault = SimulationError::Start { status: Status::MassNotPositive, detail: 0.0 };
    let compiled = Model::compile(&description).map_err(|_| fault)?;
    Ok((description, compiled))
}

impl Rotor {
    /// Force of the spring on the joint.
    pub(crate) fn force<T: Real>(&self, angle: T, q: &[T]) -> T {
        T::from_f64(self.stiffness) * (angle - q[self.q])
    }

    /// Kinetic energy of the rotor, and of its spring.
    pub(crate) fn energy(&self, [speed, angle]: [f64; 2], q: &[f64]) -> [f64; 2] {
        let force = self.force(angle, q);
        [0.5 * self.inertia * speed * speed, 0.5 * force * force / self.stiffness]
    }
}
