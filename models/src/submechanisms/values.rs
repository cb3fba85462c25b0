//! The values of a submechanism file whose walk found no error, by serde.

use serde::Deserialize;

/// A submechanism file.
#[derive(Debug, Deserialize)]
pub(crate) struct Document {
    pub(crate) submechanisms: Vec<EntryValues>,
}

/// A submechanism.
#[derive(Debug, Deserialize)]
pub(crate) struct EntryValues {
    pub(crate) r#type: String,
    pub(crate) contextual_name: Option<String>,
    pub(crate) name: Option<String>,
    pub(crate) jointnames_spanningtree: Option<Vec<String>>,
    pub(crate) jointnames_independent: Option<Vec<String>>,
    pub(crate) jointnames_active: Option<Vec<String>>,
    pub(crate) loop_constraints: Option<Vec<LoopValues>>,
    pub(crate) closed_forms: Option<String>,
}

/// A loop constraint. Stabilisation parameters are of no use to exact closures.
#[derive(Debug, Deserialize)]
pub(crate) struct LoopValues {
    pub(crate) cut_joint: Option<String>,
    pub(crate) predecessor_body: Option<String>,
    pub(crate) successor_body: Option<String>,
    pub(crate) frames: Option<[String; 2]>,
    pub(crate) constraint_axes: Option<Vec<RowValues>>,
    pub(crate) cut_joint_type: Option<String>,
    pub(crate) axis: Option<[f64; 3]>,
    pub(crate) axis2: Option<[f64; 3]>,
    pub(crate) predecessor_placement: Option<PlacementValues>,
    pub(crate) successor_placement: Option<PlacementValues>,
}

/// A constrained direction.
#[derive(Debug, Deserialize)]
pub(crate) struct RowValues {
    pub(crate) name: String,
    pub(crate) axis: [f64; 6],
}

/// A placement by hand.
#[derive(Debug, Deserialize)]
pub(crate) struct PlacementValues {
    #[serde(default)]
    pub(crate) xyz: [f64; 3],
    #[serde(default)]
    pub(crate) rpy: [f64; 3],
}
