//! The movement of the demo's controller, and its forces in double-double.

use sarrus_client::{Field, FieldSet, ModelInfo, Query, Request, Status};
use sarrus_dynamics::scalar::Dd;
use sarrus_dynamics::{Model, Plan, Workspace};

/// Length of the movement `[s]`.
pub(super) const DURATION: f64 = 5.0;
/// Requests that a controller of 1 kHz makes in that time.
pub(super) const SAMPLES: usize = 5001;

/// The part of its range, around the middle, through which a joint moves: farther out the linear
/// actuators reach their ends.
pub(super) const REACH: f64 = 0.3;

/// Motion in, actuator forces out.
pub(super) const QUERY: Query = Query::new(
    Request::InverseDynamics,
    FieldSet::of(&[Field::Y, Field::Yd, Field::Ydd]),
    FieldSet::of(&[Field::TauU]),
);

/// Moves every independent joint through the middle of its range along a cycloid, all at once:
/// start and distance of each.
pub(super) struct Trajectory(Vec<(f64, f64)>);

impl Trajectory {
    /// The movement of a model; a joint without limits counts as one from −1 to 1.
    pub(super) fn new(model: &ModelInfo) -> Trajectory {
        let movement = |name: &String| {
            let ends =
                model.limits_of(name).and_then(|limits| Some([limits.lower?, limits.upper?]));
            let [lower, upper] = ends.unwrap_or([-1.0, 1.0]);
            (0.5 * (lower + upper - REACH * (upper - lower)), REACH * (upper - lower))
        };
        Trajectory(model.independent.iter().map(movement).collect())
    }

    /// y, ẏ and ÿ of one sample, packed one after the other [K21, 6.1 to 6.3].
    pub(super) fn sample(&self, k: usize, input: &mut [f64]) {
        let rate = 2.0 * std::f64::consts::PI / DURATION;
        let t = k as f64 * DURATION / (SAMPLES - 1) as f64;
        let angle = rate * t;
        let (sin, cos) = angle.sin_cos();
        let (y, rest) = input.split_at_mut(self.0.len().min(input.len()));
        let (yd, ydd) = rest.split_at_mut(self.0.len().min(rest.len()));
        for (i, (lower, range)) in self.0.iter().enumerate() {
            let mean = range / DURATION;
            if let (Some(y), Some(yd), Some(ydd)) = (y.get_mut(i), yd.get_mut(i), ydd.get_mut(i)) {
                *y = lower + mean * (t - sin / rate);
                *yd = mean * (1.0 - cos);
                *ydd = mean * rate * sin;
            }
        }
    }
}

/// The forces of every sample in double-double arithmetic, 32 digits.
pub(super) struct Reference {
    n: usize,
    forces: Vec<Dd>,
    /// Samples without an answer in double-double.
    pub(super) failed: usize,
}

impl Reference {
    /// Computes it; `go_on` gets the part that is done and returns false to stop.
    pub(super) fn compute(
        exact: &Model<Dd>,
        trajectory: &Trajectory,
        mut go_on: impl FnMut(f64) -> bool,
    ) -> Option<Reference> {
        let plan = Plan::new(exact, &QUERY).ok()?;
        let mut workspace = Workspace::new(exact);
        let mut sample = vec![0.0; plan.given().len()];
        let mut input = vec![Dd::from(0.0); sample.len()];
        let n = plan.want().len();
        let mut reference =
            Reference { n, forces: vec![Dd::from(f64::NAN); n * SAMPLES], failed: 0 };
        for (k, forces) in reference.forces.chunks_exact_mut(n.max(1)).enumerate() {
            trajectory.sample(k, &mut sample);
            input.iter_mut().zip(&sample).for_each(|(exact, number)| *exact = Dd::from(*number));
            reference.failed +=
                usize::from(plan.run(exact, &mut workspace, &input, forces).status != Status::Ok);
            if !go_on(k as f64 / SAMPLES as f64) {
                return None;
            }
        }
        Some(reference)
    }

    /// The largest difference of an answer from the reference, relative to the largest force of the
    /// sample.
    pub(super) fn error(&self, k: usize, answer: &[f64]) -> f64 {
        let reference = self.forces.get(k * self.n..(k + 1) * self.n).unwrap_or_default();
        let size = reference.iter().fold(0.0_f64, |size, force| size.max(force.hi().abs()));
        let difference =
            |(answer, reference): (&f64, &Dd)| (Dd::from(*answer) - *reference).hi().abs();
        let worst = answer
            .iter()
            .zip(reference)
            .map(difference)
            .fold(0.0, |worst: f64, x| if x.is_nan() { f64::INFINITY } else { worst.max(x) });
        if reference.len() != answer.len() || size.is_nan() {
            f64::INFINITY
        } else {
            worst / size.max(f64::MIN_POSITIVE)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycloid_starts_and_ends_at_rest_at_the_limits_and_its_rates_are_its_derivatives() {
        let trajectory = Trajectory(vec![(-0.5, 2.0), (1.0, 0.5)]);
        let at = |k| {
            let mut input = [f64::NAN; 6];
            trajectory.sample(k, &mut input);
            input
        };
        let first = at(0);
        let last = at(SAMPLES - 1);
        assert_eq!(first, [-0.5, 1.0, 0.0, 0.0, 0.0, 0.0]);
        for (found, expected) in last.iter().zip([1.5, 1.5, 0.0, 0.0, 0.0, 0.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
        let [before, now, after] = [1700, 1701, 1702].map(at);
        let step = 2.0 * DURATION / (SAMPLES - 1) as f64;
        for i in 0..4 {
            assert!(((after[i] - before[i]) / step - now[i + 2]).abs() < 1e-6);
        }
    }
}
