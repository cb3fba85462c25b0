//! Limits that a motion exceeds: a simulation has no stops.

use sarrus_dynamics::ModelInfo;

use super::output::{Run, Sample};

/// An exceeded limit, at the sample with the largest excess.
#[derive(Clone, Debug, PartialEq)]
pub struct Exceeded {
    /// The joint.
    pub name: String,
    /// `position` or `velocity`.
    pub what: &'static str,
    /// The position or velocity and its limits.
    pub value: f64,
    /// The least one.
    pub lower: Option<f64>,
    /// The greatest one.
    pub upper: Option<f64>,
    /// Time `[s]`.
    pub time: f64,
    /// Time of the first sample beyond the limit `[s]`.
    pub since: f64,
}

impl Exceeded {
    /// The excess; negative within the limits.
    pub fn by(&self) -> f64 {
        let below = self.lower.map_or(f64::NEG_INFINITY, |lower| lower - self.value);
        let above = self.upper.map_or(f64::NEG_INFINITY, |upper| self.value - upper);
        below.max(above)
    }
}

impl Run {
    /// Every joint of the robot whose position or velocity leaves its limits, in the order of q̇.
    pub fn exceeded(&self, info: &ModelInfo) -> Vec<Exceeded> {
        let mut found = Vec::new();
        for (v, (name, limits)) in info.tree.iter().zip(&info.limits).enumerate() {
            let q = info.tree_q.iter().position(|of_q| of_q == name);
            let (Some(limits), Some(q)) = (limits, q) else { continue };
            // a sample holds no efforts
            let lists: [(usize, fn(&Sample) -> &[f64]); 2] =
                [(q, |sample| &sample.q), (v, |sample| &sample.qd)];
            for ((what, lower, upper), (k, list)) in limits.ranges().into_iter().zip(lists) {
                let of = |sample: &Sample| {
                    let value = list(sample).get(k).copied().unwrap_or(f64::NAN);
                    let time = sample.time;
                    Exceeded { name: name.clone(), what, value, lower, upper, time, since: time }
                };
                let mut beyond = self.samples.iter().map(of).filter(|of| of.by() > 0.0);
                let Some(first) = beyond.next() else { continue };
                let since = first.time;
                let worst =
                    beyond.fold(first, |worst, of| if of.by() > worst.by() { of } else { worst });
                found.push(Exceeded { since, ..worst });
            }
        }
        found
    }
}
