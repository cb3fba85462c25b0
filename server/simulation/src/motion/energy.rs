//! Energy of a robot from masses, poses and twists of its links, with rotors and springs in joints;
//! without any mass matrix.

use nalgebra::{Matrix3, Vector3};
use sarrus_dynamics::description::Description;
use sarrus_dynamics::{Field, FieldSet, Model, PlanScalar, Planned, Query, Request, Status};

use crate::coordinates::{Coordinates, cross, turned};
use crate::error::{Outcome, answered};

/// Links in one plan.
const CHUNK: usize = 32;

/// Energies at one state, and how far the loops are open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of links and rotors `[J]`.
    pub kinetic: f64,
    /// Of gravity, of springs in joints and between links `[J]`.
    pub potential: f64,
    /// Largest scaled residual of the loops.
    pub residual: f64,
}

/// A link that has mass.
#[derive(Clone, Debug)]
struct Mass {
    mass: f64,
    /// Centre of mass {link}.
    at: [f64; 3],
    /// Inertia about it {link}.
    inertia: Matrix3<f64>,
}

/// Measures energies, in the precision in which loops are closed.
#[derive(Clone, Debug)]
pub(crate) struct Meter<T: PlanScalar> {
    masses: Vec<Mass>,
    plans: Vec<Planned<T>>,
    gravity: [f64; 3],
    /// Velocity and inertia of each rotor; coordinate, stiffness and rest of each joint's spring.
    rotors: Vec<(usize, f64)>,
    springs: Vec<(usize, f64, f64)>,
}

impl<T: PlanScalar> Meter<T> {
    pub(crate) fn new(model: &Model<T>, description: &Description) -> Outcome<Meter<T>> {
        let tree = Coordinates::of(model.tree_q_names(), model.tree_names());
        let mut links = Vec::new();
        let mut masses = Vec::new();
        for (k, link) in description.links.iter().enumerate() {
            if let Some(inertial) = &link.inertial {
                links.push(k as u16);
                let [xx, xy, xz, yy, yz, zz] = inertial.inertia;
                let I = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
                let R = Matrix3::<f64>::from(inertial.origin.rotation()).transpose();
                masses.push(Mass {
                    mass: inertial.mass,
                    at: inertial.origin.xyz,
                    inertia: R * I * R.transpose(),
                });
            }
        }
        use Field::*;
        let has_loops = model.sizes().n_c > 0;
        let given = FieldSet::of(if has_loops { &[Y, Yd, QGuess, QdGuess] } else { &[Y, Yd] });
        let bare = FieldSet::of(&[Residual, Q, Qd]);
        let mut plans = vec![Planned::new(model, &Query::new(Request::Kinematics, given, bare))?];
        for chunk in links.chunks(CHUNK) {
            let want = FieldSet::of(&[FramePose, FrameTwist]);
            let query = Query::new(Request::Kinematics, given, want).with_frames(chunk);
            plans.push(Planned::new(model, &query)?);
        }
        let mut rotors = Vec::new();
        let mut springs = Vec::new();
        for joint in &description.joints {
            let Some(v) = model.tree_names().iter().position(|name| *name == joint.name) else {
                continue;
            };
            let terms = &joint.terms;
            rotors.push((v, terms.gear_ratio * terms.gear_ratio * terms.rotor_inertia));
            springs.extend(tree.coordinate(v).map(|q| (q, terms.stiffness, terms.rest)));
        }
        rotors.retain(|of| of.1 != 0.0);
        springs.retain(|of| of.1 != 0.0);
        Ok(Meter { masses, plans, gravity: description.gravity, rotors, springs })
    }

    /// Energies at y and ẏ on the branch of a guess, without springs between links.
    pub(crate) fn measure(
        &mut self,
        model: &Model<T>,
        [y, yd]: [&[f64]; 2],
        [q, qd]: [&[f64]; 2],
    ) -> Result<Energy, Status> {
        let of = |numbers: &[f64]| numbers.iter().map(|x| T::from_f64(*x)).collect::<Vec<T>>();
        let back = |numbers: &[T]| numbers.iter().map(|x| x.to_f64()).collect::<Vec<f64>>();
        let mut energy = Energy::default();
        let mut masses = self.masses.iter();
        for plan in &mut self.plans {
            for (field, numbers) in
                [(Field::Y, y), (Field::Yd, yd), (Field::QGuess, q), (Field::QdGuess, qd)]
            {
                plan.give(field, &of(numbers));
            }
            answered(plan.run(model).status)?;
            energy.residual += plan.get(Field::Residual).iter().map(|x| x.to_f64()).sum::<f64>();
            let (poses, twists) =
                (back(plan.get(Field::FramePose)), back(plan.get(Field::FrameTwist)));
            for ((pose, twist), mass) in
                poses.chunks_exact(7).zip(twists.chunks_exact(6)).zip(&mut masses)
            {
                let (kinetic, potential) = mass.energy(pose, twist, self.gravity);
                energy.kinetic += kinetic;
                energy.potential += potential;
            }
        }
        let (q, qd) = self.plans.first().map_or((Vec::new(), Vec::new()), |plan| {
            (back(plan.get(Field::Q)), back(plan.get(Field::Qd)))
        });
        energy.kinetic +=
            self.rotors.iter().map(|(v, inertia)| 0.5 * inertia * qd[*v] * qd[*v]).sum::<f64>();
        energy.potential += self
            .springs
            .iter()
            .map(|(i, k, rest)| 0.5 * k * (q[*i] - rest) * (q[*i] - rest))
            .sum::<f64>();
        Ok(energy)
    }
}

impl Mass {
    /// ½ m v² + ½ ω I ω and −m g · c.
    fn energy(&self, pose: &[f64], twist: &[f64], gravity: [f64; 3]) -> (f64, f64) {
        let arm = turned(&pose[3..], self.at);
        let spin = cross([twist[0], twist[1], twist[2]], arm);
        let v = [0, 1, 2].map(|k| twist[3 + k] + spin[k]);
        // ω in the link
        let back = [-pose[3], -pose[4], -pose[5], pose[6]];
        let w = Vector3::from(turned(&back, [twist[0], twist[1], twist[2]]));
        let turning = w.dot(&(self.inertia * w));
        let kinetic = 0.5 * (self.mass * v.iter().map(|x| x * x).sum::<f64>() + turning);
        (kinetic, -self.mass * (0..3).map(|k| gravity[k] * (pose[k] + arm[k])).sum::<f64>())
    }
}
