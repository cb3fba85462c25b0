//! Names, orders, sizes and limits of one robot: the same in its model, on the wire and in reports.

use core::ops::Range;

#[cfg(feature = "transport")]
use serde::{Deserialize, Serialize};

use crate::Sizes;
use crate::wire_enum::named_enum;

/// Names, orders, sizes and limits of a compiled robot. Travels as JSON.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "transport", derive(Serialize, Deserialize))]
pub struct ModelInfo {
    /// Name of the robot.
    pub robot: String,
    /// A number that differs whenever any name, order or constant differs; every request carries
    /// it.
    pub fingerprint: u64,
    /// Sizes that fix the shape of every field.
    pub sizes: Sizes,
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
    /// Links; a link's index is its number in [`crate::Query`].
    pub links: Vec<String>,
    /// Limits of the tree coordinates, in the order of q̇ (n_v).
    pub limits: Vec<Option<JointLimits>>,
    /// One for each submechanism.
    pub closures: Vec<ClosureInfo>,
    /// Warnings about the files, one line each; a model without files has none.
    pub warnings: Vec<String>,
}

/// Limits of a joint, in its own unit; `None` without a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "transport", derive(Serialize, Deserialize))]
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

impl JointLimits {
    /// Each limited quantity with its least and greatest value: the columns of
    /// [`crate::Field::Limits`].
    pub fn ranges(&self) -> [(&'static str, Option<f64>, Option<f64>); 3] {
        let both = |what, most: Option<f64>| (what, most.map(|x| -x), most);
        [
            ("position", self.lower, self.upper),
            both("velocity", self.velocity),
            both("effort", self.effort),
        ]
    }
}

/// A joint of the tree and its places in the orders of the model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TreeJoint<'a> {
    /// Name of the joint.
    pub name: &'a str,
    /// Its velocities in q̇.
    pub v: Range<usize>,
    /// Its coordinates in q.
    pub q: Range<usize>,
}

/// The closure of one submechanism's loops.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "transport", derive(Serialize, Deserialize))]
pub struct ClosureInfo {
    /// Contextual name.
    pub name: String,
    /// The type as written.
    #[cfg_attr(feature = "transport", serde(rename = "type"))]
    pub type_name: String,
    /// How it is closed.
    pub kind: ClosureKind,
    /// Constraint rows.
    pub rows: usize,
    /// Number of independent rows.
    pub rank: usize,
    /// Idle joints, which only turn a rod between its ball joints; they keep their initial value.
    pub idle: Vec<String>,
    /// Characteristic length of its largest cluster, in which rows are scaled `[m]`; zero without
    /// loops.
    pub length: f64,
    /// Deviation of the geometry from the closed form's assumptions, relative to the cluster's
    /// size.
    pub misfit: f64,
}

named_enum! {
    /// How loops are closed.
    #[cfg_attr(feature = "transport", derive(Serialize, Deserialize))]
    #[cfg_attr(feature = "transport", serde(rename_all = "lowercase"))]
    pub enum ClosureKind {
        /// By a closed form.
        Analytic = "analytic",
        /// By Newton's method.
        Numerical = "numerical",
        /// No loops.
        Serial = "serial",
    }
}

impl ModelInfo {
    /// The number of a link.
    pub fn link(&self, name: &str) -> Option<u16> {
        self.links.iter().position(|link| link == name).and_then(|index| u16::try_from(index).ok())
    }

    /// The limits of a coordinate of the tree; `None` without any.
    pub fn limits_of(&self, name: &str) -> Option<JointLimits> {
        let row = self.tree.iter().position(|of_tree| of_tree == name)?;
        self.limits.get(row).copied().flatten()
    }

    /// The joints of the tree, in the order of q̇, each with its places in it and in q. A joint of
    /// one degree of freedom has one name in both; one of several has a name for each part, behind
    /// a stroke (`base/rx`, `base/qx`).
    pub fn joints(&self) -> impl Iterator<Item = TreeJoint<'_>> {
        let mut v = 0;
        let mut q = 0;
        core::iter::from_fn(move || {
            let velocity = self.tree.get(v)?;
            let coordinate = self.tree_q.get(q)?;
            let (name, n_v, n_q) = if velocity == coordinate {
                (velocity.as_str(), 1, 1)
            } else if coordinate.ends_with("/qx") {
                (without_part(velocity), 3, 4)
            } else {
                (without_part(velocity), 6, 7)
            };
            let joint = TreeJoint {
                name,
                v: v..(v + n_v).min(self.tree.len()),
                q: q..(q + n_q).min(self.tree_q.len()),
            };
            v += n_v;
            q += n_q;
            Some(joint)
        })
    }

    /// Names of the parameters π in which forces are linear (n_parameters): for each joint of the
    /// tree the mass, first moment and inertia of the body that it carries, about the origin of
    /// that link's frame and in its axes; then of each tree velocity the inertia of its rotor, its
    /// dry and its viscous friction.
    pub fn parameters(&self) -> Vec<String> {
        const OF_BODY: [&str; 10] =
            ["m", "mx", "my", "mz", "ixx", "ixy", "iyy", "ixz", "iyz", "izz"];
        let bodies =
            self.joints().flat_map(|joint| OF_BODY.map(|of| format!("{}/{of}", joint.name)));
        let of_velocities = ["rotor", "coulomb", "viscous"];
        let others =
            of_velocities.iter().flat_map(|of| self.tree.iter().map(move |v| format!("{v}/{of}")));
        bodies.chain(others).collect()
    }

    /// Names of the numbers θ of the geometry (n_geometry): small turns about, then slides along
    /// the axes of a frame, of the origin of each joint of the tree in its parent, on the axes of
    /// the joint's frame; then of the frames of each cut on its predecessor and on its successor,
    /// on their own axes.
    pub fn geometry(&self) -> Vec<String> {
        let of = |place: String| ["rx", "ry", "rz", "x", "y", "z"].map(|k| format!("{place}/{k}"));
        let mut cuts: Vec<&str> = self
            .loops
            .iter()
            .filter_map(|row| row.rsplit_once('/'))
            .filter(|(_, row)| *row != "coupling")
            .map(|(cut, _)| cut)
            .collect();
        cuts.dedup();
        let ends = |cut| ["predecessor", "successor"].map(|end| format!("{cut}/{end}"));
        let joints = self.joints().map(|joint| joint.name.to_owned());
        joints.chain(cuts.into_iter().flat_map(ends)).flat_map(of).collect()
    }
}

/// `base` of `base/rx`.
fn without_part(velocity: &str) -> &str {
    velocity.strip_suffix("/rx").unwrap_or(velocity)
}

#[cfg(feature = "transport")]
impl ModelInfo {
    /// The information as JSON.
    pub fn to_json(&self) -> Vec<u8> {
        // maps with text keys, numbers and text: serialisation cannot fail
        serde_json::to_vec(self).unwrap_or_default()
    }

    /// Reads the information from its JSON.
    pub fn from_json(bytes: &[u8]) -> Option<ModelInfo> {
        serde_json::from_slice(bytes).ok()
    }
}

#[cfg(test)]
#[cfg(feature = "transport")]
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
        let closure = ClosureInfo {
            name: "ankle".into(),
            type_name: "2SPU+1U".into(),
            kind: ClosureKind::Analytic,
            rows: 4,
            rank: 4,
            idle: vec!["rod".into()],
            length: 0.1,
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
