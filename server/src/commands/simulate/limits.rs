//! Limits that a motion exceeds: a simulation has no stops.

use sarrus_models::Loaded;
use sarrus_simulation::{Run, Sample};
use serde::Serialize;

/// An exceeded limit, at the sample with the largest excess.
#[derive(Debug, Serialize)]
pub(super) struct Exceeded {
    pub(super) name: String,
    /// `position` or `velocity`.
    pub(super) what: &'static str,
    pub(super) value: f64,
    pub(super) lower: Option<f64>,
    pub(super) upper: Option<f64>,
    /// Time `[s]`.
    pub(super) time: f64,
}

impl Exceeded {
    /// The excess.
    fn by(&self) -> f64 {
        let below = self.lower.map_or(0.0, |lower| lower - self.value);
        let above = self.upper.map_or(0.0, |upper| self.value - upper);
        below.max(above)
    }

    /// As text.
    pub(super) fn words(&self) -> String {
        let Exceeded { name, what, value, time, .. } = self;
        let by = self.by();
        format!("{what} of {name} is {by:.3} beyond its limit at {time} s ({value:.3})")
    }
}

/// Every joint whose position or velocity leaves its limits, in the order of q̇.
pub(super) fn exceeded(loaded: &Loaded, run: &Run) -> Vec<Exceeded> {
    let info = loaded.compiled.model.info();
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
                Exceeded { name: name.clone(), what, value, lower, upper, time: sample.time }
            };
            let worst = run.samples.iter().map(of).max_by(|a, b| a.by().total_cmp(&b.by()));
            found.extend(worst.filter(|worst| worst.by() > 0.0));
        }
    }
    found
}
