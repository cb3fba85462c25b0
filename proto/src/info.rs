//! What a client learns about the model before it asks.

use serde::{Deserialize, Serialize};

use crate::Sizes;

/// Names, order, sizes and limits of a served model. Travels as JSON.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ModelInfo {
    /// Name of the robot.
    pub robot: String,
    /// Tells models apart; every request carries it.
    pub fingerprint: u64,
    /// Sizes that fix the shape of every field.
    pub sizes: ModelSizes,
    /// Order of q̇ (n_v).
    pub tree: Vec<String>,
    /// Order of q (n_q).
    pub tree_q: Vec<String>,
    /// Order of ẏ (n_vy).
    pub independent: Vec<String>,
    /// Order of y (n_qy).
    pub independent_q: Vec<String>,
    /// Order of u (n_u).
    pub active: Vec<String>,
    /// Order of the rows of K (n_c).
    pub loops: Vec<String>,
    /// Clusters that have a branch (n_branches).
    pub branches: Vec<String>,
    /// Links; a link's place is its number in [`crate::Query`].
    pub links: Vec<String>,
    /// Limits of the tree coordinates, in the order of q̇ (n_v).
    pub limits: Vec<Option<JointLimits>>,
    /// One for each submechanism.
    pub closures: Vec<Closure>,
    /// What is remarkable about the files.
    pub warnings: Vec<String>,
}

/// The sizes of a model, as they travel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelSizes {
    /// Tree coordinates.
    pub n_q: usize,
    /// Tree velocities.
    pub n_v: usize,
    /// Independent coordinates.
    pub n_qy: usize,
    /// Independent velocities.
    pub n_vy: usize,
    /// Actuators.
    pub n_u: usize,
    /// Constraint rows.
    pub n_c: usize,
    /// Tied clusters that are not pure couplings.
    pub n_branches: usize,
}

impl From<Sizes> for ModelSizes {
    fn from(Sizes { n_q, n_v, n_qy, n_vy, n_u, n_c, n_branches }: Sizes) -> ModelSizes {
        ModelSizes { n_q, n_v, n_qy, n_vy, n_u, n_c, n_branches }
    }
}

impl From<ModelSizes> for Sizes {
    fn from(ModelSizes { n_q, n_v, n_qy, n_vy, n_u, n_c, n_branches }: ModelSizes) -> Sizes {
        Sizes { n_q, n_v, n_qy, n_vy, n_u, n_c, n_branches }
    }
}

/// Limits of a joint, in its own unit; `None` where there is none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointLimits {
    /// Least position.
    pub lower: Option<f64>,
    /// Greatest position.
    pub upper: Option<f64>,
    /// Greatest speed.
    pub velocity: Option<f64>,
    /// Greatest force or moment.
    pub effort: Option<f64>,
}

/// How a submechanism is closed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Closure {
    /// Name of the submechanism.
    pub name: String,
    /// The type as it was written.
    #[serde(rename = "type")]
    pub type_name: String,
    /// `analytic`, `numerical` or `serial`.
    pub kind: String,
    /// Constraint rows.
    pub rows: usize,
    /// Rows that count.
    pub rank: usize,
    /// How far the file is from the closed form.
    pub misfit: f64,
}

impl ModelInfo {
    /// The information as it travels.
    pub fn to_json(&self) -> Vec<u8> {
        // maps with text keys, numbers and text: there is nothing in it that cannot be written
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads what travelled.
    pub fn from_json(bytes: &[u8]) -> Option<ModelInfo> {
        serde_json::from_slice(bytes).ok()
    }

    /// The sizes as layouts need them.
    pub fn sizes(&self) -> Sizes {
        self.sizes.into()
    }

    /// The number of a link.
    pub fn link(&self, name: &str) -> Option<u16> {
        self.links.iter().position(|link| link == name).and_then(|index| u16::try_from(index).ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn information_survives_the_journey_bit_by_bit() {
        let limits = JointLimits {
            lower: Some(-0.1 - 1e-17),
            upper: None,
            velocity: Some(1.0 / 3.0),
            effort: None,
        };
        let closure = Closure {
            name: "ankle".into(),
            type_name: "2SPU+1U".into(),
            kind: "analytic".into(),
            rows: 4,
            rank: 4,
            misfit: 1e-9 / 3.0,
        };
        let info = ModelInfo {
            robot: "ä \"robot\"".into(),
            fingerprint: u64::MAX - 1,
            links: vec!["a".into(), "b/c".into()],
            limits: vec![None, Some(limits)],
            closures: vec![closure],
            ..ModelInfo::default()
        };
        assert_eq!(ModelInfo::from_json(&info.to_json()), Some(info.clone()));
        assert_eq!((info.link("b/c"), info.link("x")), (Some(1), None));
        assert_eq!(ModelInfo::from_json(b"{}"), None);
    }
}
