//! Springs and dampers between two points of two links.
//!
//! With d the distance from the first point to the second, l = |d| and n = d / l, the first point
//! is pulled along n by
//!
//! ```text
//!   f = k (l − l₀) + c l̇,   l̇ = n · (v_b − v_a)
//! ```
//! and the second by −f. Their energy is ½ k (l − l₀)², their loss c l̇².

use sarrus_dynamics::scalar::Real;

use crate::coordinates::{cross, turned};

/// A point of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Index of the link, in the order of [`sarrus_dynamics::Model::link_names`].
    pub link: usize,
    /// Where `[m]` {link}.
    pub at: [f64; 3],
}

/// A spring with a damper beside it between two points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    /// One end.
    pub from: Point,
    /// The other end.
    pub to: Point,
    /// k `[N/m]`.
    pub stiffness: f64,
    /// c `[N s/m]`.
    pub damping: f64,
    /// l₀ `[m]`.
    pub rest: f64,
}

/// Springs with the links that they join.
#[derive(Clone, Debug, Default)]
pub(crate) struct Springs {
    springs: Vec<Spring>,
    /// The links, each once, and for each spring the places of its ends among them.
    pub(crate) links: Vec<u16>,
    ends: Vec<[usize; 2]>,
}

/// Combined forces and energy of all springs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Effect<T> {
    /// ½ Σ k (l − l₀)².
    pub(crate) energy: T,
    /// Σ c l̇².
    pub(crate) loss: T,
}

impl Springs {
    pub(crate) fn new(springs: &[Spring]) -> Springs {
        let mut links = Vec::new();
        let ends = springs
            .iter()
            .map(|spring| {
                [spring.from.link, spring.to.link].map(|link| {
                    links.iter().position(|of| usize::from(*of) == link).unwrap_or_else(|| {
                        links.push(link as u16);
                        links.len() - 1
                    })
                })
            })
            .collect();
        Springs { springs: springs.to_vec(), links, ends }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.springs.is_empty()
    }

    pub(crate) fn have_dampers(&self) -> bool {
        self.springs.iter().any(|spring| spring.damping != 0.0)
    }

    /// Wrenches `[n; f]` on the links at their origins {root axes}, from their poses (7 each) and
    /// twists (6 each).
    pub(crate) fn wrenches<T: Real>(
        &self,
        poses: &[T],
        twists: &[T],
        wrenches: &mut [T],
    ) -> Effect<T> {
        wrenches.fill(T::ZERO);
        let mut effect = Effect { energy: T::ZERO, loss: T::ZERO };
        for (spring, ends) in self.springs.iter().zip(&self.ends) {
            // both points: arm, place, velocity
            let [a, b] = [(ends[0], spring.from.at), (ends[1], spring.to.at)].map(|(link, at)| {
                let (pose, twist) =
                    (&poses[7 * link..7 * link + 7], &twists[6 * link..6 * link + 6]);
                let arm = turned(&pose[3..], at.map(T::from_f64));
                let spin = cross([twist[0], twist[1], twist[2]], arm);
                (
                    arm,
                    [0, 1, 2].map(|k| pose[k] + arm[k]),
                    [0, 1, 2].map(|k| twist[3 + k] + spin[k]),
                )
            });
            let distance = [0, 1, 2].map(|k| b.1[k] - a.1[k]);
            let length = dot(distance, distance).sqrt();
            // ends that meet pull in no direction
            if !T::ZERO.lt(length) {
                effect.energy += T::from_f64(0.5 * spring.stiffness * spring.rest * spring.rest);
                continue;
            }
            let along = distance.map(|x| x / length);
            let rate = dot(along, [0, 1, 2].map(|k| b.2[k] - a.2[k]));
            let stretch = length - T::from_f64(spring.rest);
            let k = T::from_f64(spring.stiffness);
            let c = T::from_f64(spring.damping);
            let force = along.map(|x| x * (k * stretch + c * rate));
            for (link, arm, sign) in [(ends[0], a.0, T::ONE), (ends[1], b.0, -T::ONE)] {
                let force = force.map(|x| sign * x);
                let moment = cross(arm, force);
                for k in 0..3 {
                    wrenches[6 * link + k] += moment[k];
                    wrenches[6 * link + 3 + k] += force[k];
                }
            }
            effect.energy += T::from_f64(0.5) * k * stretch * stretch;
            effect.loss += c * rate * rate;
        }
        effect
    }
}

fn dot<T: Real>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
